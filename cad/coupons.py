"""Test pieces to print and cast before an endcap: fit coupons for joints and nuts, and bond specimens. Millimetres.

Every part stands on z = 0 in its printing pose. Sizes marked P are from the paper, those marked E are our estimate.

* Fit: a plate with one jigsaw socket for each clearance, a tab that goes into them, and a TPU bar with nut pockets.
  Notches on the edge number the steps: one notch for the first, two for the second.
* Tensile (P): 25 x 25 x 50 silicone on a TPU block of the same size with 25 of interference, which gives a length of
  75; the other group is a plain block and a plain prism, glued.
* Peel, after ASTM D1876 (P): 25 x 300 x 25, 100 unbonded. We interpret 25 as the total thickness: TPU arm, one period
  of gyroid, silicone arm (E); a printed spacer separates the arms where they are not bonded.

Bond specimens are cast lying in open trays; they are pushed out through a hole under the TPU's grip end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cad.bought import bought_mm
from cad.interface import POCKET_HEIGHT_MM, POCKET_WIDTH_MM
from cad.part import Part

if TYPE_CHECKING:
    from build123d import Shape, Solid

CLEARANCES_MM = (0.05, 0.10, 0.15, 0.20, 0.25, 0.30)  # on each side; the molds' default is 0.15
NUT_WIDTHS_MM = tuple(round(POCKET_WIDTH_MM + d, 2) for d in (-0.10, 0.0, 0.10, 0.20))  # of the pockets
TAB_RADIUS_MM = 4.0  # that of the core's tabs
TAB_BEYOND_MM = 0.62 * TAB_RADIUS_MM  # distance of the disc's centre beyond the seam
PLATE_MM = 8.0  # height of joint and tab
PITCH_MM = 14.0  # between the middles of neighbouring sockets
NOTCH_MM = 1.2  # width of a counting notch
WIDTH_MM = 25.0  # P, BND01: width and thickness of every bond specimen
TENSILE_BLOCK_MM = 50.0  # P, BND01: length of the TPU, and of the silicone
INTERFERENCE_MM = 25.0  # P, BND02: length in which the gyroid locks TPU and silicone
PEEL_MM = 300.0  # P, BND05: length of a peel specimen
UNBONDED_MM = 100.0  # P, BND05: length of it that is not bonded
ARM_MM = 5.5  # E: thickness of each arm of a peel specimen
PEEL_ZONE_MM = WIDTH_MM - 2 * ARM_MM  # height of its gyroid: one period of the 10 % gyroid
TRAY_WALL_MM = 4.0  # thickness of a tray's walls and floor
TRAY_PLAY_MM = 0.2  # on each side, between TPU and tray
PUSH_RADIUS_MM = 4.0  # of the push-out hole
PLA, TPU = (0.82, 0.82, 0.86), (0.90, 0.55, 0.10)  # colours: RGB, 0..1


@dataclass(frozen=True)
class Tray:
    """An open mold for one specimen.

    Attributes:
        name: name of the part.
        length_mm: length of its cavity, play included, mm.
        push_mm: distance of the push-out hole from the cavity's end, mm; 0 for no hole.
    """

    name: str
    length_mm: float
    push_mm: float

    @property
    def width_mm(self) -> float:
        """Width of the cavity, mm."""
        return WIDTH_MM + 2 * TRAY_PLAY_MM

    @property
    def depth_mm(self) -> float:
        """Depth of the cavity, mm: the specimen's thickness when the cavity is filled to the brim."""
        return WIDTH_MM


TRAYS = (  # molds of the bond specimens
    Tray("tensile_tray", 2 * TENSILE_BLOCK_MM - INTERFERENCE_MM + 2 * TRAY_PLAY_MM, 12.5),
    Tray("tensile_plain_tray", TENSILE_BLOCK_MM, 0.0),
    Tray("peel_tray", PEEL_MM + 2 * TRAY_PLAY_MM, 12.5),
)


def coupon_parts() -> tuple[Part, ...]:
    """All printed parts, without gyroid, which the meshes add (:mod:`fab.coupons.__main__`)."""
    makers = (
        ("fit_plate", "PLA", fit_plate()),
        ("fit_tab", "PLA", fit_tab()),
        ("fit_nuts", "TPU 95A", fit_nuts()),
        ("tensile_tpu", "TPU 95A", _box(WIDTH_MM, WIDTH_MM, TENSILE_BLOCK_MM - INTERFERENCE_MM)),
        ("tensile_plain_tpu", "TPU 95A", _box(WIDTH_MM, WIDTH_MM, TENSILE_BLOCK_MM)),
        ("peel_tpu", "TPU 95A", _box(PEEL_MM, WIDTH_MM, ARM_MM)),
        ("peel_spacer", "PLA", _box(UNBONDED_MM - TRAY_PLAY_MM, WIDTH_MM, PEEL_ZONE_MM)),
        *((tray.name, "PLA", tray_solid(tray)) for tray in TRAYS),
    )
    return tuple(
        Part(name, "printed", material, solid, TPU if material.startswith("TPU") else PLA)
        for name, material, solid in makers
    )


