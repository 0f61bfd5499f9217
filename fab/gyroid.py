"""The gyroid in the silicone: a sheet of uniform wall at 10 % of the zone's volume, on the flange (endcap frame, mm).

How it is made: the signed distance to the gyroid surface is sampled on a grid that follows the zone (azimuth, height,
share of the radial width), so hardly a node is wasted; marching cubes of +t/2 and of -t/2 give two closed surfaces,
one inside the other, whose difference is the sheet; manifold3d cuts it to the zone and joins it to the flange.

Notes:
    Surface: g = sin x cos y + sin y cos z + sin z cos x = 0 with x = 2 pi X / L (A. H. Schoen, NASA TN D-5541, 1970).
    One Newton step along the gradient gives the distance to first order, g / |grad g|; a second step from the foot of
    the first makes the wall uniform (bench/gyroid.csv has both).
    A sheet of wall t fills 3.09 t / L: 3.0915 is the gyroid's area per period squared.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import manifold3d
import numpy as np
import trimesh
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from skimage.measure import marching_cubes

from cad.errors import GeometryError
from cad.interface import build_flange, zone_clip_radius_mm, zone_radii_mm, zone_volume_mm3
from cad.params import EndcapParams
from fab.mesh import from_manifold, tessellate, to_manifold

WALL_MM = 0.45  # E: one line of a 0.4 mm nozzle
DENSITY = 0.10  # the paper's interlock
DENSITY_TOLERANCE = 1e-3  # relative; the export's gate is 3e-3
STEP_MM = 0.6  # knee of bench/gyroid.csv
AREA_PER_PERIOD = 3.0915  # area of the gyroid in a cube of its period, over the period squared
PHASE_MM = (0.137, 0.291, 0.413)  # keeps symmetry planes of the gyroid off the axis, and nodes off zero
OVERLAP_MM = 0.3  # how far the sheet reaches into the flange: one printed layer and a half
ARC_STEPS = 720  # facets of the envelope a turn: 0.0012 mm off the circle at D=250
MAX_TRIALS = 5
_SNAP = 0.02  # of a step: nodes nearer to a level move off it, so that no sliver is born


@dataclass(frozen=True)
class InterfaceMesh:
    """The printed interface.

    Attributes:
        mesh: closed mesh of flange and gyroid, coordinates as an STL holds them.
        period_mm: period of the gyroid.
        density: TPU in the zone over the zone's volume, after islands were dropped.
        dropped_fraction: TPU in islands that hung free at the zone's edge, over the TPU of the sheet.
        zone_volume_mm3: volume of the zone.
    """

    mesh: trimesh.Trimesh
    period_mm: float
    density: float
    dropped_fraction: float
    zone_volume_mm3: float


@dataclass(frozen=True)
class ZoneGrid:
    """Nodes that follow the zone, one step beyond it on every side.

    Attributes:
        azimuths: (a,) radians, periodic, without the closing one.
        heights: (h,) mm.
        shares: (s,) share of the radial width, 0 at the inner and 1 at the outer side.
        inner: (h,) cylindrical radius at share 0, mm.
        width: (h,) radial width, mm.
    """

    azimuths: np.ndarray
    heights: np.ndarray
    shares: np.ndarray
    inner: np.ndarray
    width: np.ndarray

    def points(self) -> np.ndarray:
        """(a + 1, h, s, 3) float32 nodes in mm; the last azimuth repeats the first."""
        radii = self.inner[:, None] + self.width[:, None] * self.shares  # (h, s)
        turn = np.append(self.azimuths, self.azimuths[0])
        nodes = np.empty((len(turn), *radii.shape, 3), dtype=np.float32)
        nodes[..., 0] = np.cos(turn)[:, None, None] * radii
        nodes[..., 1] = np.sin(turn)[:, None, None] * radii
        nodes[..., 2] = self.heights[:, None]
        return nodes


def interface_mesh(params: EndcapParams, step_mm: float = STEP_MM) -> InterfaceMesh:
    """Mesh of the whole TPU interface, its period tuned so that the zone is 10 % TPU.

    Args:
        params: the design.
        step_mm: grid step; the knee of its curve is the default.

    Raises:
        GeometryError: no period within reach gives the density, or the mesh is not closed.
    """
    flange = to_manifold(tessellate(build_flange(params)))
    grid = zone_grid(params, step_mm)
    envelope = zone_envelope(params)
    zone_mm3 = zone_volume_mm3(params)

    def trial(period_mm: float) -> InterfaceMesh:
        sheet = to_manifold(sheet_mesh(grid, period_mm, step_mm))
        whole = from_manifold((sheet ^ envelope) + flange)
        body, dropped_mm3 = largest_body(whole)
        tpu = volume_above(body, params.flange_thickness_mm)
        return InterfaceMesh(body, period_mm, tpu / zone_mm3, dropped_mm3 / (tpu + dropped_mm3), zone_mm3)

    return tune_period(trial, AREA_PER_PERIOD * WALL_MM / DENSITY)


def tune_period(trial: Callable[[float], InterfaceMesh], period_mm: float) -> InterfaceMesh:
    """Search the period whose density is the target: density goes nearly as 1/period, so scale, then secant.

    Raises:
        GeometryError: not within the tolerance after ``MAX_TRIALS`` meshes.
    """
    results = [trial(period_mm)]
    while abs(results[-1].density / DENSITY - 1) > DENSITY_TOLERANCE:
        if len(results) == MAX_TRIALS:
            raise GeometryError(
                f"gyroid density {results[-1].density:.5f} outside {DENSITY} +- {DENSITY_TOLERANCE:.1%} after "
                f"{MAX_TRIALS} periods: use a finer step_mm"
            )
        results.append(trial(_next_period(results)))
    return results[-1]


def _next_period(results: list[InterfaceMesh]) -> float:
    """Secant in log period and log density, its slope held near the law's -1."""
    last = results[-1]
    slope = -1.0
    if len(results) > 1:
        rise = math.log(last.density / results[-2].density)
        slope = min(-0.5, max(-2.0, rise / math.log(last.period_mm / results[-2].period_mm)))
    return last.period_mm * math.exp(math.log(DENSITY / last.density) / slope)


