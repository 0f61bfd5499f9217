"""Triangle meshes: tessellation of solids, STL files, conversion to and from manifold3d.

Lengths are in mm. A mesh is a ``trimesh.Trimesh`` that was never "processed": vertices are merged only where they are
equal to the bit, so that a mesh equals its file exactly.

Notes:
    OCCT's convenience exporters use a deflection relative to each edge's length, by which volumes were 2.4 % too
    small. The deflection here is absolute: every facet lies within ``tolerance_mm`` of its surface.
    OCCT's other triangulation of the same nodes (DelaBella) takes an eighth of the time on a ball, but its facets
    deviate from the surface by twice the tolerance: the error of the cup's volume is ten times as large, and the wall
    deviates by 0.02 mm at D=179.6.
"""

from __future__ import annotations

import hashlib
import os
import struct
import tempfile
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import manifold3d
import numpy as np
import trimesh

from cad.errors import FileError, GeometryError

if TYPE_CHECKING:
    from build123d import Shape

TOLERANCE_MM = 0.01  # knee of bench/tessellation.csv: printers resolve 0.05 mm
SMALL_DIAMETER_MM, SMALL_TOLERANCE_MM = 105.0, 0.008  # volume of a small, thick core's wedge is 0.1 % off at 0.01
ANGLE_RAD = 0.5  # between facets: keeps small fillets and holes round; at least 13 facets per turn
REFINEMENTS = 4  # tolerances that are tried, each half of the last
KEPT_SOLIDS = 24  # cached bodies: all parts of a design
_solids: dict[int, manifold3d.Manifold] = {}  # hash of a mesh -> its body; the last KEPT_SOLIDS
_STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def part_tolerance_mm(diameter_mm: float) -> float:
    """Chord tolerance of a design's parts, mm; each mesh then has its solid's volume to 0.1 % (export's limit)."""
    return SMALL_TOLERANCE_MM if diameter_mm < SMALL_DIAMETER_MM else TOLERANCE_MM


def tessellate(solid: Shape, tolerance_mm: float = TOLERANCE_MM, angle_rad: float = ANGLE_RAD) -> trimesh.Trimesh:
    """Triangulate a solid with an absolute chord tolerance.

    Args:
        solid: a build123d shape whose faces are valid.
        tolerance_mm: largest distance of a facet from its surface, mm.
        angle_rad: largest angle between neighbouring facets of one surface, radians.

    Returns:
        Mesh with outward faces, coordinates rounded to float32 as in a binary STL, without degenerate faces.

    Raises:
        GeometryError: a face has no triangles, or the mesh stays open.

    Notes:
        Where a bump meets the wall of a tab at a sharp angle, facets of both can coincide at one tolerance; a finer one
        separates them. An open mesh is therefore made again at half the tolerance.
    """
    for attempt in range(REFINEMENTS):
        mesh = _triangulate(solid, tolerance_mm / 2**attempt, angle_rad)
        if is_closed(mesh):
            return mesh
    raise GeometryError(f"the solid's mesh stays open at {tolerance_mm / 2 ** (REFINEMENTS - 1):g} mm: report D and T")


