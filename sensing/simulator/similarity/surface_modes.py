"""The library's modes at any direction of any shell, without a mesh of it: one reference mesh serves all (units of R).

Points of different shells correspond by their position in the mesh's disc (:func:`disc_points`); a direction of one is
mapped to that of the reference shell at the same position, where the modes are interpolated.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from cad.materials import silicone
from sensing.simulator.levels import Simulator
from sensing.simulator.similarity.library import Library
from sensing.simulator.similarity.ratios import common_order, disc_points
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry, shell_geometry
from sensing.simulator.solid.mesh import Index
from sensing.simulator.solid.surface import InnerSurface, turn_about_axis

REFERENCE = (130.0, 8.0)  # D and T of the reference shell, mm


def modes_at(library: Library, geometry: ShellGeometry, directions: Array, azimuth_deg: float = 0.0) -> Array:
    """(M, d, 3) modes at directions (d, 3) from the sphere's centre, for a contact at an azimuth.

    Args:
        library: library of the modes.
        geometry: the shell.
        directions: (d, 3) unit vectors.
        azimuth_deg: azimuth of the contact, degrees.

    Raises:
        ParameterError: a direction that meets the clamp before the inner surface.
    """
    surface, place = _reference()
    turn = turn_about_axis(azimuth_deg)
    sampler = surface.sampler(_on_reference(geometry, np.asarray(directions) @ turn))
    fields = library.modes.astype(float)[:, place]  # (M, n, 3) in the surface's own numbering
    return np.einsum("ka,mkai->mki", sampler.weights, fields[:, sampler.nodes], optimize=True) @ turn.T


@lru_cache(maxsize=1)
def _reference() -> tuple[InnerSurface, Index]:
    geometry = shell_geometry(*REFERENCE)
    surface = Simulator(geometry, silicone().neo_hooke()).surface
    order = common_order(geometry, surface.position)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return surface, place


def _on_reference(geometry: ShellGeometry, directions: Array) -> Array:
    """Directions (d, 3) of the reference shell at the same positions in the disc."""
    centre = np.array(geometry.centre_mm)
    place = disc_points(geometry, centre + geometry.inner_radius_mm * directions)
    share, azimuth = np.hypot(place[:, 0], place[:, 1]), np.arctan2(place[:, 1], place[:, 0])
    reference = shell_geometry(*REFERENCE)
    middle = reference.clamp_polar_rad(reference.mid_radius_mm)
    polar = share * middle + (reference.clamp_polar_rad(reference.inner_radius_mm) - middle) * share**4
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=1)
