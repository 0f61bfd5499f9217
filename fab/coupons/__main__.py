"""Command `python -m fab.coupons` (make coupons): fit and bond coupons, meshed, checked and written like molds (mm)."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cad.coupons import CLEARANCES_MM, NUT_WIDTHS_MM, TRAYS, cast_volume_mm3
from cad.data_table import file_name
from cad.materials import DEFAULT_SILICONE, silicone, silicones
from cad.messages import show
from cad.options import chosen
from cad.typed_folder import EXPORTS
from fab.checks.check import require_passed
from fab.command import Command
from fab.exports.whole_folder import whole_folder, write_record
from fab.slice.printers import DEFAULT_PRINTER, printer

if TYPE_CHECKING:
    import trimesh

    from cad.part import Part
    from fab.checks.check import Check

RECORD = "coupons.json"
IN_TRAY = {"tensile_tray": "tensile_tpu", "tensile_plain_tray": "", "peel_tray": "peel_tpu"}
HELP = f"""\
options, as NAME=VALUE:
  exports=DIR      folder that receives coupons/ (default: exports/)
  material=NAME    silicone of the bond specimens (default: {DEFAULT_SILICONE}); another gets a folder of its own,
                   for example coupons_Dragon-Skin-30/
  printer=NAME     of the slicer projects of the fit coupons (default: {DEFAULT_PRINTER}), a row of
                   fab/slice/printers.csv

fit_joints.*.3mf, fit_nuts.*.3mf: slicer projects of fit_plate with fit_tab, and of fit_nuts, with the settings of the
  molds and of the interface: a coupon printed with other settings fits other steps
fit_plate, fit_tab: push the tab into the sockets from above; the first that slides by hand without play is yours.
  Notches count the step: {", ".join(f"{k + 1} = {gap:.2f}" for k, gap in enumerate(CLEARANCES_MM))} mm a side.
  Then: make molds D=130 T=8 joint_clearance=0.20
fit_nuts: pockets of {", ".join(f"{width:.2f}" for width in NUT_WIDTHS_MM)} mm for the M3 square nut.
  The second is the interface's.
tensile_*, peel_*: bond specimens and their trays; evaluate with python -m fab.bond_tests DIR

