"""Configuration of one endcap: its design, camera, reference and calibrations, a table of ``endcaps.toml``.

:mod:`sensing.live.core.config` shows such a file, with every key.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cad.errors import ParameterError
from cad.identity import RELEASED, RELEASED_SILICONE, WORDS, Identity, identity, label_of
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_RINGS, parse_rings
from sensing.camera.chosen_module import OTHER_MODULE
from sensing.frames import Array, rigid
from sensing.sources.choose import is_address
from sensing.wrench.relaxation import Term, rate_words

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
GAINS = (0.01, 100.0)  # no silicone is so much softer or harder than that of the training
SUBTRACTED, KEPT = OWN_WEIGHT = ("subtracted", "kept")
OF_BEFORE = {  # a file without these
    "silicone": str(RELEASED_SILICONE["name"]), "dots": RELEASED, "lens": RELEASED, "own_weight": KEPT,
}  # fmt: skip
RINGS = "-"  # joins the counts of dots of one's own, as in 1-6-10-12
CAMERA_ONLY = {"rate_hz": "frames a second", "exposure": "exposure"}  # settings that only a camera of this computer has


@dataclass(frozen=True)
class EndcapConfig:
    """One endcap.

    Attributes:
        name: of topics, files and lines.
        source: word for :func:`sensing.sources.choose.source_opener`, or ``scene:N``.
        zero: reference file; None to zero at the start.
        diameter_mm, wall_mm: the design.
        contact_on_n, contact_off_n: force at which contact begins and ends; 0 for the model's own (``contact_off_n``
            alone: its share of ``contact_on_n``).
        exposure: fixed exposure of a camera in the driver's unit; 0 leaves it automatic.
        rate_hz: frames a second asked of a camera (0: 30), or pictures a second of a folder (0: one, each for itself).
        camera: calibration (:mod:`sensing.calibrate`), by which the default model's weights suit any mounting; None
            for the nominal one or, where that does not fit, the one found from each reference.
        gain, gain_sd: of its silicone (:mod:`sensing.weigh`) and standard deviation; 1 and 0 where it was not weighed.
        gain_date, gain_weights: when, and with which weights of the model (digest); empty where it was not.
        relaxation: terms (strength, tau_s, sd) of :mod:`sensing.dwell`; empty where the silicone was not identified.
        T_robot_endcap: (4, 4) endcap to robot coordinates, mm.
        silicone: row of cad/materials.csv.
        dots: ``released``, or dots of each ring from tip to equator (:mod:`cad.pattern`); empty for the released ones.
        dot_mm: diameter of a dot.
        lens: for which it was set up (:func:`cad.identity.label_of`); empty for that of this toolkit.
        own_weight: whether dots' motion by the skin's own weight is taken out (:mod:`sensing.tracking.own_weight`).

    Raises:
        ParameterError: a value of the wrong form, dots that do not fit, or a lens that this toolkit does not have.
    """

    name: str
    source: str
    zero: Path | None = None
    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    contact_on_n: float = 0.0
    contact_off_n: float = 0.0
    exposure: float = 0.0
    rate_hz: float = 0.0
    camera: Path | None = None
    gain: float = 1.0
    gain_sd: float = 0.0
    gain_date: str = ""
    gain_weights: str = ""
    relaxation: tuple[tuple[float, ...], ...] = ()
    T_robot_endcap: Array = field(default_factory=lambda: np.eye(4))
    silicone: str = DEFAULT_SILICONE
    dots: str = ""
    lens: str = ""
    dot_mm: float = RELEASED_DOT_MM
    own_weight: str = SUBTRACTED

    def __post_init__(self) -> None:
        if not NAME.fullmatch(self.name):
            raise ParameterError(
                f"name={self.name!r}: give up to 32 letters, digits or underscores, a letter first: it names topics",
                name="name",
                value=self.name,
            )
        if not self.source:
            raise ParameterError(f"source of {self.name} is empty: give a camera number or address", name="source")
        if not 0 <= self.contact_off_n <= self.contact_on_n < 1e4:
            raise ParameterError(
                f"contact_off_n={self.contact_off_n:g}, contact_on_n={self.contact_on_n:g} of {self.name}: need "
                "0 <= contact_off_n <= contact_on_n",
                name="contact_on_n",
                value=self.contact_on_n,
            )
        for name, value, least, most in (
            ("exposure", self.exposure, 0, 1e6), ("rate_hz", self.rate_hz, 0, 1000),
            ("gain", self.gain, *GAINS), ("gain_sd", self.gain_sd, 0, self.gain),
        ):  # fmt: skip
            if not least <= value <= most:
                raise ParameterError(
                    f"{name}={value:g} of {self.name} outside {least:g}..{most:g}", name=name, value=value
                )
        if is_address(self.source):
            for name, what in CAMERA_ONLY.items():
                if getattr(self, name):
                    raise ParameterError(
                        f"{name} of {self.name} has no effect: {self.source} sets its own {what}: set it there",
                        name=name,
                        value=getattr(self, name),
                    )
        object.__setattr__(self, "T_robot_endcap", rigid(self.T_robot_endcap, f"T_robot_endcap of {self.name}"))
        object.__setattr__(self, "relaxation", tuple(tuple(map(float, term)) for term in self.relaxation))
        _ = self.relaxation_terms
        self._check_identity()
        if self.own_weight not in OWN_WEIGHT:
            choice = f"own_weight={self.own_weight!r} of {self.name}: choose among {', '.join(OWN_WEIGHT)}"
            raise ParameterError(choice, name="own_weight", value=self.own_weight)

    def _check_identity(self) -> None:
        """Fill dot pattern and lens in, or refuse those of another toolkit."""
        made_of = self.identity
        for name, aspect in (("dots", "dots"), ("lens", "camera")):
            here, stated = label_of(made_of, aspect), getattr(self, name)
            if name == "dots" and RINGS in stated:
                continue  # dots of its own
            if stated not in ("", here):
                raise ParameterError(
                    f"{name}={stated!r} of {self.name}: it was set up for that {WORDS[aspect]}, this toolkit has "
                    f"{here!r}: {OTHER_MODULE if name == 'lens' else ''}set it up again with endcap setup",
                    name=name,
                    value=stated,
                )
            object.__setattr__(self, name, here)

    @property
    def identity(self) -> Identity:
        """Design, dot pattern, camera and silicone."""
        return identity(self.params, self.silicone)

    @property
    def params(self) -> EndcapParams:
        """The design."""
        rings = parse_rings(self.dots) if RINGS in self.dots else RELEASED_RINGS
        return EndcapParams(self.diameter_mm, self.wall_mm, rings, self.dot_mm)

    @property
    def relaxation_terms(self) -> tuple[Term, ...]:
        """Of the rate effects of its silicone."""
        return tuple(Term(*term) for term in self.relaxation)

    @property
    def rate_effects(self) -> str:
        """Which of them are corrected, in words; empty where none are."""
        return rate_words(self.relaxation_terms)

    @property
    def weighed(self) -> str:
        """Result of the calibration by weight, in words; empty without one."""
        if self.gain == 1.0 and self.gain_sd == 0.0:
            return ""
        date = self.gain_date and f" on {self.gain_date[:10]}"
        return f"calibrated by weight{date}: gain {self.gain:.3f} ± {self.gain_sd:.3f}"


def dots_of(params: EndcapParams) -> dict[str, Any]:
    """Entries of an endcap that describe the dots of its design."""
    return {"dots": params.option_words.get("dots", ""), "dot_mm": params.dot_mm}
