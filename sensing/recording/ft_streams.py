"""Force/torque sensors as streams of samples: an ATI NetFT over UDP, and a CSV file.

    with NetFt("192.168.1.1") as stream:
        for sample in stream.arrived():
            sample.time_s, sample.wrench                  # monotonic seconds; N and N m in the sensor's own axes

Notes:
    NetFT raw data transfer (ATI Net F/T manual 9620-05-NET FT, "UDP interface using RDT"): a request of 8 bytes
    (0x1234, command 2 to stream or 0 to stop, count 0 for ever) to port 49152; replies of 36 bytes (RDT sequence,
    F/T sequence, status, then six signed counts), all big endian. Counts per N and N m are those of the unit's
    configuration page, one million by default. What the F/T sequence counts differs between units (internal ticks, or
    the samples sent), so its rate is found out: :mod:`sensing.recording.sequence_clock`. Samples with an error in the
    status word (manual, "System status code") are dropped and counted.

    How long a sample was on its way cannot be seen from its arrival. Half the time between the request and the first
    reply is taken for it, which is exact where both ways take equally long and the unit answers at once; ``delay_s``
    sets it where it is known better.
"""

from __future__ import annotations

import contextlib
import csv
import socket
import struct
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError, FileError, ParameterError
from cad.plain_numbers import stored_number
from sensing.recording.sequence_clock import SequenceClock

PORT, MOST_PORT = 49152, 65535
REQUEST, REPLY = struct.Struct(">HHI"), struct.Struct(">III6i")
MAGIC, STREAM, STOP = 0x1234, 2, 0
COUNTS = 1e6  # per N and per N m
READ_S = 0.02  # E: longest that samples are read which came after reading began
BUFFER_BYTES = 1 << 22  # a slow frame must not cost samples
CSV_COLUMNS = ("time_s", "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm")
MOST_N, MOST_NM = 2000.0, 200.0  # E: beyond what any endcap survives; counts per N that are wrong give such numbers
IGNORED_STATUS = 1 << 16  # a threshold that the user has set on the unit's page was crossed
STATUS_WORDS = {  # bits of the system status code
    30: "CPU or RAM", 29: "digital board", 28: "analog board", 27: "serial link", 26: "program memory",
    25: "configuration", 24: "settings", 23: "settings do not fit the calibration", 22: "network", 17: "saturated",
}  # fmt: skip
SO_TIMESTAMPING, RX_SOFTWARE = 37, 0b11000  # Linux: the kernel stamps a packet's arrival, however late it is read
STAMPS_FROM_S = 0.05  # E: after which it does; the first reply gives the delay, so it must have a stamp


class StreamError(EndcapError):
    """A force/torque stream that ended, is silent, or reports an error."""


@dataclass(frozen=True)
class FtSample:
    """One reading: monotonic seconds, (6,) N and N m in the sensor's own axes."""

    time_s: float
    wrench: NDArray[np.float64]


