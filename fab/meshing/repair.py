"""Repair of slivers, faces thinner than the precision of the coordinates, which cross their neighbours (millimetres).

Booleans leave such slivers where two surfaces barely meet, and the rounding to float32 of an STL then folds them over.
The repair is local and keeps the mesh closed: it collapses or flips an edge, both only where the result is a closed
surface. No vertex moves by more than :data:`REACH_MM`; the export's checks measure the volume and search for crossings
again on the file read back.
"""

from __future__ import annotations

import numpy as np
import trimesh

from fab.meshing.self_intersections import crossing_faces

REACH_MM = 0.05  # longest edge that may collapse: the resolution of printers
ROUNDS = 12  # most repetitions
_MARGIN_MM = 1.0  # round the crossings: region that is searched again after each round


def without_crossings(mesh: trimesh.Trimesh, band_mm: tuple[float, float] | None = None) -> trimesh.Trimesh:
    """Repair a mesh where faces cross; crossings that remain are refused by the export's checks.

    Args:
        mesh: closed mesh, mm.
        band_mm: range of heights in which faces may cross, mm; by default, all heights.

    Returns:
        The mesh itself where no faces cross, otherwise a repaired copy.
    """
    crossing = crossing_faces(mesh) if band_mm is None else _crossing_near(mesh, _slab(mesh, band_mm), 0.0)
    reach = REACH_MM / 2 ** (ROUNDS - 1)
    for _ in range(ROUNDS):
        if len(crossing) == 0:
            break
        mesh, places = _treated(mesh, crossing, reach)
        crossing = _crossing_near(mesh, places)
        reach *= 2
    return mesh


def _treated(mesh: trimesh.Trimesh, crossing: np.ndarray, reach_mm: float) -> tuple[trimesh.Trimesh, np.ndarray]:
    """Repair round: collapse the short edge or flip the long edge of each crossing face or of a neighbour.

    Returns:
        The mesh, and the corners (n, 3) of the faces that crossed, mm.
    """
    near = _Patch(mesh, crossing)
    for face in near.ring(crossing):
        near.shorten(face, reach_mm)
    for face in crossing:
        near.turn(int(face), reach_mm)
    return near.mesh(), mesh.triangles[crossing].reshape(-1, 3)


def _slab(mesh: trimesh.Trimesh, band_mm: tuple[float, float]) -> np.ndarray:
    """Lowest and highest corner of the mesh's bounding box, limited to a range of heights."""
    corners = mesh.bounds.copy()
    corners[:, 2] = band_mm
    return corners


def _crossing_near(mesh: trimesh.Trimesh, places: np.ndarray, margin_mm: float = _MARGIN_MM) -> np.ndarray:
    """Indices in the whole mesh of the crossing faces near some places (n, 3)."""
    low, high = places.min(axis=0) - margin_mm, places.max(axis=0) + margin_mm
    box = mesh.triangles
    inside = np.flatnonzero((box.min(axis=1) <= high).all(axis=1) & (box.max(axis=1) >= low).all(axis=1))
    return inside[crossing_faces(trimesh.Trimesh(mesh.vertices, mesh.faces[inside], process=False, validate=False))]


