"""Checks of the coupons on their solids and on the meshes read from their files. Millimetres."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import trimesh

from cad.bought import bought_mm
from cad.coupons import CLEARANCES_MM, NUT_WIDTHS_MM, TENSILE_BLOCK_MM, WIDTH_MM, socket_x_mm, zones_mm
from cad.interface import POCKET_FLOOR_MM, POCKET_HEIGHT_MM
from cad.part import Part
from cad.pattern import RELEASED_GYROID
from fab.checks.check import Check
from fab.checks.fit import CLEARANCE_MM, bed_check
from fab.checks.meshes import mesh_checks
from fab.checks.walls import min_wall_check
from fab.meshing.mesh import to_manifold

DENSITY_RATIO = 3e-3  # as the interface's
OPEN_SHARE = 0.35  # TPU on an open side of the gyroid; the sheet cut straight covers 10 %


def coupon_checks(parts: Mapping[str, Part], meshes: Mapping[str, trimesh.Trimesh]) -> list[Check]:
    """Check mesh, bed and wall of each part, density and open sides of the gyroids, and width of the nut pockets.

    Args:
        parts: by name.
        meshes: by name, as read from their files, mm.
    """
    checks = pocket_checks(meshes["fit_nuts"]) if "fit_nuts" in meshes else []
    zones = zones_mm()
    for name, part in parts.items():
        checks += mesh_checks(name, meshes[name], None if name in zones else float(part.solid.volume))
        checks.append(bed_check(name, meshes[name]))
        if part.material == "PLA":
            checks.append(min_wall_check(name, meshes[name]))
    for name, (low, high) in zones.items():
        extra = meshes[name].volume - parts[name].solid.volume
        density = extra / float(np.prod(np.array(high) - np.array(low)))
        checks.append(Check(f"{name}.density_error_ratio", abs(density / RELEASED_GYROID - 1), high=DENSITY_RATIO))
        checks.append(Check(f"{name}.closed_side_share", closed_share(meshes[name], low, high), high=OPEN_SHARE))
    return checks


def pocket_checks(mesh: trimesh.Trimesh) -> list[Check]:
    """Compare the play of the nut in each pocket of the bar, from wall to wall of the mesh, with the nominal play.

    Args:
        mesh: of ``fit_nuts``, as read from its file, mm.
    """
    body, nut = to_manifold(mesh), bought_mm("nut_m3", "across_flats")
    pitch, middle = float(mesh.extents[0]) / len(NUT_WIDTHS_MM), POCKET_FLOOR_MM + POCKET_HEIGHT_MM / 2
    checks = []
    for k, width in enumerate(NUT_WIDTHS_MM):
        seat = np.array([pitch * (k + 0.5), -nut / 2, middle])
        hits = [body.ray_cast(seat.tolist(), (seat + way).tolist()) for way in ((-pitch, 0, 0), (pitch, 0, 0))]
        play = sum(abs(float(found[0].position[0]) - seat[0]) if found else np.inf for found in hits) - nut
        wanted = width - nut
        checks.append(Check(f"fit_nuts.pocket_{k + 1}_play_mm", play, wanted - CLEARANCE_MM, wanted + CLEARANCE_MM))
    return checks


def closed_share(mesh: trimesh.Trimesh, low: tuple[float, float, float], high: tuple[float, float, float]) -> float:
    """Largest share of an open side of a zone (all but its foot) that TPU covers, from the faces that lie in it.

    Args:
        mesh: of the coupon, mm.
        low: corner (x, y, z) of the zone with the least coordinates, mm.
        high: opposite corner, mm.
    """
    worst = 0.0
    sizes = np.array(high) - np.array(low)
    for axis in range(3):
        for end, place in ((-1, low[axis]), (1, high[axis])):
            if axis == 2 and end < 0:
                continue
            inside = mesh.triangles_center[:, 2] > low[2] + 1e-3
            flat = (np.abs(mesh.triangles[:, :, axis] - place) < 1e-3).all(axis=1) & inside
            worst = max(worst, float(mesh.area_faces[flat].sum() / (sizes.prod() / sizes[axis])))
    return worst


def solid_checks(parts: Mapping[str, Part]) -> list[Check]:
    """Check the clearance of the tab in each socket between the solids, and the sizes of the specimen.

    Args:
        parts: by name.
    """
    from build123d import Pos

    plate, tab = parts["fit_plate"].solid, parts["fit_tab"].solid
    checks = []
    for k, gap in enumerate(CLEARANCES_MM):
        least = plate.distance_to(Pos(socket_x_mm(k), 0, 0) * tab)
        checks.append(Check(f"fit_plate.socket_{k + 1}_gap_mm", least, gap - CLEARANCE_MM, gap + CLEARANCE_MM))
    box = parts["tensile_plain_tpu"].solid.bounding_box().size
    checks.append(Check("tensile_plain_tpu.length_mm", max(box.X, box.Y, box.Z), TENSILE_BLOCK_MM, TENSILE_BLOCK_MM))
    checks.append(Check("tensile_plain_tpu.width_mm", min(box.X, box.Y, box.Z), WIDTH_MM, WIDTH_MM))
    return checks
