"""A configuration to endcaps that are ready to run: sources chosen, references read, models loaded once a design."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial

from cad.errors import FileError, ParameterError
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed, Feed, FileFeed, Pace
from sensing.live.core.model import LiveModel, load_model, require_reachable, weights_in_use
from sensing.live.core.pipeline import ZERO_FRAMES, EndcapPipeline
from sensing.live.demo.scene import SceneSource, scene_number
from sensing.sources.camera import CameraConfig
from sensing.sources.choose import source_opener
from sensing.sources.files import FolderSource
from sensing.tracking.zero import load_zero

CAMERA_HZ, PHOTOS_HZ = 30.0, 1.0
Models = Callable[[EndcapConfig], LiveModel]


def open_endcaps(config: LiveConfig, speed: float = 1.0, models: Models | None = None) -> list[LiveEndcap]:
    """Endcaps of a configuration, not yet started.

    Args:
        config: what to run.
        speed: of files.
        models: model of an endcap; None for that of the configuration.

    Raises:
        EndcapError: a source, reference, model, threshold or file that cannot be used.
    """
    models = models or configured_models(config)
    endcaps = []
    for number, endcap in enumerate(config.endcaps):
        model = models(endcap)  # before the feed: the first start of the simulated robot renders for some time
        require_reachable(model, endcap)
        zero = None if endcap.zero is None else load_zero(endcap.zero, endcap.identity)
        feed, live = open_feed(endcap, speed)
        pipeline = EndcapPipeline(endcap, model, zero, number, ZERO_FRAMES if live else 1)
        if isinstance(feed, FileFeed):
            _require_first(feed, pipeline)
        endcaps.append(LiveEndcap(feed, pipeline))
    if speed != 1.0 and not any(isinstance(endcap.feed, FileFeed) for endcap in endcaps):
        raise ParameterError(f"--speed {speed:g} has no effect: no source is a file: leave it out", name="speed")
    return endcaps


def _require_first(feed: FileFeed, pipeline: EndcapPipeline) -> None:
    """Refuse files whose first picture is to be the reference and cannot be read, or does not suit the camera file."""
    first = feed.first() if pipeline.zero is None else None
    if first is None:
        return
    if first.fault:
        raise FileError(f"{first.fault}; the first picture is the untouched endcap, or give a reference (zero)")
    pipeline.require_camera_of(first)


def configured_models(config: LiveConfig, any_silicone: bool = False) -> Models:
    """Loads the configuration's model once for each design.

    Args:
        config: names model and weights.
        any_silicone: weights that were trained for another silicone serve, too; so it is for endcaps that were weighed.
    """
    loaded: dict[str, LiveModel] = {}

    def of(endcap: EndcapConfig) -> LiveModel:
        weights = weights_in_use(config, endcap, any_silicone)
        silicone = None if weights is not None and (any_silicone or endcap.weighed) else endcap.silicone
        key = f"{endcap.identity.digest} {silicone} {weights}"
        if key not in loaded:
            loaded[key] = load_model(config.model, endcap.params, weights, config.method, silicone)
        return loaded[key]

    return of


def open_feed(endcap: EndcapConfig, speed: float = 1.0) -> tuple[Feed, bool]:
    """(feed of an endcap, whether it is live).

    Raises:
        EndcapError: no such source, or a setting that it would ignore.
    """
    number, rate_hz = scene_number(endcap.source), endcap.rate_hz or CAMERA_HZ
    if number is not None:
        _require_unset(endcap, "exposure")
        scene = partial(SceneSource, number, rate_hz, None, endcap.params, endcap.silicone)
        scene()  # a wrong number or a missing scene is refused at once
        return CameraFeed(scene), True
    if os.path.isdir(endcap.source):
        _require_unset(endcap, "exposure")
        folder = FolderSource(endcap.source, endcap.rate_hz or PHOTOS_HZ, faulty=True)
        return FileFeed(lambda: folder, Pace(speed)), False
    camera = CameraConfig(rate_hz=rate_hz, exposure=endcap.exposure or None)
    opener, live = source_opener(endcap.source, camera)
    if not live:
        _require_unset(endcap, "rate_hz", "exposure")
    opener()  # a camera that is not there, a bad address or a file that cannot be read is refused at once
    if live:
        return CameraFeed(opener), True
    return FileFeed(opener, Pace(speed)), False


def _require_unset(endcap: EndcapConfig, *names: str) -> None:
    """Refuse settings that the source of an endcap would ignore."""
    for name in names:
        if getattr(endcap, name):
            raise ParameterError(
                f"{name} of {endcap.name} has no effect on {endcap.source}: leave it out",
                name=name,
                value=getattr(endcap, name),
            )