def _triangulate(solid: Shape, tolerance_mm: float, angle_rad: float) -> trimesh.Trimesh:
    """One pass of OCCT's mesher; faces are joined at equal points."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools
    from OCP.TopLoc import TopLoc_Location

    BRepTools.Clean_s(solid.wrapped)
    BRepMesh_IncrementalMesh(solid.wrapped, tolerance_mm, False, angle_rad, True)
    if any(BRep_Tool.Triangulation_s(face.wrapped, TopLoc_Location()) is None for face in solid.faces()):
        raise GeometryError("a face of the solid could not be triangulated: check the solid with BRepCheck")
    corners = _facets(solid).astype(np.float64)
    # Two faces may have a shared node as 1e-14 and 2e-14: equal after rounding to a nanometre, not in float32.
    return weld(np.round(corners, 6), np.arange(len(corners)).reshape(-1, 3))


def _facets(solid: Shape) -> np.ndarray:
    """Corners (3 n, 3) of a triangulated solid, mm, through a file: a tenth of the time of a call for each node.

    Raises:
        FileError: the temporary folder is full, or cannot be written.
    """
    from OCP.StlAPI import StlAPI_Writer

    writer = StlAPI_Writer()
    writer.ASCIIMode = False
    try:
        with TemporaryDirectory() as folder:
            path = Path(folder) / "solid.stl"
            writer.Write(solid.wrapped, str(path))
            return _stl_corners(path)
    except (OSError, FileError) as error:
        where = tempfile.tempdir or os.environ.get("TMPDIR", "/tmp")
        raise FileError(
            f"temporary folder {where} is full or cannot be written: free some space in it, or name another with TMPDIR"
        ) from error


def weld(points: np.ndarray, triangles: np.ndarray) -> trimesh.Trimesh:
    """Join vertices that are equal in float32; remove triangles that collapse (as at poles of spheres) or cancel.

    Two triangles on the same corners with opposite orientation are a wedge that is thinner than the tolerance, where a
    bump meets the wall of a tab at a sharp angle. They enclose no volume.

    Args:
        points: (n, 3) coordinates, mm.
        triangles: (m, 3) indices of points.
    """
    unique, inverse = unique_rows(points.astype(np.float32))
    corners = inverse[triangles]
    kept = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    corners = corners[kept]
    ordered = np.sort(corners, axis=1)
    if _repeats(ordered, len(unique)):  # rare, and found in a third of the time that it takes to group them
        _, group = unique_rows(ordered)
        corners = corners[np.bincount(group)[group] == 1]
    return trimesh.Trimesh(unique.astype(np.float64), corners, process=False, validate=False)


def _repeats(rows: np.ndarray, count: int) -> bool:
    """Whether two rows (n, 3) of integers below ``count`` are equal."""
    if count > 1 << 21:  # three such numbers fill 63 bits
        return True
    keys = np.sort((rows[:, 0] * count + rows[:, 1]) * count + rows[:, 2])
    return bool((keys[1:] == keys[:-1]).any())


def is_closed(mesh: trimesh.Trimesh) -> bool:
    """Whether every edge of a mesh belongs to exactly two of its faces, in whatever direction they pass it.

    It equals ``mesh.is_watertight``, which groups the edges to compare their directions, too, and takes three times as
    long.
    """
    starts, ends = np.asarray(mesh.faces).ravel(), np.asarray(mesh.faces)[:, [1, 2, 0]].ravel()
    keys = np.sort(np.minimum(starts, ends) * len(mesh.vertices) + np.maximum(starts, ends))
    first, second = keys[0::2], keys[1::2]
    return len(keys) > 0 and len(keys) % 2 == 0 and bool((first == second).all() and (first[1:] != second[:-1]).all())


def is_oriented(mesh: trimesh.Trimesh) -> bool:
    """Whether a mesh is closed, and the two faces at each edge pass it in opposite directions.

    It equals ``mesh.is_watertight and mesh.is_winding_consistent``, and takes half the time.
    """
    starts, ends = np.asarray(mesh.faces).ravel(), np.asarray(mesh.faces)[:, [1, 2, 0]].ravel()
    if len(starts) == 0 or (starts == ends).any():
        return False
    there, back = (np.sort(one * len(mesh.vertices) + other) for one, other in ((starts, ends), (ends, starts)))
    return bool((there == back).all() and (there[1:] != there[:-1]).all())


def unique_rows(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct rows in ascending order, and the index (n,) of each row among them.

    It is many times faster than ``numpy.unique`` along an axis, which compares rows as bytes: the first two columns are
    packed into one integer, their rank and the third column into another one, and integers are sorted quickly.

    Args:
        rows: (n, 3), float32 or integers from 0 to below 2**32.
    """
    rows = rows + rows.dtype.type(0)  # -0 becomes 0
    first, second, third = _ordered_bits(rows).T
    _, _, rank = _ranked(first << np.uint64(32) | second)
    order, fresh, places = _ranked(rank << np.uint64(32) | third)
    return rows[order[fresh]], places.astype(np.int64)


def _ordered_bits(numbers: np.ndarray) -> np.ndarray:
    """Integers below 2**32 in the order of the numbers: the bits of a float32, inverted for negative numbers."""
    if numbers.dtype != np.float32:
        return numbers.astype(np.uint64)
    bits = numbers.view(np.uint32)
    negative = (numbers.view(np.int32) >> 31).view(np.uint32)  # all bits of a negative number, none of another
    return (bits ^ (negative | np.uint32(1 << 31))).astype(np.uint64)


