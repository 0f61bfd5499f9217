"""A configuration to caps that are ready to run: sources chosen, references read, models loaded once a design."""

from __future__ import annotations

import os
from collections.abc import Callable

from cad.errors import ParameterError
from sensing.live.core.config import CapConfig, LiveConfig
from sensing.live.core.engine import LiveCap
from sensing.live.core.feed import CameraFeed, Feed, FileFeed, Pace
from sensing.live.core.model import LiveModel, load_model
from sensing.live.core.pipeline import ZERO_FRAMES, CapPipeline
from sensing.live.demo.scene import SceneSource, scene_number
from sensing.sources.camera import CameraConfig
from sensing.sources.choose import source_opener
from sensing.sources.files import FolderSource
from sensing.tracking.zero import load_zero

CAMERA_HZ, PHOTOS_HZ = 30.0, 1.0
Models = Callable[[CapConfig], LiveModel]


def open_caps(config: LiveConfig, speed: float = 1.0, models: Models | None = None) -> list[LiveCap]:
    """Caps of a configuration, not yet started.

    Args:
        config: what to run. speed: of files. models: model of a cap; None for that of the configuration.

    Raises:
        EndcapError: a source, reference, model or file that cannot be used.
    """
    models = models or configured_models(config)
    caps = []
    for number, cap in enumerate(config.caps):
        feed, live = open_feed(cap, speed)
        zero = None if cap.zero is None else load_zero(cap.zero)
        pipeline = CapPipeline(cap, models(cap), zero, number, ZERO_FRAMES if live else 1)
        caps.append(LiveCap(feed, pipeline))
    return caps


def configured_models(config: LiveConfig) -> Models:
    """Loads the configuration's model once for each design."""
    loaded: dict[str, LiveModel] = {}

    def of(cap: CapConfig) -> LiveModel:
        if cap.params.digest not in loaded:
            loaded[cap.params.digest] = load_model(config.model, cap.params, config.weights, config.method)
        return loaded[cap.params.digest]

    return of


def open_feed(cap: CapConfig, speed: float = 1.0) -> tuple[Feed, bool]:
    """(feed of a cap, whether it is live).

    Raises:
        EndcapError: no such source.
    """
    number, rate_hz = scene_number(cap.source), cap.rate_hz or CAMERA_HZ
    if number is not None:
        SceneSource(number, rate_hz)  # a wrong number or a missing scene is told at once
        return CameraFeed(lambda: SceneSource(number, rate_hz)), True
    if os.path.isdir(cap.source):
        folder = FolderSource(cap.source, cap.rate_hz or PHOTOS_HZ)
        return FileFeed(lambda: folder, Pace(speed)), False
    camera = CameraConfig(rate_hz=rate_hz, exposure=cap.exposure or None)
    opener, live = source_opener(cap.source, camera)
    if not live and (cap.rate_hz or cap.exposure):
        raise ParameterError(
            f"rate_hz and exposure of {cap.name} have no effect on {cap.source}: leave them out", name="rate_hz"
        )
    opener()  # a camera that is not there, a bad address or a file that cannot be read is told at once
    if live:
        return CameraFeed(opener), True
    return FileFeed(opener, Pace(speed)), False
