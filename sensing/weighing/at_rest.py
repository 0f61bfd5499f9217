"""The reading of an endcap that stands still under a load, out of a stream of readings.

    watch = RestWatch(); watch.add(reading) ...; watch.pressed()        # the interval to average, or a WeighingError

An interval counts as rest if its two halves agree and its scatter is small. Silicone creeps for seconds after a load,
so the last of several intervals is taken. N, s.

A few dots that look otherwise than in the reference (``dots_disturbed``) are no reason for a refusal: a level table
presses the tip, where dots mirror the lamp and the reflection moves away. At D=107 T=7.3 in Dragon Skin 30 that flagged
every one of five rendered sensors at half of the range, and the answers were as good as those without the flag.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sensing.live.core.gate import DISTURBED, OF_THE_MODEL, disturbed_dots, torn_row
from sensing.live.core.mixed_watch import FLAG as MIXED
from sensing.live.core.reading import EndcapReading
from sensing.weighing.gain import WeighingError

# Advice by flag of a reading.
HINTS = {
    "camera_misfit": "the camera is not where the design has it; run python -m sensing.calibrate first",
    "dots_missing": "too few dots are in the reference; free and wipe lens and dome, then zero again",
    "moved": "camera or lens have moved since the reference; zero again",
    "out_of_range": "weights have not learned such a contact, by its load, place or shape; press the tip with a flat "
    "plate and 15 to 70 % of the range that endcap train prints",
    "zeroed_under_load": "the reference was taken while something pressed; zero again",
}
Array = NDArray[np.float64]
STILL_S = 1.0  # length of an interval at rest
LEAST_READINGS = 5  # fewest readings in such an interval
# Largest difference of the halves, and largest standard deviation: in N at D=130 T=8, or part of the load if larger.
MOVED_N, MOVED_PART = 0.05, 0.01
SCATTER_N, SCATTER_PART = 0.15, 0.02
MOST_FLAGGED = 0.05  # part of the readings that may be flagged
MOST_DISTURBED = 0.1  # E: part of the dots that may look otherwise; up to 0.06 by reflections on five rendered sensors


@dataclass(frozen=True)
class Rest:
    """Averages of an interval at rest.

    Attributes:
        wrench: (6,) median estimate, endcap frame, N and N m.
        covariance: (6, 6) covariance of a single estimate: errors repeat, so averaging does not reduce it.
        moved_n: difference of its halves, N.
        readings: number of readings.
        disturbed: largest number of dots in a reading that looked otherwise than in the reference.
        untouched_n: force of the untouched endcap that was subtracted, N; NaN where none was.
    """

    wrench: Array
    covariance: Array
    moved_n: float
    readings: int
    disturbed: int = 0
    untouched_n: float = float("nan")

    @property
    def note(self) -> str:
        """What else is to be known of it, for the end of a line; else empty."""
        said = []
        if self.untouched_n == self.untouched_n:
            said.append(f"; {self.untouched_n:.2f} N of the untouched endcap taken out")
        if self.disturbed:
            said.append(f"; {self.disturbed} dot(s) look otherwise than untouched: reflections of the lamp, or dirt")
        return "".join(said)

    def less(self, untouched: Rest) -> Rest:
        """This interval minus the reading of the untouched endcap: lamp, mounting or own weight since the reference."""
        left_n = float(np.linalg.norm(untouched.wrench[:3]))
        return replace(self, wrench=self.wrench - untouched.wrench, untouched_n=left_n)


@dataclass(frozen=True)
class _Row:
    time_s: float
    wrench: Array
    covariance: Array
    touching: bool
    flags: frozenset[str]
    reason: str
    disturbed: int = 0


class RestWatch:
    """Keeps the readings of one pose, and finds intervals at rest in them.

    Args:
        load_scale: scale of the endcap's forces (:mod:`sensing.wrench.load_scale`).

    Attributes:
        largest_n: largest force so far, N.
    """

    def __init__(self, load_scale: float = 1.0) -> None:
        self._load_scale = load_scale
        self._rows: list[_Row] = []
        self._blind = ""
        self.largest_n = 0.0

    def add(self, reading: EndcapReading) -> None:
        """Add a reading; of one without numbers only the reason is kept."""
        if not reading.valid:
            self._blind = reading.reason
            return
        estimate = reading.estimate
        wrench = np.concatenate([estimate.force_n, estimate.torque_nm])
        flags = estimate.flags - {MIXED}  # such pictures show a load that stands still as it is
        disturbed = self._few_disturbed(reading, flags)
        row = _Row(
            estimate.time_s,
            wrench,
            np.array(estimate.covariance),
            reading.contact.touching,
            flags - {DISTURBED} if disturbed else flags,
            reading.reason,
            disturbed,
        )
        self._rows.append(row)
        self.largest_n = max(self.largest_n, float(np.linalg.norm(estimate.force_n)))

    def newest(self) -> tuple[float, float]:
        """(newest force, its change within the last interval), N; NaN before the first interval."""
        rows = self._window(len(self._rows))
        if not rows:
            return float("nan"), float("nan")
        rest = _rest(rows)
        return float(np.linalg.norm(rest.wrench[:3])), rest.moved_n

    def untouched(self, again: str = "start again") -> Rest:
        """The newest interval, which must be without load.

        Args:
            again: how the endcap is zeroed again, in words or as a command.

        Raises:
            WeighingError: the endcap carries a load, or no interval is at rest.
        """
        rows = self._window(len(self._rows))
        if not rows:
            raise WeighingError(self._nothing())
        if any(row.touching for row in rows):
            flags = ", ".join(sorted(rows[-1].flags))
            raise WeighingError(
                f"{np.linalg.norm(rows[-1].wrench[:3]):#.2g} N{flags and f' ({flags})'} while it should be untouched: "
                f"let it go; or, if nothing touches it, zero it again: {again}"
            )
        return _rest(rows)

    def pressed(self) -> Rest:
        """The last interval at rest under a load.

        Raises:
            WeighingError: there is none, with the reason: no contact, flagged readings, or nothing that stands still.
        """
        return _rest(self._pressed()[0])

    def loaded(self) -> Rest:
        """The same, less what the untouched endcap read just before it, where it stood still for so long.

        Raises:
            WeighingError: as :meth:`pressed`.
        """
        pressed, begin = self._pressed()
        for end in range(begin, 0, -1):
            rows = self._window(end)
            if rows and not any(row.touching for row in rows) and _few_flagged(rows):
                untouched = _rest(rows)
                if _still(rows, untouched, self._load_scale):
                    return _rest(pressed).less(untouched)
        return _rest(pressed)

    def _pressed(self) -> tuple[list[_Row], int]:
        """Rows of the last interval at rest under a load, and the number of the first of them."""
        if not self._rows:
            raise WeighingError(self._nothing())
        touching = [k for k, row in enumerate(self._rows) if row.touching]
        if not touching:
            raise WeighingError(self._no_contact())
        flagged, least = None, float("inf")
        for end in range(touching[-1] + 1, 0, -1):
            rows = self._window(end)
            if not rows or not all(row.touching for row in rows):
                continue
            rest = _rest(rows)
            if _still(rows, rest, self._load_scale):
                if _few_flagged(rows):
                    return rows, end - len(rows)
                flagged = flagged or next(row for row in reversed(rows) if row.flags)
            least = min(least, rest.moved_n)
        if flagged is not None:
            names, hint = ", ".join(sorted(flagged.flags)), _hint(flagged, "see docs/live_faults.md")
            force_n = float(np.linalg.norm(flagged.wrench[:3]))
            raise WeighingError(f"the readings under the load, {force_n:#.3g} N, are flagged ({names}): {hint}")
        if least < float("inf"):
            raise WeighingError(
                f"not at rest: the force moves by {least:.2f} N or more within {STILL_S:g} s; let it stand still"
            )
        raise WeighingError(
            f"the load lasts for less than {STILL_S:g} s or {LEAST_READINGS} pictures (a folder has 30 a "
            "second): leave it on for longer"
        )

    def _few_disturbed(self, reading: EndcapReading, flags: frozenset[str]) -> int:
        """Number of dots that look otherwise than in the reference, where they are few and nothing else is wrong; 0."""
        estimate, tracks = reading.estimate, reading.tracks
        if tracks is None or flags != {DISTURBED} or torn_row(tracks):
            return 0
        count = int(disturbed_dots(tracks, estimate.force_n, self._load_scale).sum())
        return count if count <= MOST_DISTURBED * len(tracks.ids) else 0

    def _window(self, end: int) -> list[_Row]:
        """The rows of one interval that ends before row ``end``; empty where it is too short."""
        if end == 0:
            return []
        begin, last_s = end - 1, self._rows[end - 1].time_s
        while begin > 0 and last_s - self._rows[begin].time_s < STILL_S:
            begin -= 1
        rows = self._rows[begin:end]
        long_enough = last_s - rows[0].time_s >= STILL_S * (1 - 1e-6)
        return rows if long_enough and len(rows) >= LEAST_READINGS else []

    def _no_contact(self) -> str:
        largest = max(self._rows, key=lambda row: float(np.linalg.norm(row.wrench[:3])))
        if largest.flags:
            names = ", ".join(sorted(largest.flags))
            hint = _hint(largest, "are these pictures of this endcap, under a weight?")
            return f"no reading counts as a contact; the largest, {self.largest_n:.2f} N, is flagged ({names}): {hint}"
        return f"no contact: the largest force is {self.largest_n:.2f} N; does the weight stand on the dome?"

    def _nothing(self) -> str:
        if self._blind:
            return f"no reading that counts: {self._blind}"
        return f"fewer than {LEAST_READINGS} readings within {STILL_S:g} s: does the camera run?"


def _rest(rows: list[_Row]) -> Rest:
    forces = np.array([row.wrench for row in rows])
    half = len(rows) // 2
    moved = forces[half:, :3].mean(axis=0) - forces[:half, :3].mean(axis=0)
    covariance = np.mean([row.covariance for row in rows], axis=0)
    disturbed = max(row.disturbed for row in rows)
    return Rest(np.median(forces, axis=0), covariance, float(np.linalg.norm(moved)), len(rows), disturbed)


def _hint(row: _Row, otherwise: str) -> str:
    """Why a reading is flagged and what to do; that the model flags it says neither."""
    if row.reason and not row.reason.startswith(OF_THE_MODEL):
        return row.reason
    return HINTS.get(", ".join(sorted(row.flags)), row.reason or otherwise)


def _few_flagged(rows: list[_Row]) -> bool:
    return sum(bool(row.flags) for row in rows) <= MOST_FLAGGED * len(rows)


def _still(rows: list[_Row], rest: Rest, load_scale: float = 1.0) -> bool:
    force = float(np.linalg.norm(rest.wrench[:3]))
    scatter = float(np.array([row.wrench[:3] for row in rows]).std(axis=0).max())
    moved_n, scatter_n = load_scale * MOVED_N, load_scale * SCATTER_N
    return rest.moved_n <= max(moved_n, MOVED_PART * force) and scatter <= max(scatter_n, SCATTER_PART * force)
