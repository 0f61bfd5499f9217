"""Off-screen pictures of parts: exploded view, capped section, sheet of all parts.

Millimetres, endcap frame; orthographic views are fitted to the parts, so that nothing is cut off and sizes can be
compared. Equal meshes give equal pictures on one machine. :mod:`fab.pictures.canvas` draws them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from cad.errors import FileError, GeometryError
from cad.whole_file import drafted
from fab.meshing.mesh import from_manifold, to_manifold
from fab.pictures.canvas import Canvas, Frame, Point, Surface, View, write_png

WIDTH_PX = 1600  # of a picture
LABEL_RATIO = 0.015  # size of the names over the picture's width
SMALL_RATIO = 0.7  # size of the second line over the first's
LETTER_RATIO = 0.55  # mean width of a letter over its size
GREY = (0.42, 0.45, 0.50)  # RGB, 0..1
EXPLODED_VIEW = View.looking_from((0.50, -0.72, 0.46), up=(-0.90, -0.45, 0.0))
SECTION_VIEW = View.looking_from((0.0, -1.0, 0.30), up=(0.0, 0.0, 1.0))
PART_VIEW = View.looking_from((0.55, -0.80, 0.62), up=(0.0, 0.0, 1.0))
INSIDE_TINT = 0.45  # how far the surfaces behind a section fade to white, so that the cut stands out


@dataclass(frozen=True)
class PictureItem:
    """One part in a picture.

    Attributes:
        name: name of the part, its label.
        mesh: closed mesh in the endcap frame (mm).
        color: sRGB in 0..1.
        role: second line of the label on the sheet of parts, for example ``printed``.
        offset: displacement (x, y, z) in the exploded view, mm.
        outside: mesh without the hidden inside, which looks the same from outside; by default ``mesh``.
    """

    name: str
    mesh: trimesh.Trimesh
    color: tuple[float, float, float]
    role: str = ""
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    outside: trimesh.Trimesh | None = None

    @property
    def seen(self) -> trimesh.Trimesh:
        """Mesh for views of the whole part."""
        return self.mesh if self.outside is None else self.outside


def render_exploded(items: Sequence[PictureItem], path: Path, width_px: int = WIDTH_PX) -> None:
    """Draw the parts displaced by their offsets, each with its name, as one wide picture.

    Args:
        items: the parts.
        path: the file.
        width_px: width of the picture, px; its height follows.

    Raises:
        GeometryError: no parts.
        FileError: the picture could not be written.
    """
    places = [item.seen.vertices + np.array(item.offset) for item in _some(items)]
    low, high = _bounds(EXPLODED_VIEW, places)
    label = _label_px(width_px)
    band = math.ceil(4.5 * label)  # below the parts, for two rows of names
    scale = (width_px - 2 * label) / (high[0] - low[0])
    drawn = math.ceil((high[1] - low[1]) * scale) + 2 * label
    frame = Frame(EXPLODED_VIEW, (0, band, width_px, drawn), tuple((low + high) / 2), scale)
    canvas = Canvas(width_px, drawn + band)
    canvas.panel(frame, [Surface(p, i.seen.faces, np.array(i.color)) for p, i in zip(places, items, strict=True)])
    middles = [float(np.mean((x.min(), x.max()))) for x in (frame.pixels(points)[:, 0] for points in places)]
    names = [_title(item.name) for item in items]
    for name, middle, row in zip(names, middles, name_rows(names, middles, label), strict=True):
        canvas.text((middle, band - (1.5 + 1.5 * row) * label), name, label)
    _save(canvas, path)


def name_rows(names: Sequence[str], middles_px: Sequence[float], size_px: int) -> list[int]:
    """Row (0 or 1) of each name, so that neighbouring names do not overlap.

    Args:
        names: the names, from left to right.
        middles_px: (n,) x of their middles, px.
        size_px: size of the letters, px.
    """
    rows, ends = [0] * len(names), [-math.inf, -math.inf]
    for k in sorted(range(len(names)), key=lambda k: middles_px[k]):
        half = (len(names[k]) + 1) * LETTER_RATIO * size_px / 2
        rows[k] = 0 if middles_px[k] - half >= ends[0] or ends[0] <= ends[1] else 1
        ends[rows[k]] = middles_px[k] + half
    return rows


def render_section(
    items: Sequence[PictureItem], path: Path, width_px: int = WIDTH_PX, view: View = SECTION_VIEW
) -> None:
    """Draw the half y >= 0 of the assembled parts, with the cut in each part's colour and with leader lines.

    Where two cut faces coincide, that of the later part is visible. Offsets are ignored.

    Args:
        items: the parts.
        path: the file.
        width_px: width of the picture, px; its height follows.
        view: the view.

    Raises:
        GeometryError: no parts, none of them reaches y > 0, or a mesh is not closed.
        FileError: the picture could not be written.
    """
    halves = [(item, half) for item in _some(items) if len((half := _half(item.mesh)).faces)]
    if not halves:
        raise GeometryError("section y >= 0 is empty: the parts must cross the plane y = 0")
    low, high = _bounds(view, [half.vertices for _, half in halves])
    side = width_px // 6  # free on the left and on the right, for labels
    scale = (width_px - 2 * side) / (high[0] - low[0])
    height = math.ceil((high[1] - low[1]) * scale) + 3 * _label_px(width_px)
    frame = Frame(view, (0, 0, width_px, height), tuple((low + high) / 2), scale)
    surfaces, anchors = [], []
    for rank, (item, half) in enumerate(halves):
        cut = _is_cut_face(half)
        color = np.array(item.color)
        surfaces.append(Surface(half.vertices, half.faces[~cut], color + (1 - color) * INSIDE_TINT))
        lift = np.array([0.0, -0.02 * (rank + 1), 0.0])
        surfaces.append(Surface(half.vertices + lift, half.faces[cut], color, smooth=False))
        anchors.append((item.name, _anchor(half, cut, rank)))
    canvas = Canvas(width_px, height)
    canvas.panel(frame, surfaces)
    points = frame.pixels(np.array([anchor for _, anchor in anchors]))
    _label_sides(canvas, [(name, tuple(p)) for (name, _), p in zip(anchors, points, strict=True)], side)
    _save(canvas, path)


def render_parts(items: Sequence[PictureItem], path: Path, width_px: int = WIDTH_PX, columns: int = 5) -> None:
    """Draw every part in a cell of its own, with name, role and size.

    Args:
        items: the parts.
        path: the file.
        width_px: width of the picture, px; its height follows.
        columns: largest number of cells in a row.

    Raises:
        GeometryError: no parts.
        FileError: the picture could not be written.
    """
    columns = min(columns, len(_some(items)))
    label, cell = _label_px(width_px), width_px // columns
    caption = 3 * label
    rows = math.ceil(len(items) / columns)
    canvas = Canvas(width_px, rows * (cell + caption))
    for index, item in enumerate(items):
        row, column = divmod(index, columns)
        left, bottom = column * cell, (rows - 1 - row) * (cell + caption) + caption
        low, high = _bounds(PART_VIEW, [item.seen.vertices])
        scale = 0.88 * cell / float(max(high - low))
        frame = Frame(PART_VIEW, (left, bottom, cell, cell), tuple((low + high) / 2), scale)
        canvas.panel(frame, [Surface(item.seen.vertices, item.seen.faces, np.array(item.color))])
        size = " × ".join(f"{length:.0f}" for length in item.mesh.extents)
        middle = left + cell / 2
        canvas.text((middle, bottom - 0.5 * label), _title(item.name), label)
        canvas.text(
            (middle, bottom - 1.6 * label), f"{item.role}  {size} mm".strip(), round(SMALL_RATIO * label), color=GREY
        )
    _save(canvas, path)


def _some(items: Sequence[PictureItem]) -> Sequence[PictureItem]:
    if not items:
        raise GeometryError("a picture needs at least one part: got none")
    return items


def _label_px(width_px: int) -> int:
    return max(6, round(LABEL_RATIO * width_px))


def _title(name: str) -> str:
    return name.replace("_", " ").replace("led ", "LED ")


def _bounds(view: View, places: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest picture-plane coordinates (mm) of point sets."""
    flat = [view.project(points) for points in places]
    return np.min([p.min(axis=0) for p in flat], axis=0), np.max([p.max(axis=0) for p in flat], axis=0)


