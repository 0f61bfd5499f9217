"""Reader of G-code as a printer runs it: each extruding move with its volume, independent of the slicer's summary.

Millimetres, millimetres of filament, seconds; plate coordinates. Understood are the moves G0 and G1, relative and
absolute positions and filament (G90, G91, M82, M83, G92), and PrusaSlicer's comments ``;LAYER_CHANGE``, ``;Z:``,
``;TYPE:``, ``;WIDTH:`` and ``;HEIGHT:``. Arcs (G2, G3) are refused: their volume would be lost.

Notes:
    The trailer repeats the settings of the part, never those of its volumes; the moves alone show how a volume is
    filled.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cad.errors import FileError
from fab.slice.settings import FILAMENT_DIAMETER_MM, LAYER_MM, LINE_MM

NOT_PART = ("Skirt/Brim", "Support material", "Support material interface", "Custom", "Wipe tower")
_AREA_MM2 = math.pi / 4 * FILAMENT_DIAMETER_MM**2
_TIME = re.compile(r"; estimated printing time \(normal mode\) = (?:(\d+)d )?(?:(\d+)h )?(?:(\d+)m )?(\d+)s")
_GRAMS = re.compile(r"; filament used \[g\] = ([\d.]+)")


@dataclass(frozen=True)
class Moves:
    """The extruding moves of a print, n of them.

    Attributes:
        start, end: (n, 2) plate coordinates, mm.
        top_mm: (n,) height of the nozzle: the top of the line.
        height_mm: (n,) height of the line.
        width_mm: (n,) width of the line.
        volume_mm3: (n,) extruded volume.
        layer: (n,) number of the layer, from 0; -1 for moves of the start, before all layers.
        path: (n,) number of the unbroken line that the move belongs to.
        kind: (n,) index into ``kinds``.
        kinds: the slicer's names, for example ``External perimeter``.
        layer_tops_mm: height of every layer that was announced, with or without moves.
        piece: (n,) index into ``pieces``, -1 for moves of no part, such as brim and start.
        pieces: names of the parts on the plate, as the slicer marks them.
        slicer_time_s: printing time as the slicer estimates it, with accelerations.
        slicer_grams: grams as the slicer states them; NaN where it does not.
    """

    start: np.ndarray
    end: np.ndarray
    top_mm: np.ndarray
    height_mm: np.ndarray
    width_mm: np.ndarray
    volume_mm3: np.ndarray
    layer: np.ndarray
    path: np.ndarray
    kind: np.ndarray
    kinds: tuple[str, ...]
    layer_tops_mm: np.ndarray
    piece: np.ndarray
    pieces: tuple[str, ...]
    slicer_time_s: float
    slicer_grams: float

    @property
    def length_mm(self) -> np.ndarray:
        """(n,) lengths."""
        return np.linalg.norm(self.end - self.start, axis=1)

    def piece_shares(self) -> dict[str, float]:
        """Fraction of the plastic in each part of the plate; brims are divided in proportion."""
        volumes = {name: float(self.volume_mm3[self.piece == number].sum()) for number, name in enumerate(self.pieces)}
        total = sum(volumes.values())
        return {name: volume / total for name, volume in volumes.items()} if total else {}

    @property
    def is_part(self) -> np.ndarray:
        """(n,) whether a move belongs to a part, and not to brim or support."""
        other = [index for index, name in enumerate(self.kinds) if name in NOT_PART]
        return ~np.isin(self.kind, other)

    @property
    def printed(self) -> Moves:
        """The moves of all layers, without what fills the nozzle before the first."""
        return self.pick(self.layer >= 0)

    def pick(self, mask: np.ndarray) -> Moves:
        """Some of the moves.

        Args:
            mask: (n,) whether a move is kept.
        """
        columns = ("start", "end", "top_mm", "height_mm", "width_mm", "volume_mm3", "layer", "path", "kind", "piece")
        return replace(self, **{name: getattr(self, name)[mask] for name in columns})

    def points(self, spacing_mm: float) -> tuple[np.ndarray, np.ndarray]:
        """Points along the moves, both ends included.

        Args:
            spacing_mm: largest distance between two points of a move.

        Returns:
            ``(points (m, 2), move number (m,))``.
        """
        counts = np.maximum(1, np.ceil(self.length_mm / spacing_mm).astype(int)) + 1
        move = np.repeat(np.arange(len(counts)), counts)
        rank = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        share = (rank / (counts[move] - 1))[:, None]
        return self.start[move] * (1 - share) + self.end[move] * share, move


def read_gcode(path: Path) -> Moves:
    """Read the extruding moves of a file.

    Args:
        path: of the G-code.

    Raises:
        FileError: the file cannot be read, has arcs, or extrudes nothing.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror}): slice the part again") from error
    reader = _Reader(path.name)
    for line in text.splitlines():
        reader.line(line)
    if not reader.rows:
        raise FileError(f"{path.name}: no move extrudes: the slicer found nothing to print; check the project's meshes")
    return reader.moves(_seconds(text), float(found[1]) if (found := _GRAMS.search(text)) else math.nan)