writes STL, STEP, 3MF, slicer projects, coupons.png, coupons.json; the folder appears whole, after every check, or not
at all
exit status: 0 written; 1 a check failed; 2 bad input or no place to write; 130 interrupted
"""


COMMAND = Command(
    "make coupons",
    "[exports=DIR] [material=NAME] [printer=NAME]",
    "Make the coupons that show the joint clearance of your printer and the strength of your bond.",
    HELP,
    {"exports": EXPORTS, "material": DEFAULT_SILICONE, "printer": DEFAULT_PRINTER},
)


@dataclass(frozen=True)
class CouponLine:
    """One line of the BOM: material of one print or one pour.

    Attributes:
        item: part, or the tray that is filled.
        material: filament or silicone.
        volume_mm3: solid volume, or silicone in the tray.
        mass_g: of the silicone; None for prints, whose mass the slicer reports.
    """

    item: str
    material: str
    volume_mm3: float
    mass_g: float | None


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return COMMAND.run(
        argv,
        lambda options, interrupts: make_coupons(
            Path(options["exports"]), options["material"], options["printer"], interrupts.raise_swallowed
        ),
    )


def make_coupons(
    exports: Path,
    material: str = DEFAULT_SILICONE,
    where: str = DEFAULT_PRINTER,
    check_interrupt: Callable[[], None] = lambda: None,
) -> int:
    """Build, check and write every coupon.

    Args:
        exports: folder that receives ``coupons``.
        material: silicone of the bond specimens, a row of materials.csv, in upper or lower case.
        where: printer of the fit coupons, a row of printers.csv.
        check_interrupt: raises KeyboardInterrupt where a library swallowed one.

    Returns:
        0.

    Raises:
        ParameterError: no such silicone or printer, or its bed is too small for the fit coupons.
        ChecksFailedError: a check failed; nothing is left.
        FileError: the folder cannot be written.
    """
    from cad.coupons import coupon_parts
    from fab.coupons.mesh import coupon_meshes
    from fab.coupons.projects import write_fit_projects
    from fab.pictures.parts import PictureItem, render_parts

    material = chosen("material", material, silicones(), "cad/materials.csv")
    bed = printer(where)
    density = silicone(material).density_g_cm3
    label = "coupons" if material == DEFAULT_SILICONE else f"coupons_{file_name(material)}"
    with whole_folder(exports / label, RECORD, check_interrupt) as folder:
        parts = {part.name: part for part in coupon_parts()}
        meshes, walls = coupon_meshes(parts)
        write_parts(parts, meshes, folder)
        checks, volumes = checked(parts, folder)
        projects = write_fit_projects(meshes, bed, folder)
        items = [PictureItem(name, meshes[name], part.color, part.material) for name, part in parts.items()]
        render_parts(items, folder / "coupons.png")
        lines = coupon_bom({name: part.material for name, part in parts.items()}, volumes, material, density)
        content = {
            "printer": bed.name,
            "projects": projects,
            "clearances_mm": CLEARANCES_MM,
            "nut_pockets_mm": NUT_WIDTHS_MM,
            "gyroid_wall_mm": {name: round(wall, 5) for name, wall in walls.items()},
            "bom": [vars(line) for line in lines],
            "checks": [check.record(9) for check in checks],
        }
        write_record(folder, RECORD, content)
    show(f"{exports / label}: {len(parts)} parts, all {len(checks)} checks passed")
    return 0


def write_parts(parts: Mapping[str, Part], meshes: Mapping[str, trimesh.Trimesh], folder: Path) -> None:
    """Write STL, STEP and 3MF of every part.

    Args:
        parts: by name.
        meshes: by name, mm.
        folder: receives ``<name>.stl``, ``.step`` and ``.3mf``.
    """
    from fab.exports.part_3mf import write_3mf
    from fab.exports.writer import write_shape
    from fab.meshing.mesh import write_stl

    for name, part in parts.items():
        write_stl(folder / f"{name}.stl", meshes[name])
        write_3mf(meshes[name], name, folder / f"{name}.3mf")
        write_shape(part.solid, folder / f"{name}.step")


def checked(parts: Mapping[str, Part], folder: Path) -> tuple[list[Check], dict[str, float]]:
    """Check the written folder; return the checks and the volumes (mm3) of its meshes.

    Args:
        parts: by name.
        folder: with their files.

    Raises:
        ChecksFailedError: a check failed.
    """
    from fab.coupons.checks import coupon_checks, solid_checks
    from fab.meshing.mesh import read_stl

    read = {name: read_stl(folder / f"{name}.stl") for name in parts}
    checks = [*solid_checks(parts), *coupon_checks(parts, read)]
    require_passed(checks, "of the coupons")
    return checks, {name: float(mesh.volume) for name, mesh in read.items()}


def coupon_bom(
    materials: Mapping[str, str], volumes_mm3: Mapping[str, float], silicone_name: str, density_g_cm3: float
) -> list[CouponLine]:
    """Lines of the prints with their volumes, and of the pours with volume and mass, one of each.

    Args:
        materials: of each printed part, by its name.
        volumes_mm3: of the same parts.
        silicone_name: of the silicone that is poured.
        density_g_cm3: of the silicone.
    """
    lines = [CouponLine(name, material, volumes_mm3[name], None) for name, material in materials.items()]
    for tray in TRAYS:
        inside = volumes_mm3.get(IN_TRAY[tray.name], 0.0)
        volume = cast_volume_mm3(tray.name, inside)
        lines.append(CouponLine(f"{tray.name} filled", silicone_name, volume, 1e-3 * volume * density_g_cm3))
    return lines


if __name__ == "__main__":
    sys.exit(main())
