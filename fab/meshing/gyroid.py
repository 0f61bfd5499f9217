"""The gyroid in the silicone: a sheet of uniform wall on the flange, by default 10 % of the zone's volume (mm).

The signed distance to the gyroid surface is sampled on a grid that fits the zone (:mod:`.zone_grid`), so that no node
is wasted and no boolean is needed to cut the sheet to the zone. Marching cubes of +t/2 and of -t/2 (t wall thickness)
and end faces on the zone's sides form the closed sheet (:mod:`fab.meshing.gyroid_sheet`). After the period has been
found, manifold3d joins the sheet to the flange once.

Notes:
    Surface: g = sin x cos y + sin y cos z + sin z cos x = 0 with x = 2 pi X / L (A. H. Schoen, NASA TN D-5541, 1970).
    One Newton step along the gradient gives the distance to first order, g / |grad g|; a second step from the foot
    point of the first removes one per cent of bias of the wall; the remaining spread is due to the grid
    (bench/gyroid.csv). A sheet of wall t has the volume fraction 3.09 t / L, with 3.0915 the gyroid's area in a cube
    of side L over L^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from cad.errors import GeometryError
from cad.interface import build_flange, zone_volume_mm3
from cad.params import EndcapParams
from cad.pattern import RELEASED_GYROID
from fab.meshing.cast_space import COVERED_SHARE, ball_reach, cast_space
from fab.meshing.gyroid_sheet import sheet_mesh
from fab.meshing.mesh import from_manifold, tessellate, to_manifold, volume_mm3
from fab.meshing.repair import without_crossings
from fab.meshing.zone_grid import SKIRT_MM, ZoneGrid, zone_grid

WALL_MM = 0.45  # E: one line of a 0.4 mm nozzle
DENSITY_TOLERANCE = 5e-4  # relative: 10.00 % as printed in reports; the export's limit is 3e-3
STEP_MM = 0.6  # grid step at the knee of bench/gyroid.csv
AREA_PER_PERIOD = 3.0915  # area of the gyroid in a cube of its period, over the period squared
PHASE_MM = (0.137, 0.291, 0.413)  # offset of the gyroid: keeps its symmetry planes off the axis, and nodes off zero
PHASE_SHIFTS_MM = (0.0, 1.9, 3.8, 5.7)  # along the axis, off the gyroid's own half and quarter periods
THINNER, THICKER = 1.5e-3, 0.8e-3  # relative changes allowed to the wall: facets add 7 to 8e-3, and the limit is 1e-2
ROOMY_WALL_MM = 7.0  # thicker walls: the ball reaches at least 0.84 of the voids (24 sizes, docs/sizes.md)
SPARE_SHARE = 0.005  # margin of the covered share, as the check measures the file with the flange again
MAX_TRIALS = 6  # meshes at each phase
Phase = tuple[float, float, float]  # offset x, y, z of the gyroid in mm
_CLEAR_MM = 0.01  # least distance of the sheet's corners from the flange's plane: no slivers where the two join


@dataclass(frozen=True)
class InterfaceMesh:
    """Mesh of the printed interface and its sizes.

    Attributes:
        mesh: closed mesh of flange and gyroid, coordinates rounded to float32 as in an STL, mm.
        period_mm: period of the gyroid, mm.
        wall_mm: thickness of its sheet, mm.
        density: TPU in the zone over the zone's volume, after removal of islands.
        dropped_fraction: TPU in unconnected islands at the zone's edge over the TPU of the sheet.
        zone_volume_mm3: volume of the zone, mm3.
    """

    mesh: trimesh.Trimesh
    period_mm: float
    wall_mm: float
    density: float
    dropped_fraction: float
    zone_volume_mm3: float


def interface_mesh(
    params: EndcapParams, step_mm: float = STEP_MM, flange: trimesh.Trimesh | None = None
) -> InterfaceMesh:
    """Mesh of the whole TPU interface, with the period tuned to the design's volume fraction of TPU.

    Args:
        params: design of the endcap.
        step_mm: grid step at 10 % TPU, mm.
        flange: mesh of :func:`cad.interface.build_flange`, if that is made already.

    Raises:
        GeometryError: no tried period gives the density, or the mesh is not closed.
    """
    step_mm *= min(1.0, RELEASED_GYROID / params.gyroid)  # the wall's spread grows with step over period
    return with_flange(gyroid_sheet(params, step_mm), tessellate(build_flange(params)) if flange is None else flange)


def gyroid_sheet(params: EndcapParams, step_mm: float = STEP_MM) -> InterfaceMesh:
    """Mesh of the sheet alone, with tuned period, without the CAD kernel; it overlaps the flange to fuse with it.

    Below ``ROOMY_WALL_MM`` the phase is one at which a ball reaches the voids, if one exists.
    """
    grid = zone_grid(params, step_mm)
    nodes = grid.points()
    zone_mm3 = zone_volume_mm3(params)

    def trial(period_mm: float, wall_mm: float, phase_mm: Phase) -> InterfaceMesh:
        sheet, dropped_mm3 = standing_sheet(
            grid, nodes, period_mm, params.flange_thickness_mm, wall_mm, phase_mm=phase_mm
        )
        tpu = volume_above(sheet, params.flange_thickness_mm)
        return InterfaceMesh(sheet, period_mm, wall_mm, tpu / zone_mm3, dropped_mm3 / (tpu + dropped_mm3), zone_mm3)

    def covered(sheet: InterfaceMesh) -> float:
        return ball_reach(params, cast_space(params, sheet.mesh))[0] if params.wall_mm < ROOMY_WALL_MM else 1.0

    return roomy(tuned(trial, params.gyroid), covered)


def roomy(sheets: Iterable[InterfaceMesh], covered: Callable[[InterfaceMesh], float]) -> InterfaceMesh:
    """The first sheet whose voids a ball reaches with a margin, else the one with the largest covered share.

    In a thin wall a row of the gyroid's passages can be as narrow as the ball; the same gyroid shifted along the axis
    has wider passages there.

    Args:
        sheets: sheets of one density at different phases.
        covered: function that gives the share of a sheet's voids that the ball reaches.
    """
    best, most = None, -1.0
    for sheet in sheets:
        share = covered(sheet)
        if share >= COVERED_SHARE + SPARE_SHARE:
            return sheet
        if share > most:
            best, most = sheet, share
    assert best is not None  # ``tuned`` raises if there is no sheet
    return best


def with_flange(sheet: InterfaceMesh, flange: trimesh.Trimesh) -> InterfaceMesh:
    """Mesh of the sheet fused with the flange."""
    joined = from_manifold(to_manifold(sheet.mesh) + to_manifold(flange))
    return replace(sheet, mesh=without_crossings(joined, joint_band_mm(float(flange.bounds[1][2]))))


def joint_band_mm(floor_mm: float) -> tuple[float, float]:
    """Range of heights about the flange's top in which booleans cut the sheet, mm; other faces are the grid's."""
    return floor_mm - 2 * SKIRT_MM, floor_mm + 2 * SKIRT_MM


def standing_sheet(
    grid: ZoneGrid,
    nodes: np.ndarray,
    period_mm: float,
    floor_mm: float,
    wall_mm: float = WALL_MM,
    newton_steps: int = 2,
    phase_mm: Phase = PHASE_MM,
) -> tuple[trimesh.Trimesh, float]:
    """Mesh of the sheet without the bodies that are not connected to the flange.

    Args:
        grid: grid of the zone.
        nodes: its points, mm.
        period_mm: period of the gyroid, mm.
        floor_mm: height of the flange's top, mm; bodies of the sheet that reach below it stand on the flange.
        wall_mm: thickness of the sheet, mm.
        newton_steps: Newton steps of :func:`gyroid_distance_mm`.
        phase_mm: position of a node of the gyroid, mm.

    Returns:
        ``(mesh, volume of the removed bodies in mm3)``.
    """
    distance = gyroid_distance_mm(nodes, period_mm, 3 * grid.step_mm, newton_steps, phase_mm)
    sheet = sheet_mesh(grid, distance, wall_mm / 2)
    heights = sheet.vertices[:, 2]
    close = np.abs(heights - floor_mm) < _CLEAR_MM
    heights[close] = floor_mm + np.where(heights[close] < floor_mm, -_CLEAR_MM, _CLEAR_MM)
    sheet = trimesh.Trimesh(
        np.column_stack([sheet.vertices[:, :2], heights]), sheet.faces, process=False, validate=False
    )
    return drop_islands(sheet, floor_mm)


def drop_islands(mesh: trimesh.Trimesh, floor_mm: float) -> tuple[trimesh.Trimesh, float]:
    """Mesh of the connected bodies that reach below a height, and the volume of the others, mm3."""
    edges = mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = coo_matrix((np.ones(len(edges), dtype=np.int8), edges.T), shape=(len(mesh.vertices),) * 2)
    count, body = connected_components(links, directed=False)
    stands = np.zeros(count, dtype=bool)
    stands[body[mesh.vertices[:, 2] < floor_mm]] = True
    if stands.all():
        return mesh, 0.0
    used, corners = np.unique(mesh.faces[stands[body[mesh.faces[:, 0]]]], return_inverse=True)
    kept = trimesh.Trimesh(mesh.vertices[used], corners.reshape(-1, 3), process=False, validate=False)
    return kept, volume_mm3(mesh) - volume_mm3(kept)


def tuned(
    trial: Callable[[float, float, Phase], InterfaceMesh], wanted: float = RELEASED_GYROID
) -> Iterator[InterfaceMesh]:
    """Yield for each phase a sheet of the wanted density, tuned by the period and finally by the wall.

    The density is proportional to wall over period. It jumps where a change of period disconnects or connects an
    island, so that possibly no period gives the target; the last tenths of a per cent are therefore tuned by the wall
    (a few micrometres), which does not affect islands. A phase at which a jump coincides with the target is skipped:
    the gyroid shifted along the axis has other islands.

    Args:
        trial: function that makes a sheet from period, mm, wall, mm, and phase, mm.
        wanted: volume fraction of TPU.

    Raises:
        GeometryError: at no phase the density is within its tolerance after ``MAX_TRIALS`` meshes.
    """
    found = False
    for shift in PHASE_SHIFTS_MM:
        phase = (PHASE_MM[0], PHASE_MM[1], PHASE_MM[2] + shift)
        period_mm, wall_mm = AREA_PER_PERIOD * WALL_MM / wanted, WALL_MM
        for _ in range(MAX_TRIALS):
            result = trial(period_mm, wall_mm, phase)
            ratio = result.density / wanted
            if abs(ratio - 1) <= DENSITY_TOLERANCE:
                found = True
                yield result
                break
            if -THICKER <= ratio * WALL_MM / wall_mm - 1 <= THINNER:
                wall_mm /= ratio
            else:
                period_mm, wall_mm = period_mm * ratio, WALL_MM
    if not found:
        raise GeometryError(
            f"gyroid density {result.density:.5f} outside {wanted} +- {DENSITY_TOLERANCE:.2%} after {MAX_TRIALS} "
            f"trials at each of {len(PHASE_SHIFTS_MM)} phases: use a finer step_mm"
        )


def gyroid_distance_mm(
    points: np.ndarray, period_mm: float, band_mm: float, newton_steps: int = 2, phase_mm: Phase = PHASE_MM
) -> np.ndarray:
    """Signed distance to the gyroid surface, clipped to ``-band_mm..band_mm``.

    Args:
        points: (..., 3) points, mm.
        period_mm: period of the gyroid, mm.
        band_mm: distance up to which the result is accurate, mm; beyond it only the sign is.
        newton_steps: 1 for g / |grad g|; each further step starts from the foot point of the last one, inside the band.
        phase_mm: position of a node of the gyroid, mm.

    Returns:
        (...) distances in mm.
    """
    wave = np.float32(2 * math.pi / period_mm)
    start = (points.reshape(-1, 3) - np.asarray(phase_mm, dtype=points.dtype)) * wave
    value, gradient = _gyroid(start)
    shift = gradient * (value / np.maximum((gradient**2).sum(-1), 0.05))[:, None]
    distance = np.sign(value) * np.sqrt((shift**2).sum(-1)) / wave
    near = np.flatnonzero(np.abs(distance) < 1.2 * band_mm) if newton_steps > 1 else np.arange(0)
    foot = start[near] - shift[near]
    for _ in range(newton_steps - 1):
        value_foot, gradient = _gyroid(foot)
        foot -= gradient * (value_foot / np.maximum((gradient**2).sum(-1), 0.05))[:, None]
    distance[near] = np.sign(value[near]) * np.sqrt(((foot - start[near]) ** 2).sum(-1)) / wave
    return np.clip(distance, -band_mm, band_mm).reshape(points.shape[:-1])


def _gyroid(phase: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Field g (n,) and its gradient (n, 3) at phases (n, 3) in radians."""
    sines, cosines = np.sin(phase), np.cos(phase)
    value = (sines * np.roll(cosines, -1, axis=-1)).sum(-1)  # sin x cos y + sin y cos z + sin z cos x
    gradient = cosines * np.roll(cosines, -1, axis=-1) - sines * np.roll(sines, 1, axis=-1)
    return value, gradient