def zone_grid(params: EndcapParams, step_mm: float) -> ZoneGrid:
    """Grid with about one step between nodes in each direction."""
    low = params.flange_thickness_mm - OVERLAP_MM - 1.5 * step_mm
    high = params.interlock_top_mm + 1.5 * step_mm
    heights = np.linspace(low, high, math.ceil((high - low) / step_mm) + 1)
    inner, outer = zone_radii_mm(params)
    offsets = heights - params.centre_height_mm
    inside = np.maximum(np.sqrt(inner**2 - offsets**2), zone_clip_radius_mm(params)) - 1.5 * step_mm
    width = np.sqrt(outer**2 - offsets**2) + 1.5 * step_mm - inside
    shares = np.linspace(0, 1, math.ceil(float(width.max()) / step_mm) + 1)
    turn = math.ceil(2 * math.pi * outer / step_mm)
    return ZoneGrid(2 * math.pi * np.arange(turn) / turn, heights, shares, inside, width)


def gyroid_distance_mm(points: np.ndarray, period_mm: float, band_mm: float, newton_steps: int = 2) -> np.ndarray:
    """Signed distance to the gyroid surface, held to ``-band_mm..band_mm``.

    Args:
        points: (..., 3) mm.
        period_mm: period of the gyroid.
        band_mm: where the distance matters; outside it only its sign does.
        newton_steps: 1 for g / |grad g|; each further step goes on from the foot of the last, inside the band.

    Returns:
        (...) distances in mm.
    """
    wave = np.float32(2 * math.pi / period_mm)
    start = (points.reshape(-1, 3) - np.asarray(PHASE_MM, dtype=points.dtype)) * wave
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
    """Field (n,) and gradient (n, 3) at phases (n, 3) in radians."""
    sines, cosines = np.sin(phase), np.cos(phase)
    value = (sines * np.roll(cosines, -1, axis=-1)).sum(-1)  # sin x cos y + sin y cos z + sin z cos x
    gradient = cosines * np.roll(cosines, -1, axis=-1) - sines * np.roll(sines, 1, axis=-1)
    return value, gradient


def sheet_mesh(grid: ZoneGrid, period_mm: float, step_mm: float, newton_steps: int = 2) -> trimesh.Trimesh:
    """Closed mesh of the sheet on the whole grid: the surface at +t/2, and the one at -t/2 inside it, turned inward."""
    distance = gyroid_distance_mm(grid.points(), period_mm, 3 * step_mm, newton_steps)
    distance[-1] = distance[0]
    near, far = (level_surface(grid, distance, side * WALL_MM / 2, step_mm) for side in (-1, 1))
    return trimesh.Trimesh(
        np.concatenate([far.vertices, near.vertices]),
        np.concatenate([far.faces, near.faces[:, ::-1] + len(far.vertices)]),
        process=False,
        validate=False,
    )


