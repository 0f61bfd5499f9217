"""Printers: rows of ``printers.csv`` with bed, nozzle, levelling, and the names of their presets in both slicers.

Millimetres. The start is home, level, heat, and a line along the bed's left edge that fills the nozzle, where no part
lies; the printer's own preset may do more (resonance, flow), but fills the nozzle where parts may lie.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from cad.data_table import positive, read_table
from cad.errors import ParameterError
from cad.options import chosen
from fab.slice.excluded import Rectangle, corners, gap_mm, outline, read_rectangle
from fab.variant import printer_option

PRINTER_TABLE = Path(__file__).with_name("printers.csv")
DEFAULT_PRINTER = "generic256"
MARGIN_MM = 4.0  # round the part: brim and the width of a line
NOZZLE_RANGE_MM = (0.3, 0.45)  # E: the lines of all prints are 0.45 mm wide, which is 1 to 1.5 times the nozzle
PROBE_C = 170  # E: of the nozzle while it probes: warm, and nothing drips
# E: the nozzle has dripped while it was heated, so 19 mm3 go into a line 0.7 mm wide, 0.15 to 0.85 mm from the middle
# of the bed's left edge (brims keep 1 mm off it), at 1.9 mm3/s, slow enough for TPU; the last 10 mm wipe the nozzle.
PURGE_X_MM, PURGE_MM, PURGE_FILAMENT_MM, WIPE_MM = 0.5, 100.0, 8.0, 10.0


@dataclass(frozen=True)
class Printer:
    """One row.

    Attributes:
        name: as typed, for example ``mk4``.
        title: name of the product.
        width_mm, depth_mm, height_mm: printing space along x, y, z.
        exclude_mm: rectangle of the bed on which nothing may be printed; ``None`` for most.
        nozzle_mm: diameter of the nozzle.
        retract_mm: filament drawn back before a move without printing: about 0.8 with a direct drive, 5 through a
            Bowden tube.
        levelling: G-code lines that probe the bed.
        end: G-code lines after the print.
        prusa_printer, prusa_print: names of the presets in PrusaSlicer, empty where it has none.
        orca_printer, orca_process: the same in OrcaSlicer and Bambu Studio.
        orca_filament: name of their presets of plain filaments, with ``*`` where PLA, PETG or TPU stands.
        provenance: where the numbers come from.
    """

    name: str
    title: str
    width_mm: float
    depth_mm: float
    height_mm: float
    exclude_mm: Rectangle | None
    nozzle_mm: float
    retract_mm: float
    levelling: tuple[str, ...]
    end: tuple[str, ...]
    prusa_printer: str
    prusa_print: str
    orca_printer: str
    orca_process: str
    orca_filament: str
    provenance: str

    @property
    def middle_mm(self) -> tuple[float, float]:
        """Middle of the bed."""
        return self.width_mm / 2, self.depth_mm / 2

    @property
    def corners(self) -> tuple[str, str, str, str]:
        """Corners of the bed as slicers write them."""
        w, d = f"{self.width_mm:g}", f"{self.depth_mm:g}"
        return "0x0", f"{w}x0", f"{w}x{d}", f"0x{d}"

    @property
    def excluded_corners(self) -> list[str]:
        """Corners of what is excluded, as slicers write them; none where nothing is."""
        return [f"{x:g}x{y:g}" for x, y in corners(self.exclude_mm)] if self.exclude_mm else []

    @property
    def prusa_presets(self) -> dict[str, str]:
        """Names of the presets by the keys of PrusaSlicer; none where it has none."""
        ids = {"printer_settings_id": self.prusa_printer, "print_settings_id": self.prusa_print}
        return {key: name for key, name in ids.items() if name}

    @property
    def size(self) -> str:
        """The printing space in words."""
        return f"{self.width_mm:g} x {self.depth_mm:g} x {self.height_mm:g} mm"

    def start_gcode(self, nozzle_c: int, bed_c: int) -> str:
        r"""Lines before a print, joined by ``\n`` as slicers keep them: home, level, heat, fill the nozzle."""
        lines = ["G90", "M83", f"M140 S{bed_c}", f"M104 S{PROBE_C}", f"M190 S{bed_c}", f"M109 R{PROBE_C}", "G28"]
        begin, end = (self.depth_mm / 2 + side * PURGE_MM / 2 for side in (-1, 1))
        heat = ["G1 Z5 F720", f"G1 X{PURGE_X_MM:g} Y{begin:g} F6000", f"M109 S{nozzle_c}"]  # there drips harm nothing
        fill = ["G1 Z0.3 F720", f"G1 Y{end:g} E{PURGE_FILAMENT_MM:g} F600", f"G1 Y{end + WIPE_MM:g} F6000", "G92 E0"]
        return "\\n".join([*lines, *self.levelling, *heat, *fill])

    @property
    def end_gcode(self) -> str:
        r"""Lines after a print, joined by ``\n``: the nozzle, still hot, is lifted off the part before all else."""
        return "\\n".join(self.end)

    def takes(self, points: np.ndarray) -> bool:
        """Whether a part fits in some turn about the vertical.

        Args:
            points: (n, 3) its corners in the printing pose, mm.
        """
        return fitting_turn_deg(points, self) is not None


@cache
def printers() -> dict[str, Printer]:
    """The table, name -> printer.

    Raises:
        FileError: a missing or unreadable table, naming the line.
    """
    return read_table(PRINTER_TABLE, _printer)


def printer(name: str = DEFAULT_PRINTER) -> Printer:
    """One printer by its name, in upper or lower case.

    Raises:
        ParameterError: unknown; the message has the nearest names, and all.
    """
    table = printers()
    return table[chosen("printer", name, table, f"fab/slice/{PRINTER_TABLE.name}")]


def printer_words(name: str) -> str:
    """The option that names a printer, with a space before it, as it follows a command; empty for the default."""
    return "" if name == DEFAULT_PRINTER else f" {printer_option(name)}"


def fitting_turn_deg(points: np.ndarray, where: Printer) -> float | None:
    """Rotation about the vertical in which a part fits a bed with its margin, deg, 0 if possible; ``None`` if none.

    Args:
        points: (n, 3) its corners in the printing pose, mm.
        where: the printer.
    """
    room = np.array([where.width_mm, where.depth_mm]) - 2 * MARGIN_MM
    if room.min() <= 0 or float(np.ptp(points[:, 2])) > where.height_mm:
        return None
    flat = _flat(points, where)
    best, best_fill = None, 1.0 + 1e-9
    for degrees in _turns(where):
        spun = turned(flat, degrees)
        fill = float((np.ptp(spun, axis=0) / room).max())
        if fill > best_fill or _beside_excluded_mm(spun, where) < 0:
            continue
        if degrees % 90 == 0:
            return float(degrees)
        if fill < best_fill:
            best, best_fill = float(degrees), fill
    return best


def room_left_mm(points: np.ndarray, where: Printer) -> float:
    """Least gap between a part with its margin and the printing space in its best rotation, mm; negative: too large.

    Args:
        points: (n, 3) its corners in the printing pose, mm.
        where: the printer.
    """
    room, flat = np.array([where.width_mm, where.depth_mm]) - 2 * MARGIN_MM, _flat(points, where)
    spun = [turned(flat, degrees) for degrees in _turns(where)]
    across = max(min(float((room - np.ptp(one, axis=0)).min()), _beside_excluded_mm(one, where)) for one in spun)
    return min(across, where.height_mm - float(np.ptp(points[:, 2])))


def _turns(where: Printer) -> tuple[int, ...]:
    """Rotations to try, deg, right angles first; those over 180 differ only where a corner is excluded."""
    square, last = ((0, 90, 180, 270), 360) if where.exclude_mm else ((0, 90), 180)
    return (*square, *(d for d in range(1, last) if d % 90))


def _flat(points: np.ndarray, where: Printer) -> np.ndarray:
    """Points (n, 2) of a part seen from above, or their convex hull where it is compared with an excluded rectangle."""
    return outline(points[:, :2]) if where.exclude_mm else points[:, :2]


def _beside_excluded_mm(hull: np.ndarray, where: Printer) -> float:
    """Gap between the margin of a part in mid-bed and the excluded rectangle, mm; infinite where none is."""
    if where.exclude_mm is None:
        return math.inf
    middle = (hull.min(axis=0) + hull.max(axis=0)) / 2
    return gap_mm(hull - middle + np.array(where.middle_mm), where.exclude_mm) - MARGIN_MM


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """Points rotated about the origin.

    Args:
        points: (n, 2), mm.
        degrees: of the rotation, counter-clockwise.
    """
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def fitting_printers(parts: Mapping[str, np.ndarray]) -> list[Printer]:
    """Printers that take every part, the smallest bed first.

    Args:
        parts: name -> corners (n, 3) in the printing pose.
    """
    by_bed = sorted(printers().values(), key=lambda p: (p.width_mm * p.depth_mm, p.height_mm))
    return [p for p in by_bed if all(p.takes(points) for points in parts.values())]


def require_bed(parts: Mapping[str, np.ndarray], where: Printer) -> None:
    """Refuse a printer whose bed is too small.

    Args:
        parts: name -> corners (n, 3) in the printing pose.
        where: the printer.

    Raises:
        ParameterError: names the parts that do not fit, their sizes, and the smallest printer that takes all.
    """
    large = {name: points for name, points in parts.items() if not where.takes(points)}
    if not large:
        return
    words = ", ".join(f"{name} ({' x '.join(f'{v:.0f}' for v in np.ptp(p, axis=0))} mm)" for name, p in large.items())
    fits = next(iter(fitting_printers(parts)), None)
    remedy = (
        f"the smallest that takes every part is {printer_option(fits.name)} ({fits.title}, {fits.size})"
        if fits
        else "none of the table takes every part: choose a smaller D"
    )
    raise ParameterError(
        f"printer={where.name}: {words} as printed, over the {where.size} of its bed{_less(where)} with "
        f"{MARGIN_MM:g} mm round each part: {remedy}",
        name="printer",
        value=where.name,
    )


def _less(where: Printer) -> str:
    """The excluded rectangle in words."""
    if where.exclude_mm is None:
        return ""
    low_x, low_y, high_x, high_y = where.exclude_mm
    return f" less x {low_x:g} to {high_x:g}, y {low_y:g} to {high_y:g}"


def _printer(row: dict[str, str]) -> Printer:
    width, depth, height, nozzle = (positive(row, f"{n}_mm") for n in ("width", "depth", "height", "nozzle"))
    for side, length in (("width", width), ("depth", depth)):
        if length <= 2 * MARGIN_MM:
            raise ValueError(
                f"{side}_mm={length:g} is not over {2 * MARGIN_MM:g}: {MARGIN_MM:g} mm stay free round each part, so "
                "this bed takes none; write the bed's side in mm"
            )
    if not NOZZLE_RANGE_MM[0] <= nozzle <= NOZZLE_RANGE_MM[1]:
        low, high = NOZZLE_RANGE_MM
        raise ValueError(
            f"nozzle_mm={nozzle:g} outside {low:g}..{high:g}: walls and gyroid are printed in lines of 0.45 mm; fit a "
            "nozzle of 0.4"
        )
    levelling, end = (tuple(line for line in row[name].split("|") if line) for name in ("levelling", "end"))
    return Printer(
        row["name"],
        row["title"],
        width,
        depth,
        height,
        read_rectangle(row["exclude"]),
        nozzle,
        positive(row, "retract_mm"),
        levelling,
        end,
        row["prusa_printer"],
        row["prusa_print"],
        row["orca_printer"],
        row["orca_process"],
        row["orca_filament"],
        row["provenance"],
    )