def volume_above(mesh: trimesh.Trimesh, height_mm: float) -> float:
    """Volume of a closed mesh above a plane, mm3: the flux of (z - height) e_z through its faces above the plane."""
    triangles = mesh.triangles - (0, 0, height_mm)
    top = triangles[..., 2].max(axis=1)
    bottom = triangles[..., 2].min(axis=1)
    volume = _flux(triangles[bottom >= 0])
    return volume + sum(_flux(part) for part in _clipped(triangles[(bottom < 0) & (top > 0)]))


def _flux(triangles: np.ndarray) -> float:
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area_xy = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    return float((area_xy * triangles[..., 2].mean(axis=1)).sum())


def _clipped(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Parts above z = 0 of triangles that cross it: a tip, or a quadrangle as two triangles."""
    above = triangles[..., 2] > 0
    single = above.sum(axis=1) == 1
    apex = np.where(single, above.argmax(axis=1), (~above).argmax(axis=1))  # the corner alone on its side
    order = (apex[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, order[..., None], axis=1), 1, 0)
    ab = a + (b - a) * (a[:, 2] / (a[:, 2] - b[:, 2]))[:, None]
    ac = a + (c - a) * (a[:, 2] / (a[:, 2] - c[:, 2]))[:, None]
    tips = np.stack([a, ab, ac], axis=1)[single]
    pair = ~single
    return tips, np.stack([ab, b, c], axis=1)[pair], np.stack([ab, c, ac], axis=1)[pair]