def _half(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Closed part with y >= 0 of a closed mesh."""
    return from_manifold(to_manifold(mesh).trim_by_plane((0.0, 1.0, 0.0), 0.0))


def _is_cut_face(half: trimesh.Trimesh) -> np.ndarray:
    """Mask (m,) of the faces in the plane y = 0."""
    return np.abs(half.vertices[half.faces][:, :, 1]).max(axis=1) < 1e-4


def _anchor(half: trimesh.Trimesh, cut: np.ndarray, rank: int) -> np.ndarray:
    """End (3,) of a part's leader line, mm: far out on its cut face, alternately right and left of the axis."""
    faces = half.vertices[half.faces[cut]] if cut.any() else half.vertices[half.faces]
    centres = faces.mean(axis=1)
    areas = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1)
    outward = -centres[:, 0] if rank % 2 else centres[:, 0]
    return centres[int(np.argmax(np.where(areas >= 0.05 * areas.max(), outward, -np.inf)))]


def _label_sides(canvas: Canvas, labels: Sequence[tuple[str, Point]], side_px: int) -> None:
    """Draw the labels in columns at the left and at the right without overlap, joined to their points."""
    width, height = canvas.size
    label = _label_px(width)
    line = 1.6 * label
    for is_left in (True, False):
        column = sorted((p[1], p[0], name) for name, p in labels if (p[0] < width / 2) == is_left)
        y = label - line
        for rank, (wanted, x, name) in enumerate(column):
            room_above = (len(column) - 1 - rank) * line
            y = max(y + line, min(wanted, height - label - room_above))
            edge, inward = (0.8 * side_px, 1) if is_left else (width - 0.8 * side_px, -1)
            canvas.line([(edge, y), (edge + inward * label, y), (x, wanted)])
            canvas.text((edge - inward * label / 3, y), _title(name), label, "right" if is_left else "left")


def _save(canvas: Canvas, path: Path) -> None:
    """Write the picture under a temporary name, then rename it."""
    try:
        with drafted(path) as draft:
            write_png(canvas.image(), draft)
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror}): choose a folder with room") from error
