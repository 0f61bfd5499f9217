"""Printers: rows of ``printers.csv`` with bed, nozzle, how they level, and the names of their presets in both slicers.

Millimetres. The start is home, level, heat; the printer's own preset may do more (purge, resonance, flow), and is the
better start where the slicer has it: the projects carry its name.
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

PRINTER_TABLE = Path(__file__).with_name("printers.csv")
DEFAULT_PRINTER = "generic256"
MARGIN_MM = 4.0  # round the part: brim and the width of a line
PROBE_C = 170  # E: of the nozzle while it probes: warm, and nothing drips


@dataclass(frozen=True)
class Printer:
    """One row.

    Attributes:
        name: as typed, for example ``mk4``.
        title: what it is called.
        width_mm, depth_mm, height_mm: printing space along x, y, z.
        nozzle_mm: diameter of the nozzle.
        levelling: G-code lines that probe the bed.
        end: G-code lines after the print.
        prusa_printer, prusa_print: names of the presets in PrusaSlicer, empty where it has none.
        orca_printer, orca_process: the same in OrcaSlicer and Bambu Studio.
        provenance: where the numbers come from.
    """

    name: str
    title: str
    width_mm: float
    depth_mm: float
    height_mm: float
    nozzle_mm: float
    levelling: tuple[str, ...]
    end: tuple[str, ...]
    prusa_printer: str
    prusa_print: str
    orca_printer: str
    orca_process: str
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
    def size(self) -> str:
        """The printing space in words."""
        return f"{self.width_mm:g} x {self.depth_mm:g} x {self.height_mm:g} mm"

    def start_gcode(self, nozzle_c: int, bed_c: int) -> str:
        r"""Lines before a print, joined by ``\n`` as slicers keep them: home, level, heat."""
        lines = ["G90", "M83", f"M140 S{bed_c}", f"M104 S{PROBE_C}", f"M190 S{bed_c}", f"M109 R{PROBE_C}", "G28"]
        return "\\n".join([*lines, *self.levelling, "G1 Z5 F720", f"M109 S{nozzle_c}", "G92 E0"])

    @property
    def end_gcode(self) -> str:
        r"""Lines after a print, joined by ``\n``; all moves of them are relative to nothing but home."""
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
    """One printer by its name.

    Raises:
        ParameterError: unknown; the message lists those in the table.
    """
    table = printers()
    if name not in table:
        raise ParameterError(
            f"printer={name} is not in fab/slice/{PRINTER_TABLE.name}: choose one of {', '.join(table)}, or add a row",
            name="printer",
            value=name,
        )
    return table[name]


def printer_words(name: str) -> str:
    """The option that names a printer, with a space before it, as it follows a command; empty for the default."""
    return "" if name == DEFAULT_PRINTER else f" printer={name}"


def fitting_turn_deg(points: np.ndarray, where: Printer) -> float | None:
    """Turn about the vertical in which a part lies on a bed with its margin, none if it can be; ``None``: it does not.

    Args:
        points: (n, 3) its corners in the printing pose, mm.
        where: the printer.
    """
    room = np.array([where.width_mm, where.depth_mm]) - 2 * MARGIN_MM
    if float(np.ptp(points[:, 2])) > where.height_mm:
        return None
    best, best_fill = None, 1.0 + 1e-9
    for degrees in (0, 90, *(d for d in range(1, 180) if d != 90)):
        size = np.ptp(turned(points[:, :2], degrees), axis=0)
        fill = float((size / room).max())
        if fill <= best_fill and degrees in (0, 90):
            return float(degrees)
        if fill < best_fill:
            best, best_fill = float(degrees), fill
    return best


def room_left_mm(points: np.ndarray, where: Printer) -> float:
    """Least room between a part with its margin and what the printer reaches, in its best turn; below 0 too little.

    Args:
        points: (n, 3) its corners in the printing pose, mm.
        where: the printer.
    """
    room = np.array([where.width_mm, where.depth_mm]) - 2 * MARGIN_MM
    across = max(float((room - np.ptp(turned(points[:, :2], angle), axis=0)).min()) for angle in range(180))
    return min(across, where.height_mm - float(np.ptp(points[:, 2])))


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """Points (n, 2), turned about the origin."""
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
        f"the smallest that takes every part is printer={fits.name} ({fits.title}, {fits.size})"
        if fits
        else "none of the table takes every part: choose a smaller D"
    )
    raise ParameterError(
        f"printer={where.name}: {words} as printed, over the {where.size} of its bed with {MARGIN_MM:g} mm round each "
        f"part: {remedy}",
        name="printer",
        value=where.name,
    )


def _printer(row: dict[str, str]) -> Printer:
    width, depth, height, nozzle = (positive(row, f"{n}_mm") for n in ("width", "depth", "height", "nozzle"))
    levelling, end = (tuple(line for line in row[name].split("|") if line) for name in ("levelling", "end"))
    return Printer(
        row["name"],
        row["title"],
        width,
        depth,
        height,
        nozzle,
        levelling,
        end,
        row["prusa_printer"],
        row["prusa_print"],
        row["orca_printer"],
        row["orca_process"],
        row["provenance"],
    )
