"""Scales a loading path for D=130 T=8 in Smooth-Sil 950 to another shell."""

from __future__ import annotations

from dataclasses import replace

from sensing.simulator.press.press import Target
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.similarity.ratios import LoadScale


def scaled(path: LoadPath, scale: LoadScale) -> LoadPath:
    """The path on another shell: forces, travel and depths in proportion; times, tilt and friction unchanged."""
    points = tuple(
        replace(
            point,
            target=None if point.target is None else _target(point.target, scale),
            begins=None if point.begins is None else _target(point.begins, scale),
            via=tuple(_target(target, scale) for target in point.via),
        )
        for point in path.waypoints
    )
    return replace(path, waypoints=points)


def _target(target: Target, scale: LoadScale) -> Target:
    def pair(values: tuple[float, float], factor: float) -> tuple[float, float]:
        return values[0] * factor, values[1] * factor

    return replace(
        target,
        normal_n=None if target.normal_n is None else target.normal_n * scale.force,
        depth_mm=None if target.depth_mm is None else target.depth_mm * scale.depth,
        shift_mm=pair(target.shift_mm, scale.shift),
        tangential_n=None if target.tangential_n is None else pair(target.tangential_n, scale.force),
    )