class _Patch:
    """Editable faces round some crossings; the rest of the mesh is not changed."""

    def __init__(self, mesh: trimesh.Trimesh, crossing: np.ndarray) -> None:
        faces = np.asarray(mesh.faces)
        touched = np.zeros(len(mesh.vertices), dtype=bool)
        touched[faces[crossing]] = True
        for _ in range(3):
            rows = np.flatnonzero(touched[faces].any(axis=1))
            touched[faces[rows]] = True
        self._points = np.asarray(mesh.vertices)
        self._rows = np.flatnonzero(touched[faces].any(axis=1))  # one ring of faces more than may change
        self._all = faces
        self._faces = {int(row): tuple(int(v) for v in faces[row]) for row in self._rows}
        self._at: dict[int, set[int]] = {}
        for row, corners in self._faces.items():
            for vertex in corners:
                self._at.setdefault(vertex, set()).add(row)
        inner = np.zeros(len(mesh.vertices), dtype=bool)
        inner[faces[crossing]] = True
        inner[faces[np.flatnonzero(inner[faces].any(axis=1))]] = True
        self._free = inner

    def ring(self, crossing: np.ndarray) -> list[int]:
        """Crossing faces, followed by those that share a corner with them."""
        first = [int(face) for face in crossing]
        corners = {vertex for face in first for vertex in self._faces[face]}
        return first + sorted({row for vertex in corners for row in self._at[vertex]} - set(first))

    def shorten(self, face: int, reach_mm: float) -> None:
        """Collapse the shortest edge of a face if it is not longer than ``reach_mm`` and the surface stays closed."""
        if face not in self._faces:
            return
        corners = self._faces[face]
        edges = sorted((self._length(a, b), a, b) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True))
        length, a, b = edges[0]
        if length > reach_mm:
            return
        for kept, gone in ((a, b), (b, a)):
            if self._free[kept] and self._free[gone] and self._collapses(kept, gone):
                self._collapse(kept, gone)
                return

    def turn(self, face: int, reach_mm: float) -> None:
        """Flip the longest edge of a flat face if the opposite corner is within ``reach_mm`` of that edge."""
        if face not in self._faces:
            return
        corners = self._faces[face]
        i = max(range(3), key=lambda k: self._length(corners[k], corners[k - 2]))
        a, b, c = corners[i], corners[i - 2], corners[i - 1]
        others = [row for row in self._at[a] & self._at[b] if row != face]
        if len(others) != 1 or self._height(corners) > reach_mm:
            return
        d = next(vertex for vertex in self._faces[others[0]] if vertex not in (a, b))
        if c == d or self._at[c] & self._at[d]:
            return
        before, after = self._normal(self._faces[others[0]]), ((a, d, c), (d, b, c))
        if all(float(self._normal(corners) @ before) >= 0 for corners in after):
            self._replace(face, after[0])
            self._replace(others[0], after[1])

    def mesh(self) -> trimesh.Trimesh:
        """The whole mesh with the changes, without unused vertices."""
        kept = np.ones(len(self._all), dtype=bool)
        faces = self._all.copy()
        for row in self._rows:
            corners = self._faces.get(int(row))
            kept[row] = corners is not None
            if corners is not None:
                faces[row] = corners
        used, renumbered = np.unique(faces[kept], return_inverse=True)
        return trimesh.Trimesh(self._points[used], renumbered.reshape(-1, 3), process=False, validate=False)

    def _length(self, a: int, b: int) -> float:
        return float(np.linalg.norm(self._points[a] - self._points[b]))

    def _normal(self, corners: tuple[int, ...]) -> np.ndarray:
        p = self._points[list(corners)]
        normal = np.cross(p[1] - p[0], p[2] - p[0])
        length = float(np.linalg.norm(normal))
        return normal / length if length > 0 else normal

    def _collapses(self, kept: int, gone: int) -> bool:
        """Whether an edge may collapse: the link condition holds, and no face is reversed except slivers."""
        around = [{v for row in self._at[vertex] for v in self._faces[row]} for vertex in (kept, gone)]
        shared = self._at[kept] & self._at[gone]
        if len(shared) != 2 or len((around[0] & around[1]) - {kept, gone}) != 2:
            return False
        for row in self._at[gone] - shared:
            corners = self._faces[row]
            after = tuple(kept if vertex == gone else vertex for vertex in corners)
            if self._height(corners) > REACH_MM and float(self._normal(corners) @ self._normal(after)) < 0.5:
                return False
        return True

    def _height(self, corners: tuple[int, ...]) -> float:
        """Least height of a triangle, mm."""
        p = self._points[list(corners)]
        longest = max(float(np.linalg.norm(p[i] - p[i - 1])) for i in range(3))
        return float(np.linalg.norm(np.cross(p[1] - p[0], p[2] - p[0]))) / longest if longest > 0 else 0.0

    def _collapse(self, kept: int, gone: int) -> None:
        for row in list(self._at[gone]):
            corners = self._faces[row]
            if kept in corners:
                for vertex in corners:
                    self._at[vertex].discard(row)
                del self._faces[row]
            else:
                self._replace(row, tuple(kept if vertex == gone else vertex for vertex in corners))

    def _replace(self, row: int, corners: tuple[int, ...]) -> None:
        for vertex in self._faces[row]:
            self._at[vertex].discard(row)
        self._faces[row] = corners
        for vertex in corners:
            self._at[vertex].add(row)
