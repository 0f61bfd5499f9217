"""The methods by name, all behind one small interface."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import Protocol

import numpy as np

from cad import plugins
from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.records import DotTracks, Frame, ShearField
from sensing.tracking.baselines import DisField, FarnebackField, LucasKanadeField, normalised
from sensing.tracking.gelslim import CROP_PX, GelslimConfig, GelslimField
from sensing.tracking.tracker import DotTracker, TrackerConfig

METHODS = ("dots", "gelslim", "farneback", "dis", "lk", "dense")


def known_methods() -> tuple[str, ...]:
    """Names of the methods here and of those that plug-ins add."""
    return (*METHODS, *(name for name in plugins.names(plugins.Kind.FIELD_METHOD) if name not in METHODS))


def method_code(name: str) -> str:
    """SHA-256 of the Python files of the package that adds a method; empty for the methods here.

    What is kept of a method's fields holds only for the code that computed them.

    Args:
        name: one of :func:`known_methods`.

    Raises:
        ParameterError: a plug-in that cannot be imported.
    """
    if name in METHODS or name not in plugins.names(plugins.Kind.FIELD_METHOD):
        return ""
    made = plugins.load(plugins.Kind.FIELD_METHOD, name)
    package = sys.modules.get(str(getattr(made, "__module__", "")).partition(".")[0])
    files = [path for folder in getattr(package, "__path__", ()) for path in Path(folder).rglob("*.py")]
    if not files and (own := getattr(package, "__file__", None)):
        files = [Path(own)]
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()


class FieldMethod(Protocol):
    """Interface of a field method: computes fields from frames in order, and keeps the state that it needs."""

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame."""
        ...


class DotField:
    """The dots' field of the picture plane, behind the common interface; sharpened by the stretch that windows show.

    For pictures and comparisons of fields. A wrench model reads :class:`sensing.tracking.model_input.ModelInput`.

    Attributes:
        tracker: the tracker in use.
        tracks: tracks of the last frame, None before the first.
    """

    def __init__(
        self, reference: Frame, config: TrackerConfig | None = None, params: EndcapParams | None = None
    ) -> None:
        self.tracker = DotTracker(reference, config, params=params)
        self.tracks: DotTracks | None = None

    def update(self, frame: Frame) -> ShearField:
        """Field of one frame; keeps its tracks."""
        self.tracks = self.tracker.update(frame)
        return self.field(self.tracks)

    def field(self, tracks: DotTracks) -> ShearField:
        """Field of the tracks, in pixels of the 200 x 200 crop; all invalid while every dot is lost."""
        operator = self.tracker.operator
        channels = operator.field(tracks.displacement_px, tracks.stretch)
        channels *= np.float32(CROP_PX / min(self.tracker.size))
        return ShearField(tracks.time_s, channels, valid=operator.valid(~tracks.lost))


def field_method(
    name: str, reference: Frame, shape: tuple[int, int] = (30, 30), params: EndcapParams | None = None
) -> FieldMethod:
    """The method of that name, ready for frames of the same camera as the reference.

    Args:
        name: one of :func:`known_methods`.
        reference: the undeformed picture.
        shape: (H, W) of the field.
        params: the design, whose dots ``dots`` and ``lk`` look for; None for dots that look like the released ones.

    Raises:
        ParameterError: no such method.
    """
    if name == "dots":
        return DotField(reference, TrackerConfig(shape=shape), params)
    if name == "gelslim":
        return GelslimField(reference, GelslimConfig(shape=shape))
    if name == "farneback":
        return FarnebackField(reference, shape)
    if name == "dis":
        return DisField(reference, shape)
    if name == "lk":
        return LucasKanadeField(reference, shape, params)
    if name == "dense":
        return DisField(reference, shape, normalised)
    if name in known_methods():
        made: FieldMethod = plugins.make(plugins.Kind.FIELD_METHOD, name, "update", reference, shape)
        return made
    raise ParameterError(f"method={name!r}: choose from {', '.join(known_methods())}", name="method", value=name)
