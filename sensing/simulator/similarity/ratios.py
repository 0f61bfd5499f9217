"""Similarity of shells: the dimensionless numbers that scaled copies share, and the units for scaling.

A quasi-static shell of one hyperelastic law has no other scale of length and stress than the outer radius R and the
shear modulus mu. Two shells with equal wall / R, clamp / R, Poisson's ratio, tilt and friction are similar: they have
displacements in R, forces in mu R^2, torques in mu R^3 (dimensional analysis; Buckingham 1914,
doi:10.1103/PhysRev.4.345).

Some lengths of the endcap do not scale: flange (6 mm), interlock (25 mm of TPU in silicone, plain silicone in this
simulator), LED ring (its radius fixes the rim below D = 120.7), camera height, dots' radius. The first and the third
affect the shell only through the height of the clamp, which ``clamp`` holds; camera and dots affect the projection.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import Index

REFERENCE_WALL_MM = 8.0  # wall T of the released design
REFERENCE_RADIUS_MM = 65.0  # outer radius R of the released design
REFERENCE_SHEAR_MPA = 0.68  # shear modulus of Smooth-Sil 950 (E, MAT10), for which the released loads are given
RELEASED_LOAD_N = 35.0  # P, NET22: largest set-point of the released data, at D=130


@dataclass(frozen=True)
class ShellRatios:
    """Shape of a shell in units of its outer radius.

    Attributes:
        wall: T / R.
        clamp: height of the sphere's centre above the clamp plane over R; it determines the depth of the neck.
    """

    wall: float
    clamp: float

    @staticmethod
    def of(geometry: ShellGeometry) -> ShellRatios:
        """Ratios of a shell."""
        radius = geometry.outer_radius_mm
        return ShellRatios(geometry.wall_mm / radius, (geometry.centre_height_mm - geometry.clamp_height_mm) / radius)

    def shell(self, radius_mm: float = REFERENCE_RADIUS_MM, view_rim_polar_deg: float = 80.0) -> ShellGeometry:
        """A shell of these ratios, clamped at height 0.

        Args:
            radius_mm: outer radius, mm.
            view_rim_polar_deg: polar angle at which its dots end, degrees.
        """
        return ShellGeometry(radius_mm, self.wall * radius_mm, self.clamp * radius_mm, 0.0, view_rim_polar_deg)


@dataclass(frozen=True)
class LoadScale:
    """Loads of one shell in proportion to those of D=130, T=8 in Smooth-Sil 950.

    A shell under a point load sinks by about F R / (mu T^2) (Reissner 1946), so equal forces in units of mu T^2 press
    all shells to about the same depth / R; tangential stiffness scales with mu T, so equal travel in units of T gives
    about the same part of the friction cone.

    Attributes:
        force: factor on forces.
        shift: factor on tangential travel.
        depth: factor on depths.
    """

    force: float
    shift: float
    depth: float

    @staticmethod
    def of(geometry: ShellGeometry, shear_mpa: float) -> LoadScale:
        """Scale of a shell.

        Args:
            geometry: the shell.
            shear_mpa: shear modulus mu of its silicone, MPa.
        """
        wall = geometry.wall_mm / REFERENCE_WALL_MM
        return LoadScale(
            shear_mpa / REFERENCE_SHEAR_MPA * wall**2, wall, geometry.outer_radius_mm / REFERENCE_RADIUS_MM
        )

    @property
    def top_n(self) -> float:
        """Normal force of this shell, N, that corresponds to the released 35 N: the range of its weights."""
        return RELEASED_LOAD_N * self.force


def wrench_units(radius_mm: float, shear_mpa: float) -> Array:
    """Units (6,) of a wrench: mu R^2 for forces (N), mu R^3 for torques (N mm).

    Args:
        radius_mm: outer radius R, mm.
        shear_mpa: shear modulus mu, MPa.
    """
    force = shear_mpa * radius_mm**2
    return np.repeat([force, force * radius_mm], 3)


def about(wrench: Array, point_mm: Array) -> Array:
    """Wrench (..., 6) about a point (3,), from that at the origin: the torque loses point x force (N, N mm)."""
    force = wrench[..., :3]
    return np.concatenate([force, wrench[..., 3:] - np.cross(np.asarray(point_mm, dtype=float), force)], axis=-1)


def disc_points(geometry: ShellGeometry, position: Array) -> Array:
    """(k, 2) positions of inner surface points in the mesh's disc, which are common to all shells."""
    offset = position - np.array(geometry.centre_mm)
    polar = np.arccos(np.clip(offset[:, 2] / np.linalg.norm(offset, axis=1), -1, 1))
    middle = geometry.clamp_polar_rad(geometry.mid_radius_mm)
    share = np.linspace(0, 1, 2001)
    ends = geometry.clamp_polar_rad(geometry.inner_radius_mm) - middle
    place = np.interp(polar, share * middle + ends * share**4, share)
    azimuth = np.arctan2(offset[:, 1], offset[:, 0])
    return np.stack([place * np.cos(azimuth), place * np.sin(azimuth)], axis=1)


def common_order(geometry: ShellGeometry, position: Array) -> Index:
    """(k,) numbers that sort inner surface points (k, 3) of any shell into the common order of the disc."""
    keys = np.round(disc_points(geometry, position) * 1e4).astype(np.int64)
    return np.lexsort((keys[:, 1], keys[:, 0]))