def _ranked(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sorting order (n,) of keys, mask (n,) in that order of each value's first key, rank (n,) of each key."""
    order = np.argsort(keys)
    ordered = keys[order]
    fresh = np.ones(len(keys), dtype=bool)
    fresh[1:] = ordered[1:] != ordered[:-1]
    ranks = np.empty(len(keys), dtype=np.uint64)
    ranks[order] = np.cumsum(fresh) - 1
    return order, fresh, ranks


def write_stl(path: Path, mesh: trimesh.Trimesh) -> None:
    """Write a binary STL; equal meshes give equal bytes (fixed header, faces in their order)."""
    records = np.zeros(len(mesh.faces), dtype=_STL_RECORD)
    corners = mesh.vertices[mesh.faces].astype(np.float32)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records["corners"] = corners
    with path.open("wb") as stream:
        stream.write(b"binary STL, millimetres".ljust(80, b"\0"))
        stream.write(struct.pack("<I", len(records)))
        stream.write(records.tobytes())


def read_stl(path: Path) -> trimesh.Trimesh:
    """Read a binary STL; only equal corners are joined.

    Raises:
        FileError: the file is not a binary STL, or is truncated.
    """
    corners = _stl_corners(path)
    return weld(corners, np.arange(len(corners)).reshape(-1, 3))


def _stl_corners(path: Path) -> np.ndarray:
    """Corners (3 n, 3), float32, of the n triangles of a binary STL, in the file's unit."""
    data = path.read_bytes()
    count = struct.unpack("<I", data[80:84])[0] if len(data) >= 84 else 0
    if count == 0 or len(data) != 84 + count * _STL_RECORD.itemsize:
        raise FileError(f"{path}: not a whole binary STL ({len(data)} bytes): export it again")
    return np.frombuffer(data, dtype=_STL_RECORD, offset=84)["corners"].reshape(-1, 3)


def joined(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Several meshes as one, with the faces in their order; no vertices are joined."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    corners = [np.asarray(mesh.faces) + start for mesh, start in zip(meshes, starts, strict=True)]
    points = np.concatenate([np.asarray(mesh.vertices) for mesh in meshes])
    return trimesh.Trimesh(points, np.concatenate(corners), process=False, validate=False)


def volume_mm3(mesh: trimesh.Trimesh) -> float:
    """Volume of a closed mesh, mm3: the flux of x e_x through its faces.

    Equal to the bit to ``mesh.volume``, which also integrates moments of inertia and takes fifteen times as long.
    """
    a, b, c = (mesh.triangles[:, k] for k in range(3))
    (_, y1, z1), (_, y2, z2) = (b - a).T, (c - b).T
    return float(((y1 * z2 - z1 * y2) * (a[:, 0] + b[:, 0] + c[:, 0])).sum() / 6)


def mesh_sha256(mesh: trimesh.Trimesh) -> str:
    """SHA-256 of a mesh's coordinates and faces in their order."""
    digest = hashlib.sha256()
    for numbers in (np.asarray(mesh.vertices, dtype="<f8"), np.asarray(mesh.faces, dtype="<i8")):
        digest.update(f"{numbers.shape}".encode() + numbers.tobytes())
    return digest.hexdigest()


def to_manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold:
    """Convert a closed mesh to a body of manifold3d; the last ones are cached, as checks use the same mesh many times.

    Raises:
        GeometryError: the mesh is not an oriented 2-manifold.
    """
    key = hash(mesh)  # hash of its vertices and faces
    solid = _solids.pop(key) if key in _solids else _checked_manifold(mesh)
    while len(_solids) >= KEPT_SOLIDS:
        _solids.pop(next(iter(_solids)))
    _solids[key] = solid  # the most recently used one is the last
    return solid


def _checked_manifold(mesh: trimesh.Trimesh) -> manifold3d.Manifold:
    solid = manifold3d.Manifold(
        manifold3d.Mesh(
            vert_properties=np.asarray(mesh.vertices, dtype=np.float32),
            tri_verts=np.asarray(mesh.faces, dtype=np.uint32),
        )
    )
    if solid.status() != manifold3d.Error.NoError:
        raise GeometryError(f"the mesh is not a closed manifold ({solid.status().name}): check the part's solid")
    return solid


def from_manifold(solid: manifold3d.Manifold) -> trimesh.Trimesh:
    """Mesh of a body of manifold3d."""
    mesh = solid.to_mesh()
    return weld(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts, dtype=np.int64))