class NetFt:
    """An ATI NetFT that streams while the context is open.

    Args:
        host, port: of the unit.
        counts_per_n, counts_per_nm: of its configuration.
        rate_hz: of its F/T sequence; None to find it out.
        delay_s: of a sample on its way; None to take half the answer time.
        timeout_s: silence after which the unit counts as gone.
        clock: monotonic seconds.

    Attributes:
        faulty: packets of another size, and samples with an error.
        errors: samples by what the unit said was wrong.

    Raises:
        StreamError: the unit cannot be reached.
    """

    def __init__(
        self, host: str, port: int = PORT, counts_per_n: float = COUNTS, counts_per_nm: float = COUNTS,
        rate_hz: float | None = None, delay_s: float | None = None, timeout_s: float = 2.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        for name, value in (("counts_per_n", counts_per_n), ("counts_per_nm", counts_per_nm), ("rate_hz", rate_hz)):
            if value is not None and not 0 < value < np.inf:
                raise ParameterError(f"{name}={value:g}: must be positive, see the unit's page", name=name, value=value)
        self.name = f"netft {host}:{port}"
        if delay_s is not None and not 0 <= delay_s <= 1:
            raise ParameterError(f"delay_s={delay_s:g} outside 0..1 s", name="delay_s", value=delay_s)
        if not 1 <= port <= MOST_PORT:
            raise ParameterError(f"port={port} outside 1..{MOST_PORT}: the NetFT's is {PORT}", name="port", value=port)
        self._address, self._timeout_s, self._clock = (host, port), timeout_s, clock
        self._times, self._delay_s, self._rate_hz = SequenceClock(rate_hz, delay_s or 0.0), delay_s, rate_hz
        self._counts = np.array([counts_per_n] * 3 + [counts_per_nm] * 3)
        self._socket: socket.socket | None = None
        self._asked_s, self._heard_s, self._good_s = 0.0, 0.0, 0.0
        self._first: tuple[int, int] | None = None
        self._stands = False
        self._kernel_stamps = False
        self.faulty = 0
        self.errors: Counter[str] = Counter()

    def __enter__(self) -> NetFt:
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.connect(self._address)  # so that only this unit's packets are taken
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            with contextlib.suppress(OSError):  # elsewhere than on Linux, a packet counts as come when it is read
                self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, RX_SOFTWARE)
                self._kernel_stamps = self._clock is time.monotonic
                time.sleep(STAMPS_FROM_S)
            self._asked_s = self._clock()
            self._socket.send(REQUEST.pack(MAGIC, STREAM, 0))
        except (OSError, UnicodeError) as error:  # UnicodeError: a name that no host can have
            self.__exit__()
            said = error.strerror if isinstance(error, OSError) else None
            raise StreamError(f"{self.name}: {said or error}: check address and network") from None
        self._heard_s = self._good_s = self._clock()
        return self

    def __exit__(self, *_: object) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # it is gone already
                self._socket.send(REQUEST.pack(MAGIC, STOP, 0))
            self._socket.close()

    @property
    def note(self) -> str:
        """Measured rate and delay, and errors that the unit reported."""
        rate = self._times.rate_hz
        said = f"{self.name}: {'unknown' if rate is None else f'{rate:.0f}'} counts a second, "
        said += f"{1e3 * self._times.delay_s:.1f} ms on the way"
        wrong = ", ".join(f"{count} samples: {word}" for word, count in self.errors.most_common())
        return said + (f"; dropped {wrong}" if wrong else "")

    def arrived(self) -> Iterator[FtSample]:
        """The samples that have arrived since the last call; packets of another size are counted and dropped.

        It ends with what came :data:`READ_S` after it began: a unit that sends faster than this computer reads must
        not hold it for ever.

        Raises:
            StreamError: nothing, or nothing but errors, for ``timeout_s``; a force that cannot be.
            RateError: the rate that was given is not that of the unit.
        """
        assert self._socket is not None
        end_s = (came_s := self._clock()) + READ_S
        while came_s <= end_s and (packet := self._receive()) is not None:
            data, came_s = packet
            if len(data) != REPLY.size:
                self.faulty += 1
                continue
            self._heard_s = came_s
            sent, sequence, status, *counts = REPLY.unpack(data)
            if status & ~IGNORED_STATUS:
                self._complain(status)
                continue
            self._good_s = came_s
            wrench = np.array(counts) / self._counts
            _require_possible(self.name, wrench, "are the counts per N and N m those of the unit's page?", StreamError)
            yield FtSample(self._stamped(sent, sequence, came_s), wrench)
        now = self._clock()
        if now - self._heard_s > self._timeout_s:
            raise StreamError(f"{self.name}: silent for {self._timeout_s:g} s: check power, cable and firewall")
        if now - self._good_s > self._timeout_s:
            said = ", ".join(self.errors)
            raise StreamError(
                f"{self.name}: nothing but errors for {self._timeout_s:g} s ({said}): see the unit's page"
            )

    def _receive(self) -> tuple[bytes, float] | None:
        """(packet, when it came); None if none is there.

        The kernel begins to stamp a moment after it was asked to. When a packet without a stamp came is not known, so
        it is left out: read late it would count as long on its way, and all samples with it.
        """
        assert self._socket is not None
        while True:
            try:
                data, extra, _, _ = self._socket.recvmsg(4096, 128)
            except BlockingIOError:
                return None
            except OSError as error:
                raise StreamError(f"{self.name}: {error.strerror or error}: is the unit on?") from None
            now = self._clock()
            if not self._kernel_stamps:
                return data, now
            for level, kind, content in extra:
                if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPING):
                    seconds, nanoseconds = struct.unpack_from("qq", content)
                    waited = time.time() - seconds - nanoseconds * 1e-9
                    return data, now - (waited if 0 <= waited < self._timeout_s else 0.0)

    def _complain(self, status: int) -> None:
        self.faulty += 1
        words = [word for bit, word in STATUS_WORDS.items() if status >> bit & 1]
        self.errors[" and ".join(words) or f"status {status:#010x}"] += 1

    def _stamped(self, sent: int, sequence: int, came_s: float) -> float:
        """When a sample was taken; a unit whose F/T sequence stands still is followed by its count of packets."""
        if self._first is None:
            self._first = sent, sequence
            if self._delay_s is None:
                self._times.delay_s = max(0.0, min(came_s - self._asked_s, self._timeout_s)) / 2
        stands = sequence == self._first[1] and sent != self._first[0]
        if stands and not self._stands:  # packets are counted from another number than that at which it stands
            self._times = SequenceClock(self._rate_hz, self._times.delay_s)
        self._stands = stands
        return self._times.stamp(sent if stands else sequence, came_s)


