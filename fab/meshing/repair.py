"""Repair of slivers: faces thinner than the coordinates are exact, which cross their neighbours (millimetres).

Booleans leave such slivers where two surfaces only just meet, and the rounding to what an STL holds (float32) then
folds them over. The repair is local and never opens the mesh: it collapses an edge or turns one round, both only where
the result is a closed surface again. No vertex moves by more than :data:`REACH_MM`; the gates prove the volume and
look for crossings once more, on the file read back.
"""

from __future__ import annotations

import numpy as np
import trimesh

from fab.meshing.self_intersections import crossing_faces

REACH_MM = 0.05  # longest edge that may collapse: what printers resolve
ROUNDS = 12
_MARGIN_MM = 1.0  # round the crossings, that is looked at again after each round


def without_crossings(mesh: trimesh.Trimesh, band_mm: tuple[float, float] | None = None) -> trimesh.Trimesh:
    """The mesh, repaired where faces cross; what cannot be repaired is left for the gates to refuse.

    Args:
        mesh: closed.
        band_mm: heights between which faces may cross; by default, anywhere.

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
    """One round: each crossing face or a face on its edges loses its short edge or its flat corner.

    Returns:
        The mesh, and the corners (n, 3) of the faces that crossed.
    """
    near = _Patch(mesh, crossing)
    for face in near.ring(crossing):
        near.shorten(face, reach_mm)
    for face in crossing:
        near.turn(int(face), reach_mm)
    return near.mesh(), mesh.triangles[crossing].reshape(-1, 3)


def _slab(mesh: trimesh.Trimesh, band_mm: tuple[float, float]) -> np.ndarray:
    """Two corners of the part of the mesh's box that lies between two heights."""
    corners = mesh.bounds.copy()
    corners[:, 2] = band_mm
    return corners


def _crossing_near(mesh: trimesh.Trimesh, places: np.ndarray, margin_mm: float = _MARGIN_MM) -> np.ndarray:
    """Crossing faces among those near some places: indices into the whole mesh."""
    low, high = places.min(axis=0) - margin_mm, places.max(axis=0) + margin_mm
    box = mesh.triangles
    inside = np.flatnonzero((box.min(axis=1) <= high).all(axis=1) & (box.max(axis=1) >= low).all(axis=1))
    return inside[crossing_faces(trimesh.Trimesh(mesh.vertices, mesh.faces[inside], process=False, validate=False))]


class _Patch:
    """The faces round some crossings, open to changes; the rest of the mesh stays as it is."""

    def __init__(self, mesh: trimesh.Trimesh, crossing: np.ndarray) -> None:
        faces = np.asarray(mesh.faces)
        touched = np.zeros(len(mesh.vertices), dtype=bool)
        touched[faces[crossing]] = True
        for _ in range(3):
            rows = np.flatnonzero(touched[faces].any(axis=1))
            touched[faces[rows]] = True
        self._points = np.asarray(mesh.vertices)
        self._rows = np.flatnonzero(touched[faces].any(axis=1))  # one ring more than may change
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
        """The crossing faces, then those that share a corner with them."""
        first = [int(face) for face in crossing]
        corners = {vertex for face in first for vertex in self._faces[face]}
        return first + sorted({row for vertex in corners for row in self._at[vertex]} - set(first))

    def shorten(self, face: int, reach_mm: float) -> None:
        """Collapse the shortest edge of a face where it is within reach and the surface stays closed."""
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
        """Turn the longest edge of a flat face round, where its corner is within reach of that edge."""
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
        """The whole mesh with what has changed; vertices that nothing uses are dropped."""
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
        """The link condition, and no face turned over but slivers of the reach."""
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
        """Least height of a triangle."""
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