class _Reader:
    """State of a printer that runs G-code, and the rows of moves so far."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.rows: list[tuple[float, ...]] = []
        self.kinds: dict[str, int] = {}
        self.tops: list[float] = []
        self.x = self.y = self.z = self.e = 0.0
        self.is_relative = self.is_filament_relative = False
        self.width, self.height = LINE_MM, LAYER_MM
        self.layer, self.path, self.kind = -1, 0, self._kind("Custom")
        self.pieces: dict[str, int] = {}
        self.piece = -1

    def line(self, line: str) -> None:
        """Process one line: move, change of state, or comment of the slicer.

        Args:
            line: of the file.

        Raises:
            FileError: the line is an arc (G2, G3).
        """
        if line.startswith(("G1 ", "G0 ")):
            self._move(line)
        elif line.startswith(("; printing object", "; stop printing object")):
            self._label(line)
        elif line.startswith(";"):
            self._comment(line)
        elif line[:3] in ("G90", "G91"):
            self.is_relative = line[:3] == "G91"
        elif line[:3] in ("M82", "M83"):
            self.is_filament_relative = line[:3] == "M83"
        elif line[:3] == "G92":
            self.e = 0.0
        elif line[:3] in ("G2 ", "G3 "):
            raise FileError(f"{self.name}: has arcs (G2, G3), which are not read: switch arc fitting off in the slicer")

    def moves(self, time_s: float, grams: float) -> Moves:
        """The rows as columns.

        Args:
            time_s: printing time as the slicer estimates it.
            grams: of plastic as the slicer states them.
        """
        table = np.array(self.rows)
        return Moves(
            table[:, 0:2], table[:, 2:4], table[:, 4], table[:, 5], table[:, 6], table[:, 7] * _AREA_MM2,
            table[:, 8].astype(int), table[:, 9].astype(int), table[:, 10].astype(int),
            tuple(self.kinds), np.array(self.tops), table[:, 11].astype(int), tuple(self.pieces), time_s, grams,
        )  # fmt: skip

    def _move(self, line: str) -> None:
        x, y, z, pushed = self.x, self.y, self.z, 0.0
        for word in line.split(";", 1)[0].split()[1:]:
            letter, value = word[0], word[1:]
            if letter == "X":
                x = float(value) + (x if self.is_relative else 0.0)
            elif letter == "Y":
                y = float(value) + (y if self.is_relative else 0.0)
            elif letter == "Z":
                z = float(value) + (z if self.is_relative else 0.0)
            elif letter == "E":
                pushed = float(value) - (0.0 if self.is_filament_relative else self.e)
                self.e += pushed
        moved = x != self.x or y != self.y
        if pushed > 0 and moved:
            state = (self.width, pushed, self.layer, self.path, self.kind, self.piece)
            self.rows.append((self.x, self.y, x, y, z, self.height, *state))
        elif moved or pushed or z != self.z:  # a change of speed alone does not break a line
            self.path += 1
        self.x, self.y, self.z = x, y, z

    def _comment(self, line: str) -> None:
        if line.startswith(";WIDTH:"):
            self.width = float(line[7:])
        elif line.startswith(";TYPE:"):
            self.kind = self._kind(line[6:])
        elif line.startswith(";HEIGHT:"):
            self.height = float(line[8:])
        elif line.startswith(";LAYER_CHANGE"):
            self.layer += 1
            self.path += 1
        elif line.startswith(";Z:"):
            self.tops.append(float(line[3:]))

    def _label(self, line: str) -> None:
        """Process the mark of a part's begin or end: ``; printing object NAME id:0 copy 0``."""
        found = re.match(r"; printing object (.+?) id:\d+ copy \d+", line)
        self.piece = self.pieces.setdefault(found[1], len(self.pieces)) if found else -1

    def _kind(self, name: str) -> int:
        return self.kinds.setdefault(name, len(self.kinds))


def _seconds(text: str) -> float:
    found = _TIME.search(text)
    if not found:
        return math.nan
    days, hours, minutes, seconds = (int(part or 0) for part in found.groups())
    return ((days * 24 + hours) * 60 + minutes) * 60.0 + seconds
