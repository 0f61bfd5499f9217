"""Loading paths: the frames of one approach of the plane, in order (N, mm, s, degrees)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sensing.simulator.press.press import Target

# Phases of a path, as the column ``phase`` names them.
PHASES = ("approach", "touch", "load", "circle", "unload", "clear", "drag", "impact", "stand", "airborne")
FRAME_S = 1 / 30  # P, CAM02: 30 frames a second


@dataclass(frozen=True)
class Waypoint:
    """One frame of a path.

    Attributes:
        phase: one of :data:`PHASES`.
        target: target at the end of the exposure; None while body and shell are apart.
        apart_mm: distance to first touch while they are apart, mm.
        time_s: end of the exposure, s, from the path's start.
        begins: target at the beginning of the exposure; None for a state at rest.
        via: targets between the last waypoint and this one, without a picture.
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
        number: identity of the path; training and test sets must never share it.
        tilt_deg, friction: tilt, degrees, and Coulomb coefficient of the plane.
        azimuths_deg: azimuths for which the solved states are labelled (rotations of one solution).
        waypoints: frames in order.
        exposure_s: exposure of the camera, s; 0 for states at rest.
        latency_s: time from mid-exposure to publication, s.
        scene, endcap: numbers of a robot's scene and endcap; -1 without a robot.
        T_world_sphere: rotation of that endcap and centre of its sphere, with heights from the lowest endcap's centre
            (4 x 4, row by row), mm; empty without a robot.
        began_s: time at which the untouched shell was last at rest, s, for rate effects; None where all states are at
            rest, and no time passes between them.
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
