"""Rigid bodies that press on the shell, as signed distances (mm, endcap frame).

A body touches the undeformed sphere at polar angle ``tilt`` on azimuth 0; other azimuths are rotations of the result.
Contact frame: ``outward`` is the sphere's normal there, ``meridian`` points along the mirror plane away from the tip
(+x at tilt 0), ``lateral`` is +y. ``translation = -depth outward + shift_1 meridian + shift_2 lateral``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from cad import plugins
from cad.errors import ParameterError
from sensing.simulator.contact.body import Body, BodyKind, body_at, plugin_kind
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry

KINDS = {kind.name.lower(): kind for kind in BodyKind}  # built-in bodies by name
MIRRORED_DEG = {"edge": 90.0, "rough": 45.0}  # the body is its own mirror image in y = 0 at multiples of this axis_deg
MAX_TILT_DEG = 100.0  # beyond it a plane would cut the base before it presses the dome
# Options of a body -> built-in bodies that have them; a plug-in's may use all.
USES = {"radius": ("sphere", "edge", "rough"), "axis": ("edge", "rough")}


def require_used(kind: str, **given: float | None) -> None:
    """Refuse an option of a body that this body does not have, because it would change nothing.

    Args:
        kind: name of the body.
        given: value of each option of :data:`USES`, by name; None where it was not given.

    Raises:
        ParameterError: a radius of a plane, or the axis of a body that has none.
    """
    for name, value in given.items():
        if value is not None and kind in KINDS and kind not in USES[name]:
            raise ParameterError(
                f"--{name} {value:g}: a {kind} has none, so it would change nothing; give --indenter "
                f"{' or '.join(USES[name])}, too, or leave it out",
                name=name,
                value=value,
            )


def known_kinds() -> tuple[str, ...]:
    """Names of the built-in bodies and of those that plug-ins add."""
    return (*KINDS, *(name for name in plugins.names(plugins.Kind.INDENTER) if name not in KINDS))


@dataclass(frozen=True)
class Indenter:
    """A body and where it touches.

    Attributes:
        tilt_deg: polar angle of first contact from the tip, 0..100.
        kind: ``plane``; ``sphere`` (a small one is a bump); ``edge``, a cylinder whose axis lies in the tangent plane;
            ``rough``, ground in waves both ways whose crests stand two radii apart; or a plug-in's.
        radius_mm: radius of sphere, edge or crest; ignored for the plane.
        axis_deg: direction of the edge's axis, or of the rows of crests, in the tangent plane, from the meridian.

    Raises:
        ParameterError: unknown kind, tilt outside its range, radius not positive, axis not finite.
    """

    tilt_deg: float = 0.0
    kind: str = "plane"
    radius_mm: float = 20.0
    axis_deg: float = 90.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS and self.kind not in known_kinds():
            raise ParameterError(
                f"kind={self.kind!r} is no indenter: choose one of {', '.join(known_kinds())}",
                name="kind",
                value=self.kind,
            )
        if not 0 <= self.tilt_deg <= MAX_TILT_DEG:
            advice = "beyond it the body meets the base first" if self.tilt_deg > MAX_TILT_DEG else "give a number"
            if self.tilt_deg < 0:
                advice = "turn the azimuth instead of a negative tilt"
            raise ParameterError(
                f"tilt_deg={self.tilt_deg:g} outside 0..{MAX_TILT_DEG:g}: {advice}",
                name="tilt_deg",
                value=self.tilt_deg,
            )
        if self.kind != "plane" and not (math.isfinite(self.radius_mm) and self.radius_mm > 0):
            raise ParameterError(
                f"radius_mm={self.radius_mm:g} is not positive: give the radius of the {self.kind}",
                name="radius_mm",
                value=self.radius_mm,
            )
        if not math.isfinite(self.axis_deg):
            raise ParameterError(
                f"axis_deg={self.axis_deg:g} is no angle: give its degrees from the meridian",
                name="axis_deg",
                value=self.axis_deg,
            )

    @property
    def keeps_mirror(self) -> bool:
        """Whether the body is its own mirror image in y = 0."""
        if self.kind in KINDS:
            return self.kind not in MIRRORED_DEG or self.axis_deg % MIRRORED_DEG[self.kind] == 0
        return bool(getattr(self._shape, "keeps_mirror", False))

    @property
    def _shape(self) -> Any:
        """The indenter that the plug-in made."""
        return _made(self.kind)

    def frame(self) -> Array:
        """Columns outward, meridian, lateral (3, 3)."""
        tilt = math.radians(self.tilt_deg)
        return np.array(
            [[math.sin(tilt), math.cos(tilt), 0.0], [0.0, 0.0, 1.0], [math.cos(tilt), -math.sin(tilt), 0.0]]
        )

    def body(self, geometry: ShellGeometry) -> Body:
        """The body at its first touch of a shell, for the contact kernels."""
        outward, meridian, lateral = self.frame().T
        touch = np.array(geometry.centre_mm) + geometry.outer_radius_mm * outward
        angle = math.radians(self.axis_deg)
        along = math.cos(angle) * meridian + math.sin(angle) * lateral
        if self.kind not in KINDS:
            kind = plugin_kind(self._shape.distance)
            return body_at(kind, self.radius_mm, touch + self.radius_mm * outward, along, along)
        axis = along if self.kind == "edge" else -outward
        point = touch if self.kind in ("plane", "rough") else touch + self.radius_mm * outward
        return body_at(KINDS[self.kind], self.radius_mm, point, axis, along)


@cache
def _made(name: str) -> Any:
    return plugins.make(plugins.Kind.INDENTER, name, "distance")


def translation(frame: Array, depth_mm: float, shift_mm: tuple[float, float]) -> Array:
    """Displacement of a body from its first touch (3,), mm: the equation in the module's text.

    Args:
        frame: contact frame, columns outward, meridian, lateral (3, 3).
        depth_mm: travel against the outward normal, mm.
        shift_mm: tangential travel along (meridian, lateral), mm.
    """
    return frame @ np.array([-depth_mm, *shift_mm])