def zones_mm() -> dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Gyroid zones: name of the TPU part -> lowest and highest corner of a box, mm."""
    half = WIDTH_MM / 2
    foot = TENSILE_BLOCK_MM - INTERFERENCE_MM
    return {
        "tensile_tpu": ((-half, -half, foot), (half, half, TENSILE_BLOCK_MM)),
        "peel_tpu": ((UNBONDED_MM - PEEL_MM / 2, -half, ARM_MM), (PEEL_MM / 2, half, ARM_MM + PEEL_ZONE_MM)),
    }


def cast_volume_mm3(name: str, tpu_mm3: float) -> float:
    """Volume of silicone that fills a tray to the brim round the TPU part in it, from the sizes of the boxes.

    Args:
        name: name of the tray.
        tpu_mm3: volume of the TPU part, mm3.

    Returns:
        The volume, mm3.
    """
    tray = {tray.name: tray for tray in TRAYS}[name]
    cavity = tray.length_mm * tray.width_mm * tray.depth_mm
    spacer = (UNBONDED_MM - TRAY_PLAY_MM) * WIDTH_MM * PEEL_ZONE_MM if name == "peel_tray" else 0.0
    return cavity - tpu_mm3 - spacer


def fit_plate() -> Solid:
    """Plate with one socket for each clearance in its edge y = 0, numbered by notches in the opposite edge."""
    length, depth = PITCH_MM * len(CLEARANCES_MM), 14.0
    body: Shape = _at(_box(length, depth, PLATE_MM), length / 2, -depth / 2)
    cuts = []
    for k, gap in enumerate(CLEARANCES_MM):
        x = socket_x_mm(k)
        cuts.append(_disc(x, -TAB_BEYOND_MM, TAB_RADIUS_MM + gap))
        cuts.append(_at(_box(PITCH_MM, 2 * gap, PLATE_MM), x, 0.0))  # the seam is cut back by the same clearance
        cuts += [_at(_box(NOTCH_MM, 2.0, PLATE_MM), x + (j - k / 2) * 2 * NOTCH_MM * 0.9, -depth) for j in range(k + 1)]
    return _one(body.cut(*cuts), "fit_plate")


def fit_tab() -> Solid:
    """Nominal tab on a handle; it slides into a socket from above, with the same gap round the tab and on the seam."""
    handle = _at(_box(PITCH_MM - 2.0, 12.0, PLATE_MM), 0.0, 6.0)
    return _one(handle.fuse(_disc(0.0, -TAB_BEYOND_MM, TAB_RADIUS_MM)), "fit_tab")


def socket_x_mm(step: int) -> float:
    """Middle of a socket along the plate, mm."""
    return PITCH_MM * (step + 0.5)


def fit_nuts() -> Solid:
    """TPU bar with a pocket for each width, open on one side as in the interface, numbered by notches."""
    nut = bought_mm("nut_m3", "across_flats")
    pitch, depth, height = nut + 6.0, nut + 6.0, 6.0
    length = pitch * len(NUT_WIDTHS_MM)
    body: Shape = _at(_box(length, depth, height), length / 2, -depth / 2)
    cuts = []
    for k, width in enumerate(NUT_WIDTHS_MM):
        x = pitch * (k + 0.5)
        reach = nut + 2.0
        cuts.append(_at(_box(width, reach, POCKET_HEIGHT_MM), x, -reach / 2, 2.2))
        cuts.append(_disc(x, -reach + nut / 2, bought_mm("screw_m3", "clearance_hole") / 2, 2.2 + POCKET_HEIGHT_MM + 1))
        cuts += [_at(_box(NOTCH_MM, 1.6, height), x + (j - k / 2) * 2 * NOTCH_MM * 0.9, -depth) for j in range(k + 1)]
    return _one(body.cut(*cuts), "fit_nuts")


def tray_solid(tray: Tray) -> Solid:
    """Box with an open cavity, and with a hole through which the specimen is pushed out by its TPU grip end."""
    length, width = tray.length_mm + 2 * TRAY_WALL_MM, tray.width_mm + 2 * TRAY_WALL_MM
    body: Shape = _box(length, width, tray.depth_mm + TRAY_WALL_MM)
    cuts = [_at(_box(tray.length_mm, tray.width_mm, tray.depth_mm), 0.0, 0.0, TRAY_WALL_MM)]
    if tray.push_mm:
        cuts.append(_disc(-tray.length_mm / 2 + tray.push_mm, 0.0, PUSH_RADIUS_MM))
    return _one(body.cut(*cuts), tray.name)


def _box(length: float, width: float, height: float) -> Solid:
    """Box on z = 0, centred in x and y."""
    from build123d import Pos, Solid

    return Pos(-length / 2, -width / 2, 0) * Solid.make_box(length, width, height)


def _at(solid: Solid, x: float, y: float, z: float = 0.0) -> Solid:
    from build123d import Pos

    return Pos(x, y, z) * solid


def _disc(x: float, y: float, radius: float, height: float = PLATE_MM) -> Solid:
    from build123d import Plane, Solid

    return Solid.make_cylinder(radius, height, Plane(origin=(x, y, 0)))


def _one(shape: Shape, name: str) -> Solid:
    from cad.solids import one_solid

    return one_solid(shape, name)
