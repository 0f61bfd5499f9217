"""Can the steps be done? Every move is swept past everything in place, and what overlaps is an exact boolean volume.

A body is put at places along its way, close together where surfaces still touch, and intersected with each part in
place (manifold3d, exact on the triangles of the files). The worst volume of a step gates the export. Volumes in mm3.
Where distances from the axis prove that the two share nothing (:mod:`fab.steps.radial_spans`), no boolean is made.

Two bodies stand for more than they are: the interface is its flange and the whole envelope of its gyroid, and the
silicone is what the closed mold encloses, gyroid included. So the shape of the cast is that of the pieces themselves,
less the fin that stands in a joint between the halves of a bump: it is as thin as the joint, and gives way as flash.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache

import manifold3d
import numpy as np
import trimesh

from cad.interface import build_zone
from cad.mold_layout import MoldLayout
from fab.checks.cavity import cavity_body
from fab.checks.check import Check
from fab.checks.core_filler import bump_fillers
from fab.checks.extraction import Leg, seam_azimuth_deg, turned, turned_points
from fab.checks.meshes import OVERLAP_MM3
from fab.meshing.mesh import tessellate, to_manifold
from fab.steps.radial_spans import BodySpans
from fab.steps.record import Move, Step

FIRST = (0.004, 0.02, 0.06, 0.15, 0.3, 0.6, 1.0)  # places on the first leg, as fractions: surfaces still touch there
FLASH_MM = 0.03  # of the silicone in the joints that counts: the rest is flash, which gives way
LATER = (0.15, 0.4, 0.7, 1.0)

Bodies = Mapping[str, manifold3d.Manifold]


def sweep_checks(layout: MoldLayout, steps: Iterable[Step], bodies: Bodies) -> list[Check]:
    """One check for every step with moves: the largest volume in which a moving part meets one in place.

    Args:
        layout: mold sizes.
        steps: what is done.
        bodies: of all parts that the steps name (:func:`step_bodies`).
    """
    spans = cache(lambda name: BodySpans(bodies[name]))
    return [
        Check(
            f"step_{step.key}.overlap_mm3",
            max(move_overlap_mm3(move, bodies, layout, spans) for move in step.moves),
            high=OVERLAP_MM3,
        )
        for step in steps
        if step.moves
    ]


def step_bodies(
    layout: MoldLayout,
    steps: Iterable[Step],
    meshes: Mapping[str, trimesh.Trimesh],
    opened: manifold3d.Manifold | None = None,
) -> Bodies:
    """What is moved, and past what, by name of the part.

    Args:
        layout: mold sizes.
        steps: what is done.
        meshes: closed meshes of all parts that the steps name, endcap frame.
        opened: what :func:`fab.checks.cavity.opened_space` gave for the mold's pieces, where it is known.
    """
    names = {name for step in steps for move in step.moves for name in (*move.parts, *move.past)}
    bodies = {name: to_manifold(meshes[name]) for name in sorted(names - {"shell", "interface"})}
    if "interface" in names:
        zone = to_manifold(tessellate(build_zone(layout.params)))
        flange = to_manifold(meshes["interface"]).trim_by_plane((0.0, 0.0, -1.0), -layout.params.flange_thickness_mm)
        bodies["interface"] = flange + zone
    if "shell" in names:
        pieces = {name: mesh for name, mesh in meshes.items() if name.startswith(("cup_", "core_"))}
        bodies["shell"] = cavity_body(layout, pieces, FLASH_MM, opened) - bump_fillers(layout.params, FLASH_MM)
    return bodies


def move_overlap_mm3(
    move: Move,
    bodies: Bodies,
    layout: MoldLayout | None = None,
    spans: Callable[[str], BodySpans] | None = None,
) -> float:
    """Largest volume, over the places of the way, that the moving parts share with those in place.

    Args:
        move: what moves, and past what.
        bodies: by name of the part.
        layout: mold sizes; with them, pieces of the core are compared along their seams, which is quicker.
        spans: distances from the axis, by name of the part; with them, what they prove to be apart is not intersected.
    """
    way = np.array(places(move.way_out))
    shared = np.zeros(len(way))
    for name in move.parts:
        for other in move.past:
            near = np.array([spans is None or not spans(name).at(s).clear_of(spans(other).at(s * 0)) for s in way])
            if near.any():
                seam = 0.0 if layout is None else seam_azimuth_deg(layout, name, other)
                shifts = turned_points(way[near], seam)
                shared[near] += _shared_mm3(turned(bodies[name], seam), turned(bodies[other], seam), shifts)
    return float(shared.max())


def places(legs: Sequence[Leg]) -> list[np.ndarray]:
    """Displacements (3,) along a way, its start left out: what overlaps in place is gated by the assemblies' checks."""
    found, corner = [], np.zeros(3)
    for number, leg in enumerate(legs):
        step = leg.length_mm * np.array(leg.direction)
        found += [corner + fraction * step for fraction in (LATER if number else FIRST)]
        corner = corner + step
    return found


def _shared_mm3(body: manifold3d.Manifold, other: manifold3d.Manifold, shifts: np.ndarray) -> np.ndarray:
    """Volume (n,) that a body shares with another at each of its shifts (n, 3)."""
    box = np.array(body.bounding_box()).reshape(2, 3)
    there = other.bounding_box()
    return np.array(
        [
            (body.translate(shift.tolist()) ^ other).volume() if _meet((box + shift).ravel(), there) else 0.0
            for shift in shifts
        ]
    )


def _meet(a: Sequence[float] | np.ndarray, b: Sequence[float]) -> bool:
    return all(a[k] < b[k + 3] and b[k] < a[k + 3] for k in range(3))
