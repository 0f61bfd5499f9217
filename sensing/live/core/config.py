"""Configuration of a run: endcaps, their cameras and references, as in ``endcaps.toml``.

    model = "default"                   # or "paper"
    weights = ""                        # a file; empty for what ships with the toolkit
    method = ""                         # another field method than the model's own: dots, gelslim, ...
    weight_n = 117.7                    # of the robot, for the check of the force sum; 0 without

    [[endcap]]
    name = "endcap_0"                   # letters, digits, underscore; names topics and files
    source = "0"                        # camera number or /dev/v4l/by-path/..., http address, folder, video, plug-in's
    zero = "endcap_0.npz"               # relative to this file; empty: zeroed at the start, untouched
    camera = "endcap_0.json"            # of sensing.calibrate; empty: the design's, or found where that does not fit
    diameter_mm = 130.0
    wall_mm = 8.0
    silicone = "Smooth-Sil 950"         # row of cad/materials.csv
    dots = "released"                   # or dots of each ring, such as "1-6-10-12-16-18"
    dot_mm = 4.0                        # diameter of a dot
    lens = "released"                   # for which this was set up: checked, not chosen here
    own_weight = "subtracted"           # what a turn makes of the skin's own weight; "kept" leaves it in
    contact_on_n = 0.8                  # 0 for the model's own
    contact_off_n = 0.5                 # 0: 60 % of contact_on_n
    exposure = 0.0                      # fixed, in the driver's unit; 0: automatic
    rate_hz = 0.0                       # asked of a camera; 0: 30
    gain = 0.731                        # of sensing.weigh: stiffness of its silicone over that of the training data
    gain_sd = 0.008
    gain_date = "2026-01-01"
    gain_weights = "0123456789abcdef"   # digest of the model's weights that it was found with
    relaxation = [[0.054, 0.1, 0.005], [0.033, 1.0, 0.003]]    # of sensing.dwell: strength, tau in s, sd of strength
    T_robot_endcap = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]    # mm; yours: setup writes this

Forces in N, lengths in mm, times in s. ``python -m sensing.setup`` writes such a file.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cad import plugins
from cad.errors import ParameterError
from sensing.live.core.endcap_config import EndcapConfig
from sensing.sources.choose import is_camera_number
from sensing.tracking.methods import METHODS, known_methods

SCENE = "scene"  # with a number: an endcap of the simulated robot
MODELS = ("default", "paper")
MOST_ENDCAPS = 32


def known_models() -> tuple[str, ...]:
    """Names of the models here and of those that plug-ins add."""
    return (*MODELS, *(name for name in plugins.names(plugins.Kind.WRENCH_MODEL) if name not in MODELS))


@dataclass(frozen=True)
class LiveConfig:
    """Configuration of all endcaps of a run.

    Attributes:
        endcaps: at least one, names differ.
        model: ``default`` or ``paper``.
        weights: file of weights for all endcaps; None for those that ship or were trained.
        own_weights: files of single endcaps by name, as a recording carries them; ``weights`` goes before.
        method: field method; None for the model's own.
        weight_n: of the robot; 0 without the check.

    Raises:
        ParameterError: no endcap, a name or a camera twice, or an unknown model or method.
    """

    endcaps: tuple[EndcapConfig, ...]
    model: str = "default"
    weights: Path | None = None
    method: str | None = None
    weight_n: float = 0.0
    own_weights: Mapping[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [endcap.name for endcap in self.endcaps]
        twice = sorted({name for name in names if names.count(name) > 1})
        if not 1 <= len(names) <= MOST_ENDCAPS or twice:
            raise ParameterError(
                f"endcaps={', '.join(twice) or len(names)}: need 1..{MOST_ENDCAPS} endcaps of different names",
                name="endcaps",
            )
        self._check_cameras()
        if self.model not in MODELS and self.model not in known_models():
            raise ParameterError(
                f"model={self.model!r}: choose {' or '.join(known_models())}", name="model", value=self.model
            )
        if self.method not in (None, *METHODS) and self.method not in known_methods():
            raise ParameterError(
                f"method={self.method!r}: choose {', '.join(known_methods())}, or leave it out",
                name="method",
                value=self.method,
            )
        if not 0 <= self.weight_n < 1e5:
            raise ParameterError(f"weight_n={self.weight_n:g} outside 0..1e5 N", name="weight_n", value=self.weight_n)

    def weights_of(self, endcap: EndcapConfig) -> Path | None:
        """The file of weights that is named for an endcap, by itself or for all; None where none is."""
        return self.weights or self.own_weights.get(endcap.name)

    def _check_cameras(self) -> None:
        """Refuse one camera, or one endcap of the simulated robot, for two endcaps."""
        seen: dict[str, EndcapConfig] = {}
        for endcap in self.endcaps:
            camera = _camera_of(endcap.source)
            other = seen.setdefault(camera, endcap) if camera else endcap
            if other is not endcap:
                raise ParameterError(
                    f"source={endcap.source} of {endcap.name} is the camera of {other.name}: {one_each('camera')}",
                    name="source",
                    value=endcap.source,
                )


def _camera_of(source: str) -> str:
    """One word for a camera however it is named; empty for files and addresses, which several endcaps may share."""
    if is_camera_number(source):
        return f"/dev/video{int(source)}"
    if source.startswith("/dev/") and "\0" not in source:
        return os.path.realpath(source)
    kind, _, number = source.partition(":")
    return f"{kind}:{int(number)}" if kind == SCENE and is_camera_number(number) else ""


def one_each(what: str) -> str:
    """Why two endcaps may not share a camera, and what to do, for the end of a message.

    Args:
        what: each is to have of its own: ``camera`` or ``address``.
    """
    return (
        f"one camera sees one endcap, and a sum of forces would count it twice: give each its own {what}, or leave "
        "one out"
    )


def chosen_endcap(config: LiveConfig, name: str | None) -> EndcapConfig:
    """The endcap of that name; without a name the only one.

    Raises:
        ParameterError: no such endcap, or several and no name.
    """
    names = [endcap.name for endcap in config.endcaps]
    name = names[0] if name is None and len(names) == 1 else name
    if name not in names:
        raise ParameterError(f"--endcap {name or 'missing'}: choose one of {', '.join(names)}", name="endcap")
    return config.endcaps[names.index(name)]