def level_surface(grid: ZoneGrid, distance: np.ndarray, level_mm: float, step_mm: float) -> trimesh.Trimesh:
    """Closed, outward surface of ``distance < level_mm``, capped at the grid's ends, joined where the azimuth closes.

    Args:
        grid: the nodes.
        distance: (a + 1, h, s) mm, its last azimuth equal to its first.
        level_mm: the level.
        step_mm: the grid's step.
    """
    gap = distance - np.float32(level_mm)
    snap = np.float32(_SNAP * step_mm)
    gap = np.where(np.abs(gap) < snap, np.where(gap < 0, -snap, snap), gap)
    gap = np.pad(gap, ((0, 0), (1, 1), (1, 1)), constant_values=np.float32(step_mm))
    nodes, faces, _, _ = marching_cubes(gap, 0.0, gradient_direction="descent", allow_degenerate=False)
    nodes = nodes.astype(np.float64) - (0, 1, 1)
    turn = len(grid.azimuths)
    faces = _join_turn(nodes, faces, turn)
    heights, shares = (_extended(axis) for axis in (grid.heights, grid.shares))
    z = np.interp(nodes[:, 1], *heights)
    radius = np.interp(nodes[:, 1], heights[0], _extended(grid.inner)[1]) + np.interp(
        nodes[:, 2], *shares
    ) * np.interp(nodes[:, 1], heights[0], _extended(grid.width)[1])
    angle = nodes[:, 0] * (2 * math.pi / turn)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).astype(np.float32)
    return trimesh.Trimesh(points.astype(np.float64), faces, process=False, validate=False)


def _extended(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Node numbers and values of an axis, one node longer at both ends, for the caps."""
    first, last = 2 * axis[0] - axis[1], 2 * axis[-1] - axis[-2]
    return np.arange(-1, len(axis) + 1, dtype=np.float64), np.concatenate([[first], axis, [last]])


def _join_turn(nodes: np.ndarray, faces: np.ndarray, turn: int) -> np.ndarray:
    """Faces whose corners in the last azimuth plane are replaced by their equals in the first.

    Corners in the two planes pair up by the grid edge that they lie on, so that no rounding can part them.
    """
    first, last = (np.flatnonzero(np.abs(nodes[:, 0] - plane) < 1e-3) for plane in (0, turn))

    def edge_order(members: np.ndarray) -> np.ndarray:
        edges = np.round(nodes[members, 1:] * 1024) / 1024
        edges = np.where(edges == np.round(edges), edges, np.floor(edges) + 0.5)
        order = np.lexsort(edges.T)
        return members[order]

    if len(first) != len(last):
        raise GeometryError("the gyroid does not close around the axis: change step_mm a little")
    target = np.arange(len(nodes))
    target[edge_order(last)] = edge_order(first)
    return target[faces]


def zone_envelope(params: EndcapParams) -> manifold3d.Manifold:
    """The zone as a fine mesh, with a skirt reaching into the flange so that the sheet fuses with it.

    The skirt's outer side leans inward, away from the vents.
    """
    inner, outer = zone_radii_mm(params)
    clip = zone_clip_radius_mm(params)
    heights = np.linspace(params.flange_thickness_mm, params.interlock_top_mm, 65)
    offsets = heights - params.centre_height_mm
    outside = np.sqrt(outer**2 - offsets**2)
    inside = np.maximum(np.sqrt(inner**2 - offsets**2), clip)
    skirt = heights[0] - OVERLAP_MM
    profile = [(outside[0] - 3 * OVERLAP_MM, skirt), *zip(outside, heights, strict=True)]
    profile += [*zip(inside[::-1], heights[::-1], strict=True), (inside[0] + OVERLAP_MM, skirt)]
    section = manifold3d.CrossSection([np.asarray(profile)])
    return manifold3d.Manifold.revolve(section, ARC_STEPS)


def largest_body(mesh: trimesh.Trimesh) -> tuple[trimesh.Trimesh, float]:
    """The largest connected body of a mesh, and the volume (mm^3) of the ones left out."""
    edges = mesh.faces[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = coo_matrix((np.ones(len(edges), dtype=np.int8), edges.T), shape=(len(mesh.vertices),) * 2)
    count, label = connected_components(links, directed=False)
    if count == 1:
        return mesh, 0.0
    of_face = label[mesh.faces[:, 0]]
    keep = of_face == np.bincount(of_face).argmax()
    used, corners = np.unique(mesh.faces[keep], return_inverse=True)
    body = trimesh.Trimesh(mesh.vertices[used], corners.reshape(-1, 3), process=False, validate=False)
    return body, float(mesh.volume - body.volume)


def volume_above(mesh: trimesh.Trimesh, height_mm: float) -> float:
    """Volume (mm^3) of a closed mesh above a plane: the flux of (z - height) through its faces, clipped there."""
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
    """The parts above z = 0 of triangles that cross it: a tip, or a quadrangle as two triangles."""
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
