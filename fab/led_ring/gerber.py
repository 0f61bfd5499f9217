"""Writer and reader of the LED ring's fabrication files: Gerber X2 layers and an Excellon drill file, by gerbonara.

Millimetres, endcap x and y seen from the dome on every layer, as the format requires. The reader returns polygons by
layer, so checks and picture use the files that a board house receives.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from gerbonara import MM, ExcellonFile, GerberFile
from gerbonara.apertures import CircleAperture, ExcellonTool
from gerbonara.graphic_objects import Arc, Flash, Line, Region
from gerbonara.graphic_primitives import ArcPoly, Circle, Rectangle
from gerbonara.graphic_primitives import Line as StrokedLine
from shapely import LineString, MultiPolygon, Point, Polygon, box, unary_union
from shapely.geometry.base import BaseGeometry

from cad.errors import FileError
from cad.led_ring.board import BOARD_INNER_RADIUS_MM, BOARD_OUTER_RADIUS_MM
from fab.led_ring.copper import CIRCLE_SEGMENTS, VIA_DRILL_MM, VIA_PAD_MM, Copper, Pad, polygons
from fab.led_ring.silk import silk_shape

OUTLINE_MM = 0.1  # width of the line that draws the board's edge
MASK_GROWTH_MM = 0.05  # a side, opening of the solder mask round a pad
PASTE_SHRINK_MM = 0.05  # a side, opening of the stencil
UNUSED_APERTURE = b"%ADD10C,0.1*%\n"
_OVERLAP_MM = 1e-3  # of the pieces of a cut polygon, so that no hairline opens
LAYERS = {  # file -> X2 function
    "F_Cu": "Copper,L1,Top",
    "B_Cu": "Copper,L2,Bot",
    "F_Mask": "Soldermask,Top",
    "B_Mask": "Soldermask,Bot",
    "F_Paste": "Paste,Top",
    "B_Paste": "Paste,Bot",
    "F_Silk": "Legend,Top",
    "B_Silk": "Legend,Bot",
    "Edge_Cuts": "Profile,NP",
}
DRILL = "drill_plated"
SIDES = {"top": "F", "bottom": "B"}


def board_files(copper: Copper) -> dict[str, bytes]:
    """Fabrication files by name: ``led_ring-F_Cu.gbr`` and so on, and ``led_ring-drill_plated.drl``.

    Args:
        copper: of the board.
    """
    objects: dict[str, list[object]] = {name: [] for name in LAYERS}
    objects["B_Cu"] += regions(copper.plane)
    for side, letter in SIDES.items():
        pads = [pad for pad in copper.pads if pad.side == side]
        objects[f"{letter}_Cu"] += [_land(pad, 0.0) for pad in pads]
        objects[f"{letter}_Mask"] += [_land(pad, MASK_GROWTH_MM) for pad in pads]
        objects[f"{letter}_Paste"] += [_land(pad, -PASTE_SHRINK_MM) for pad in pads]
        objects[f"{letter}_Silk"] += regions(silk_shape(copper, side))
        objects[f"{letter}_Cu"] += [_round(via.centre, VIA_PAD_MM) for via in copper.vias]
    for track in copper.tracks:
        tip = CircleAperture(track.width, unit=MM)
        for (x0, y0), (x1, y1) in zip(track.points, track.points[1:], strict=False):
            objects[f"{SIDES[track.side]}_Cu"].append(Line(x0, y0, x1, y1, tip, unit=MM))
    pen = CircleAperture(OUTLINE_MM, unit=MM)
    for radius in (BOARD_OUTER_RADIUS_MM, BOARD_INNER_RADIUS_MM):
        for sign in (1, -1):
            objects["Edge_Cuts"].append(
                Arc(sign * radius, 0, -sign * radius, 0, -sign * radius, 0, False, pen, unit=MM)
            )
    files = {}
    for name, function in LAYERS.items():
        layer = GerberFile(objects=objects[name], file_attrs={".FileFunction": tuple(function.split(","))})
        files[f"led_ring-{name}.gbr"] = _repaired(layer.write_to_bytes())
    tool = ExcellonTool(VIA_DRILL_MM, plated=True, unit=MM)
    drill = ExcellonFile(objects=[Flash(*via.centre, tool, unit=MM) for via in copper.vias])
    files[f"led_ring-{DRILL}.drl"] = drill.write_to_bytes()
    return files


def _repaired(data: bytes) -> bytes:
    """Repair output of gerbonara 1.5 that other readers refuse or warn of.

    G75 without asterisk, G01 with two, deprecated IP. A file of regions alone names no aperture, by which programs such
    as gerbv take it for RS-274D, whose apertures lie in another file: it names one, which nothing draws with.
    """
    data = data.replace(b"\nG75\n", b"\nG75*\n").replace(b"**\n", b"*\n").replace(b"%IPPOS*%\n", b"")
    return data if b"%ADD" in data else data.replace(b"%LPD*%\n", b"%LPD*%\n" + UNUSED_APERTURE, 1)


def write_archive(files: dict[str, bytes], path: Path) -> None:
    """Write the files as one ZIP, the format of board houses; equal files give equal bytes.

    Args:
        files: by name.
        path: of the ZIP.
    """
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, data in files.items():
            info = ZipInfo(name)
            info.compress_type = ZIP_DEFLATED
            archive.writestr(info, data)


def read_archive(path: Path) -> tuple[dict[str, BaseGeometry], list[tuple[float, float, float]]]:
    """Read the areas and holes of a ZIP.

    Args:
        path: of the ZIP.

    Returns:
        Area of every layer by its name in :data:`LAYERS` (for ``Edge_Cuts`` the board's face), and the holes as
        ``(x, y, diameter)`` in mm.

    Raises:
        FileError: a layer is missing or unreadable.
    """
    try:
        with ZipFile(path) as archive:
            texts = {name: archive.read(name).decode() for name in archive.namelist()}
            layers = {}
            for name in LAYERS:
                (text,) = (text for file, text in texts.items() if file.endswith(f"-{name}.gbr"))
                gerber = GerberFile.from_string(text)
                layers[name] = _face(gerber) if name == "Edge_Cuts" else covered_area(gerber)
            (text,) = (text for file, text in texts.items() if file.endswith(f"-{DRILL}.drl"))
    except (OSError, ValueError, SyntaxError, KeyError) as error:
        raise FileError(f"{path}: not a whole set of board files ({error}): make it again") from error
    holes = []
    for hole in ExcellonFile.from_string(text).objects:
        metric = hole.converted(MM)
        holes.append((metric.x, metric.y, metric.aperture.diameter))
    return layers, holes


def regions(shape: BaseGeometry) -> list[Region]:
    """Gerber regions of a shape, cut through its holes, which a region cannot have.

    Args:
        shape: area, mm.
    """
    return [Region(list(piece.exterior.coords), unit=MM) for piece in pieces_without_holes(shape)]


def pieces_without_holes(shape: BaseGeometry) -> list[Polygon]:
    """Pieces of a shape, cut through its holes until none is left.

    Args:
        shape: area, mm.
    """
    return [piece for polygon in polygons(shape) for piece in _unholed(polygon)]


def _unholed(polygon: Polygon) -> Iterable[Polygon]:
    """Cut a polygon through its holes until no piece has one."""
    if not polygon.interiors:
        yield polygon
        return
    x = polygon.interiors[0].centroid.x
    left, low, right, high = polygon.bounds
    for half in (box(left, low, x + _OVERLAP_MM, high), box(x, low, right, high)):
        for piece in polygons(polygon & half):
            yield from _unholed(piece)


def _land(pad: Pad, growth: float) -> Region:
    """A pad as corners of its rectangle: some programs rotate the macros of rotated apertures the wrong way."""
    grown = replace(pad, width=pad.width + 2 * growth, height=pad.height + 2 * growth)
    return Region(list(grown.shape.exterior.coords), unit=MM)


def _round(centre: tuple[float, float], diameter: float) -> Flash:
    return Flash(*centre, CircleAperture(diameter, unit=MM), unit=MM)


def covered_area(gerber: GerberFile) -> BaseGeometry:
    """Area of a layer, dark and clear objects applied in the order of the file.

    Args:
        gerber: the layer.
    """
    area: BaseGeometry = MultiPolygon()
    batch: list[BaseGeometry] = []
    for item in gerber.objects:
        for primitive in item.to_primitives(MM):
            shape = _outline(primitive)
            if primitive.polarity_dark:
                batch.append(shape)
            else:
                area, batch = unary_union([area, *batch]) - shape, []
    return unary_union([area, *batch])


def _outline(primitive: object) -> BaseGeometry:
    """Polygon of a primitive; its arcs as chords of at most :data:`CIRCLE_SEGMENTS` to the quarter."""
    match primitive:
        case Circle():
            return Point(primitive.x, primitive.y).buffer(primitive.r, quad_segs=CIRCLE_SEGMENTS)
        case StrokedLine():
            ends = [(primitive.x1, primitive.y1), (primitive.x2, primitive.y2)]
            return LineString(ends).buffer(primitive.width / 2, quad_segs=CIRCLE_SEGMENTS)
        case Rectangle() | ArcPoly():
            return Polygon([start for start, _, _ in primitive.to_arc_poly().segments]).buffer(0)
    raise ValueError(f"{type(primitive).__name__} is not drawn by this program")


def _face(gerber: GerberFile) -> BaseGeometry:
    """The board inside its profile: circles drawn as arcs, outer less inner."""
    radii = sorted({round(math.hypot(*item.p1), 6) for item in gerber.objects if isinstance(item, Arc)}, reverse=True)
    centres = {(round(item.center[0], 6), round(item.center[1], 6)) for item in gerber.objects}
    if len(radii) != 2 or len(centres) != 1:
        raise ValueError(f"profile of {len(radii)} circles round {len(centres)} centres where two round one are drawn")
    outer, inner = (Point(*centres.copy().pop()).buffer(radius, quad_segs=360) for radius in radii)
    return outer - inner
