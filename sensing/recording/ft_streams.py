"""Force/torque sensors as streams of samples: an ATI NetFT over UDP, and a CSV file.

    with NetFt("192.168.1.1") as stream:
        for sample in stream.arrived():
            sample.time_s, sample.wrench                  # monotonic seconds; N and N m in the sensor's own axes

Notes:
    NetFT raw data transfer (ATI Net F/T manual 9620-05-NET FT, "UDP interface using RDT"): a request of 8 bytes
    (0x1234, command 2 to stream or 0 to stop, count 0 for ever) to port 49152; replies of 36 bytes (RDT sequence,
    F/T sequence, status, then six signed counts), all big endian. Counts per N and N m are those of the unit's
    configuration page, one million by default. F/T sequence counts at the unit's own rate: sample times follow it,
    fitted to the arrivals, so that network jitter does not shift them.
"""

from __future__ import annotations

import contextlib
import csv
import socket
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad.errors import EndcapError, FileError, ParameterError

PORT = 49152
REQUEST, REPLY = struct.Struct(">HHI"), struct.Struct(">III6i")
MAGIC, STREAM, STOP = 0x1234, 2, 0
COUNTS = 1e6  # per N and per N m
BUFFER_BYTES = 1 << 22  # a slow frame must not cost samples
RATE_HZ = 7000.0  # of the unit's internal sequence, as delivered
CSV_COLUMNS = ("time_s", "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm")
EARLIEST_SHARE = 0.001  # by which the clock fit creeps forward a sample, so that drift is followed


class StreamError(EndcapError):
    """A force/torque stream that ended, is silent, or reports an error."""


@dataclass(frozen=True)
class FtSample:
    """One reading: monotonic seconds, (6,) N and N m in the sensor's own axes, status word (0 when all is well)."""

    time_s: float
    wrench: NDArray[np.float64]
    status: int = 0


class NetFt:
    """An ATI NetFT that streams while the context is open.

    Args:
        host, port: of the unit. counts_per_n, counts_per_nm: of its configuration. rate_hz: of its F/T sequence.
        timeout_s: silence after which the unit counts as gone. clock: monotonic seconds.

    Raises:
        StreamError: the unit cannot be reached.
    """

    def __init__(
        self, host: str, port: int = PORT, counts_per_n: float = COUNTS, counts_per_nm: float = COUNTS,
        rate_hz: float = RATE_HZ, timeout_s: float = 2.0, clock: Callable[[], float] = time.monotonic,
    ) -> None:  # fmt: skip
        for name, value in (("counts_per_n", counts_per_n), ("counts_per_nm", counts_per_nm), ("rate_hz", rate_hz)):
            if not 0 < value < np.inf:
                raise ParameterError(f"{name}={value:g}: must be positive, see the unit's page", name=name, value=value)
        self.name = f"netft {host}:{port}"
        self._address, self._timeout_s, self._clock, self._rate_hz = (host, port), timeout_s, clock, rate_hz
        self._counts = np.array([counts_per_n] * 3 + [counts_per_nm] * 3)
        self._socket: socket.socket | None = None
        self._offset_s: float | None = None
        self._heard_s = 0.0
        self._first: int | None = None
        self.faulty = 0

    def __enter__(self) -> NetFt:
        try:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._socket.connect(self._address)  # so that only this unit's packets are taken
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
            self._socket.send(REQUEST.pack(MAGIC, STREAM, 0))
        except OSError as error:
            raise StreamError(f"{self.name}: {error.strerror or error}: check address and network") from None
        self._heard_s = self._clock()
        return self

    def __exit__(self, *_: object) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):  # it is gone already
                self._socket.send(REQUEST.pack(MAGIC, STOP, 0))
            self._socket.close()

    def arrived(self) -> Iterator[FtSample]:
        """The samples that have arrived since the last call; packets of another size are counted and dropped.

        Raises:
            StreamError: nothing for ``timeout_s``.
        """
        assert self._socket is not None
        while True:
            try:
                data = self._socket.recv(4096)
            except BlockingIOError:
                break
            except OSError as error:
                raise StreamError(f"{self.name}: {error.strerror or error}: is the unit on?") from None
            now = self._clock()
            if len(data) != REPLY.size:
                self.faulty += 1
                continue
            self._heard_s = now
            _, sequence, status, *counts = REPLY.unpack(data)
            yield FtSample(self._stamped(sequence, now), np.array(counts) / self._counts, status)
        if self._clock() - self._heard_s > self._timeout_s:
            raise StreamError(f"{self.name}: silent for {self._timeout_s:g} s: check power, cable and firewall")

    def _stamped(self, sequence: int, now: float) -> float:
        """Arrival time without the network's jitter: the earliest packet was delayed least."""
        if self._first is None:
            self._first = sequence
        ticks = ((sequence - self._first) & 0xFFFFFFFF) / self._rate_hz
        late = now - ticks
        if self._offset_s is None or late < self._offset_s:
            self._offset_s = late
        self._offset_s += EARLIEST_SHARE * (late - self._offset_s)
        return ticks + self._offset_s


class CsvFt:
    """A file with the columns :data:`CSV_COLUMNS`, times on the clock of the frames; all of it has arrived at once.

    Raises:
        FileError: missing, without one of the columns, or with a row that is not finite numbers.
    """

    def __init__(self, path: str | Path) -> None:
        self.name, self.faulty = str(path), 0
        try:
            with Path(path).open(newline="", encoding="utf-8") as stream:
                reader = csv.DictReader(stream)
                missing = set(CSV_COLUMNS) - set(reader.fieldnames or ())
                if missing:
                    raise FileError(f"{path}: no column {', '.join(sorted(missing))}: needs {', '.join(CSV_COLUMNS)}")
                rows = [self._numbers(row, number) for number, row in enumerate(reader, 2)]
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise FileError(f"{path}: cannot read ({error}): give a CSV file of force/torque samples") from error
        self._rows = rows

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
            values = np.array([float(row[name]) for name in CSV_COLUMNS])
        except (TypeError, ValueError):
            values = np.full(7, np.nan)
        if not np.isfinite(values).all():
            raise FileError(f"{self.name} line {line}: not seven finite numbers: mend or drop the row")
        return values