class CsvFt:
    """A file with the columns :data:`CSV_COLUMNS`, times on the clock of the frames; all of it has arrived at once.

    Comma-separated UTF-8, with or without the byte-order mark that Excel writes; one line of names, then one sample a
    line: ``time_s`` in s, ``fx_n``, ``fy_n``, ``fz_n`` in N, ``tx_nm``, ``ty_nm``, ``tz_nm`` in N m, in the sensor's
    own axes. Other columns are ignored; their order is free.

    Raises:
        FileError: missing, empty, without one of the columns or with one twice, or with a row that is not finite or
            possible numbers.
    """

    def __init__(self, path: str | Path) -> None:
        self.name, self.faulty = str(path), 0
        try:
            with Path(path).open(newline="", encoding="utf-8-sig") as stream:
                reader = csv.DictReader(stream)
                _require_columns(path, list(reader.fieldnames or ()))
                rows = [self._numbers(row, number) for number, row in enumerate(reader, 2)]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            said = getattr(error, "strerror", None) or error  # without the path, which stands before it
            raise FileError(f"{path}: cannot read ({said}): give a CSV file of force/torque samples") from error
        if not rows:
            raise FileError(f"{path}: no sample in it: record the sensor, or give another file")
        self._rows = rows

    @property
    def note(self) -> str:
        """Nothing to send."""
        return ""

    def __enter__(self) -> CsvFt:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def arrived(self) -> Iterator[FtSample]:
        """All samples, once."""
        rows, self._rows = self._rows, []
        for row in rows:
            yield FtSample(float(row[0]), row[1:])

    def _numbers(self, row: dict[str, str], line: int) -> NDArray[np.float64]:
        try:
            values = np.array([stored_number(row[name]) for name in CSV_COLUMNS])
        except ParameterError as error:
            said = f"not seven finite numbers ({error})"
            raise FileError(f"{self.name} line {line}: {said}: fix or drop the row") from None
        _require_possible(f"{self.name} line {line}", values[1:], "is it in N and N m?", FileError)
        return values


def _require_columns(path: str | Path, names: list[str]) -> None:
    """Each column once: of two of a name, one would be taken without a word."""
    missing = [name for name in CSV_COLUMNS if name not in names]
    twice = [name for name in CSV_COLUMNS if names.count(name) > 1]
    if missing or twice:
        said = f"no column {', '.join(missing)}" if missing else f"more than one column {', '.join(twice)}"
        raise FileError(f"{path}: {said}: needs {', '.join(CSV_COLUMNS)}, each once, separated by commas")


def _require_possible(place: str, wrench: NDArray[np.float64], question: str, kind: type[EndcapError]) -> None:
    """No force or torque that would have destroyed the endcap: it is a wrong unit."""
    for name, value, most in zip(CSV_COLUMNS[1:], wrench, [MOST_N] * 3 + [MOST_NM] * 3, strict=True):
        if abs(value) > most:
            raise kind(f"{place}: {name}={value:.6g} outside {-most:g}..{most:g}: {question}")
