"""Print settings by part: one record, translated into the keys of PrusaSlicer and of OrcaSlicer or Bambu Studio.

Lengths in mm, speeds in mm/s, densities in per cent, temperatures in degrees Celsius. Every value is our choice (E)
unless marked.

Notes:
    The zone's settings open its sides: without perimeters and without top and bottom layers the slicer's default infill
    anchors still run along four tenths of the boundary; ``infill_anchor``, ``infill_anchor_max`` and
    ``solid_infill_below_area`` at 0 stop that (M, GYR06).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from cad.pattern import RELEASED_GYROID
from fab.slice.filaments import Filament, filament
from fab.slice.orca_presets import orca_presets, orca_type
from fab.slice.printers import Printer, printer
from fab.slice.region import Region

FILAMENT_DIAMETER_MM = 1.75
LAYER_MM = 0.2
LINE_MM = 0.45
ROUNDING_MM = LAYER_MM * (1 - math.pi / 4)  # width that a line lacks by its round sides (S, GYR02)
FIRST_LAYER_MM_S = "20"
BRIM_GAP_MM = "0.1"  # between part and brim; OrcaSlicer's default of 0 fuses them
GYROID_LINE = 2.44  # length of line per area of a gyroid's section, times its period (S, GYR03)


# Keys of the bed's temperature, by kind of plate: where one is left out, the second layer cools that plate to 35 or 45.
ORCA_BEDS = ("cool", "eng", "hot", "textured", "textured_cool", "supertack")
ORCA_PLATES = [f"{plate}_plate_temp{end}" for plate in ORCA_BEDS for end in ("", "_initial_layer")]


@dataclass(frozen=True)
class PrintSettings:
    """Print settings of one part.

    Attributes:
        filament: of the part.
        region: infill and walls of volumes that have no region of their own.
        speed_mm_s: of the infill; outer walls go at half of it.
        support: whether overhangs over the bed are supported.
        brim_mm: width of the brim; 0 for none.
        grow_mm: outward offset of each outline.
        thin_lines: walls of varying width, for sheets of one line; slower and less robust than plain walls.
        reason: of these settings, for the build sheet.
        printer: on which it is printed.
    """

    filament: Filament
    region: Region
    speed_mm_s: float
    support: bool = False
    brim_mm: float = 0.0
    grow_mm: float = 0.0
    thin_lines: bool = False
    reason: str = ""
    printer: Printer = field(default_factory=printer)

    def piece_prusa(self) -> dict[str, str]:
        """Settings that may differ between the parts of one plate, for PrusaSlicer."""
        speed, slow = f"{self.speed_mm_s:g}", f"{self.speed_mm_s / 2:g}"
        return {
            "brim_type": "outer_only" if self.brim_mm else "no_brim",
            "brim_width": f"{self.brim_mm:g}",
            **self.region.prusa(),
            "support_material": "1" if self.support else "0",
            **dict.fromkeys(("perimeter_speed", "infill_speed", "solid_infill_speed"), speed),
            **dict.fromkeys(("external_perimeter_speed", "top_solid_infill_speed", "small_perimeter_speed"), slow),
        }

    def piece_orca(self) -> dict[str, str]:
        """The same for OrcaSlicer and Bambu Studio."""
        speed, slow = f"{self.speed_mm_s:g}", f"{self.speed_mm_s / 2:g}"
        return {
            "brim_type": "outer_only" if self.brim_mm else "no_brim",
            "brim_width": f"{self.brim_mm:g}",
            **self.region.orca(),
            "enable_support": "1" if self.support else "0",
            **dict.fromkeys(("inner_wall_speed", "sparse_infill_speed", "internal_solid_infill_speed"), speed),
            **dict.fromkeys(("outer_wall_speed", "top_surface_speed"), slow),
        }

    def prusa(self) -> dict[str, str]:
        """The whole configuration for PrusaSlicer 2.5 and later."""
        line, filament, retraction = f"{LINE_MM:g}", self.filament, self.filament.retraction
        return {
            "printer_technology": "FFF",
            "gcode_flavor": "marlin2",
            "bed_shape": ",".join(self.printer.corners),
            "max_print_height": f"{self.printer.height_mm:g}",
            "nozzle_diameter": f"{self.printer.nozzle_mm:g}",
            **self.printer.prusa_presets,
            "use_relative_e_distances": "1",
            "layer_gcode": "G92 E0",
            "start_gcode": self.printer.start_gcode(filament.nozzle_c, filament.bed_c),
            "end_gcode": self.printer.end_gcode,
            "gcode_label_objects": "1",
            "retract_length": f"{self.printer.retract_mm:g}",
            "skirts": "0",
            "layer_height": f"{LAYER_MM:g}",
            "first_layer_height": f"{LAYER_MM:g}",
            **dict.fromkeys(PRUSA_LINES, line),
            "perimeter_generator": "arachne" if self.thin_lines else "classic",
            "elefant_foot_compensation": "0.1",
            "xy_size_compensation": f"{self.grow_mm:g}",
            **self.piece_prusa(),
            "support_material_auto": "1",
            "support_material_buildplate_only": "1",
            "support_material_threshold": "40",
            "brim_separation": BRIM_GAP_MM,
            "first_layer_speed": FIRST_LAYER_MM_S,
            "filament_type": filament.type,
            "filament_diameter": f"{FILAMENT_DIAMETER_MM:g}",
            "filament_density": f"{filament.density_g_cm3:g}",
            "filament_cost": f"{filament.price_usd_kg:g}",
            "filament_max_volumetric_speed": f"{filament.max_flow_mm3_s:g}",
            **dict.fromkeys(("temperature", "first_layer_temperature"), str(filament.nozzle_c)),
            **dict.fromkeys(("bed_temperature", "first_layer_bed_temperature"), str(filament.bed_c)),
            "fan_always_on": "1",
            "disable_fan_first_layers": "3",
            **dict.fromkeys(PRUSA_FANS, str(filament.fan_percent)),
            **(retraction.prusa(self.printer.retract_mm) if retraction else {}),
        }

    def orca(self) -> dict[str, str | list[str]]:
        """The whole configuration for OrcaSlicer and Bambu Studio: one value as text, values by filament as lists."""
        own = self._own_orca()
        return {**own, **orca_presets(own, self.printer, self.filament)}

    def _own_orca(self) -> dict[str, str | list[str]]:
        filament, retraction = self.filament, self.filament.retraction
        return {
            "printable_area": list(self.printer.corners),
            **({"bed_exclude_area": self.printer.excluded_corners} if self.printer.exclude_mm else {}),
            "printable_height": f"{self.printer.height_mm:g}",
            "nozzle_diameter": [f"{self.printer.nozzle_mm:g}"],
            "retraction_length": [f"{self.printer.retract_mm:g}"],
            "machine_start_gcode": self.printer.start_gcode(filament.nozzle_c, filament.bed_c).replace("\\n", "\n"),
            "machine_end_gcode": self.printer.end_gcode.replace("\\n", "\n"),
            "use_relative_e_distances": "1",
            "before_layer_change_gcode": "G92 E0",
            "layer_height": f"{LAYER_MM:g}",
            "initial_layer_print_height": f"{LAYER_MM:g}",
            **dict.fromkeys(ORCA_LINES, f"{LINE_MM:g}"),
            "wall_generator": "arachne" if self.thin_lines else "classic",
            "elefant_foot_compensation": "0.1",
            "xy_contour_compensation": f"{self.grow_mm:g}",
            "xy_hole_compensation": f"{-self.grow_mm:g}",
            **self.piece_orca(),
            "skirt_loops": "0",
            "brim_object_gap": BRIM_GAP_MM,
            **dict.fromkeys(("initial_layer_speed", "initial_layer_infill_speed"), FIRST_LAYER_MM_S),
            "support_type": "normal(auto)",
            "support_on_build_plate_only": "1",
            "support_threshold_angle": "40",
            "filament_type": [orca_type(filament)],
            "filament_diameter": [f"{FILAMENT_DIAMETER_MM:g}"],
            "filament_density": [f"{filament.density_g_cm3:g}"],
            "filament_cost": [f"{filament.price_usd_kg:g}"],
            "filament_max_volumetric_speed": [f"{filament.max_flow_mm3_s:g}"],
            "nozzle_temperature": [str(filament.nozzle_c)],
            "nozzle_temperature_initial_layer": [str(filament.nozzle_c)],
            **{key: [str(filament.bed_c)] for key in ORCA_PLATES},
            "reduce_fan_stop_start_freq": ["1"],
            "close_fan_the_first_x_layers": ["3"],
            **{key: [str(filament.fan_percent)] for key in ORCA_FANS},
            **(retraction.orca(self.printer.retract_mm) if retraction else {}),
        }


PRUSA_LINES = (
    "extrusion_width",
    "first_layer_extrusion_width",
    "perimeter_extrusion_width",
    "external_perimeter_extrusion_width",
    "infill_extrusion_width",
    "solid_infill_extrusion_width",
    "top_infill_extrusion_width",
)
ORCA_LINES = (
    "line_width",
    "initial_layer_line_width",
    "inner_wall_line_width",
    "outer_wall_line_width",
    "sparse_infill_line_width",
    "internal_solid_infill_line_width",
    "top_surface_line_width",
)

# Where one is left out, the fan runs at 100 % over bridges and short layers, over TPU and PETG, too.
PRUSA_FANS = ("min_fan_speed", "max_fan_speed", "bridge_fan_speed")
ORCA_FANS = ("fan_min_speed", "fan_max_speed", "overhang_fan_speed")

FLANGE = Region(walls=3, top_layers=4, bottom_layers=4, density_percent=100, pattern="rectilinear")
CUP = Region(walls=3, top_layers=4, bottom_layers=4, density_percent=10)
CORE_REASON = "light; brim, for little stands on the bed; the ramp over the neck is propped from the bed"
CORE = Region(walls=2, top_layers=4, bottom_layers=4, density_percent=8)
HARDWARE = Region(walls=4, top_layers=5, bottom_layers=5, density_percent=40)


def native_density_percent(wall_mm: float, fraction: float = RELEASED_GYROID) -> float:
    """Infill density to set in the slicer so that a fraction of a zone between two walls is printed, per cent.

    Args:
        wall_mm: thickness of the zone.
        fraction: of the zone's volume that is to be printed.

    Notes:
        With line spacing s the slicer's period is 2 pi s / (2.44 rho) (S, GYR03). A gyroid of period L has a length of
        line of 2.44 / L per area, each of width s: a density of 0.948 rho. Lines end s / 2 before the zone's sides.
    """
    spacing = LINE_MM - ROUNDING_MM
    return 100 * fraction * 2 * math.pi / GYROID_LINE**2 / (1 - spacing / wall_mm)


def zone_region(wall_mm: float, fraction: float = RELEASED_GYROID) -> Region:
    """Region of the plain zone, open on all sides; arguments are those of :func:`native_density_percent`."""
    density = round(native_density_percent(wall_mm, fraction), 2)
    return Region(0, 0, 0, density, "gyroid", anchor_mm=0.0, solid_below_mm2=0.0)


def part_settings(name: str, material: str, where: Printer | None = None) -> PrintSettings:
    """Settings of a part by its stable name and its material.

    Args:
        name: of the part.
        material: of the part, a row of filaments.csv.
        where: the printer; by default any with a 256 mm bed.

    Raises:
        ParameterError: an unknown material.
    """
    spool, where = filament(material), where or printer()
    if name == "interface":
        reason = "solid flange; the zone above it stays open for silicone"
        return PrintSettings(spool, FLANGE, 30.0, thin_lines=True, reason=reason, printer=where)
    if name.startswith("core_"):
        return PrintSettings(
            spool, CORE, 100.0, support=name != "core_centre", brim_mm=5.0, reason=CORE_REASON, printer=where
        )
    if name == "hanger":
        return PrintSettings(spool, CUP, 100.0, reason="flat, stiff enough to close the mold", printer=where)
    if name.startswith("cup_"):
        brim_mm = 3.0 if "bowl" in name else 0.0
        return PrintSettings(spool, CUP, 100.0, brim_mm=brim_mm, reason="three walls hold liquid", printer=where)
    return PrintSettings(spool, HARDWARE, 80.0, reason="stiff under its screws", printer=where)
