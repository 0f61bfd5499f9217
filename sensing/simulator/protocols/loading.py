"""Loading paths: the frames of one approach of the plane, in order (N, mm, s, degrees)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sensing.simulator.press.press import Target

PHASES = ("approach", "touch", "load", "circle", "unload", "clear", "drag", "impact", "stand", "airborne")
FRAME_S = 1 / 30  # P, CAM02: 30 frames a second


@dataclass(frozen=True)
class Waypoint:
    """One frame of a path.

    Attributes:
        phase: one of :data:`PHASES`.
        target: where body and shell are when the exposure ends; None while they are apart.
        apart_mm: distance to first touch while apart.
        time_s: end of the exposure, from the path's start.
        begins: target when the exposure began; None for a state at rest.
        via: targets passed since the last waypoint, without a picture.
    """

    phase: str
    target: Target | None
    apart_mm: float = 0.0
    time_s: float = 0.0
    begins: Target | None = None
    via: tuple[Target, ...] = ()


@dataclass(frozen=True)
class LoadPath:
    """One loading path from the untouched shell, reproducible from ``(seed, number)``.

    Attributes:
        number: identity; training and test sets must never share it.
        tilt_deg, friction: of the plane.
        azimuths_deg: azimuths for which the solved states are labelled (rotations of one solution).
        waypoints: frames in order.
        exposure_s: of the camera; 0 for states at rest.
        latency_s: from mid-exposure to publication.
        scene, endcap: of a robot, -1 without.
        T_world_sphere: that endcap's rotation and its sphere's centre, heights from the lowest endcap's centre (4 x 4,
            row by row); empty without a robot.
        began_s: when the untouched shell was last at rest, for rate effects; None where states are at rest, and no time
            passes between them.
    """

    number: int
    tilt_deg: float
    friction: float
    azimuths_deg: tuple[float, ...]
    waypoints: tuple[Waypoint, ...]
    exposure_s: float = 0.0
    latency_s: float = 0.0
    scene: int = -1
    endcap: int = -1
    T_world_sphere: tuple[float, ...] = ()
    began_s: float | None = None

    @property
    def frames(self) -> int:
        """Number of labelled frames."""
        return len(self.waypoints) * len(self.azimuths_deg)


def timed(points: list[Waypoint]) -> tuple[Waypoint, ...]:
    """Waypoints at rest, one frame after the other."""
    return tuple(replace(point, time_s=FRAME_S * (count + 1)) for count, point in enumerate(points))
