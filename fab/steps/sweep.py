"""Checks that the steps can be done: every move is swept past all parts in place, which must not overlap.

A body is placed at positions along its path, which are dense where surfaces still touch, and intersected with each part
in place (manifold3d, exact on the triangles of the files). The largest volume of a step must not exceed the limit of
the check. Volumes are in mm3. Where distances from the axis prove that two bodies are disjoint
(:mod:`fab.steps.radial_spans`), no boolean is made.

Two bodies are replaced by larger ones: the interface by its flange and the whole envelope of its gyroid, and the
silicone by the space that the closed mold encloses, gyroid included. The shape of the cast is therefore that of the
pieces themselves, without the fin in a joint between the halves of a bump, which is as thin as the joint and yields.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache

import manifold3d
import numpy as np
import trimesh

from cad.interface import build_zone
from cad.mold.layout import MoldLayout
from fab.checks.cavity import cavity_body
from fab.checks.check import Check
from fab.checks.core_filler import bump_fillers
from fab.checks.extraction import Leg, seam_azimuth_deg, turned, turned_points
from fab.checks.meshes import OVERLAP_MM3
from fab.meshing.mesh import tessellate, to_manifold
from fab.steps.radial_spans import BodySpans
from fab.steps.record import Move, Step

FIRST = (0.004, 0.02, 0.06, 0.15, 0.3, 0.6, 1.0)  # sampled fractions of the first leg: surfaces still touch there
FLASH_MM = 0.03  # depth of the silicone in the joints that counts; the rest is flash, which yields
LATER = (0.15, 0.4, 0.7, 1.0)  # sampled fractions of the other legs

Bodies = Mapping[str, manifold3d.Manifold]  # name of a part -> its body


def sweep_checks(layout: MoldLayout, steps: Iterable[Step], bodies: Bodies) -> list[Check]:
    """Checks of the largest volume that a moving part shares with one in place, one for every step with moves.

    Args:
        layout: mold sizes.
        steps: steps of the work.
        bodies: bodies of all parts that the steps name (:func:`step_bodies`).
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
    """Bodies of all parts that the steps move or pass: name -> body.

    Args:
        layout: mold sizes.
        steps: steps of the work.
        meshes: closed meshes of all parts that the steps name, by name, endcap frame, mm.
        opened: result of :func:`fab.checks.cavity.opened_space` for the mold's pieces, if available.
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
    """Largest volume over the positions of the path that the moving parts share with those in place, mm3.

    Args:
        move: the move.
        bodies: bodies by name of the part.
        layout: mold sizes; if given, pieces of the core are compared along their seams, which is faster.
        spans: radial spans by name of the part; if given, bodies that they prove to be disjoint are not intersected.
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
    """Displacements (3,) along a path without its start, mm; the assemblies' checks cover overlaps in place."""
    found, corner = [], np.zeros(3)
    for number, leg in enumerate(legs):
        step = leg.length_mm * np.array(leg.direction)
        found += [corner + fraction * step for fraction in (LATER if number else FIRST)]
        corner = corner + step
    return found


def _shared_mm3(body: manifold3d.Manifold, other: manifold3d.Manifold, shifts: np.ndarray) -> np.ndarray:
    """Volumes (n,) that a body shares with another one after each of its shifts (n, 3), mm3."""
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
