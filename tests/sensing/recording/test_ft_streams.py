"""Force/torque streams: a NetFT stand-in on loopback, sampling times, files, refusals."""

import contextlib
import socket
import struct
import threading
import time
from itertools import islice

import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from sensing.recording.ft_streams import CSV_COLUMNS, REPLY, CsvFt, NetFt, StreamError
from sensing.recording.sequence_clock import SequenceClock

PATIENCE_S = 60.0


class Unit(threading.Thread):
    """What a NetFT does on its UDP port, written from the public protocol: waits for the request, then streams."""

    def __init__(
        self, count=400, step_s=0.002, silent=False, status=0, delay_s=0.0, gain=1.0, per_packet=10, per_nm=1e6
    ):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE_S)
        self.port = self.socket.getsockname()[1]
        self.count, self.step_s, self.silent, self.heard = count, step_s, silent, []
        self.status, self.delay_s, self.gain, self.per_packet = status, delay_s, gain, per_packet
        self.sent, self.per_nm = 0, per_nm

    def clock(self):
        """Seconds as the unit's own packets count them, however slow this computer is."""
        return 1000.0 + self.step_s * self.sent

    def run(self):
        request, who = self.socket.recvfrom(64)
        self.heard.append(struct.unpack(">HHI", request))
        time.sleep(self.delay_s)
        if not self.silent:
            self.socket.sendto(b"junk", who)
            for number in range(self.count):
                counts = [int(1e6 * self.gain * v) for v in (0.1 * number, -2.0, 3.0)]
                counts += [int(self.per_nm * self.gain * v) for v in (0.01, 0.02, -0.03)]
                ticks = self.per_packet * number
                self.sent = number
                self.socket.sendto(struct.pack(">III6i", number, ticks, self.status, *counts), who)
                time.sleep(self.step_s)
        with contextlib.suppress(OSError):
            self.heard.append(struct.unpack(">HHI", self.socket.recvfrom(64)[0]))


def test_netft_streams_in_its_own_units_and_is_reported_to_stop(monkeypatch):
    stamps, stamp = [], SequenceClock.stamp
    monkeypatch.setattr(SequenceClock, "stamp", lambda *call: stamps.append((*call[1:], stamp(*call))) or stamps[-1][2])
    unit = Unit(count=60, per_nm=2e7)  # a torque has other counts than a force on many units
    stream, samples = first_samples(
        unit, 60, rate_hz=5000.0, delay_s=0.0, clock=unit.clock, counts_per_nm=2e7
    )  # fmt: skip
    assert stream.faulty == 1
    unit.join(PATIENCE_S)
    assert unit.heard == [(0x1234, 2, 0), (0x1234, 0, 0)]
    assert np.allclose(samples[30].wrench, [3.0, -2.0, 3.0, 0.01, 0.02, -0.03])
    counts, came, given = map(np.array, zip(*stamps, strict=True))
    assert counts.tolist() == [10 * k for k in range(60)]  # what the unit counts, not the packets
    assert [s.time_s for s in samples] == given.tolist()  # the unit's own clock, tested below, not the arrival
    assert (np.diff(came) >= 0).all() and (given <= came).all() and came[-1] <= unit.clock()


def first_samples(unit, count=20, **options):
    unit.start()
    samples, end = [], time.monotonic() + PATIENCE_S
    with NetFt("127.0.0.1", unit.port, **{"timeout_s": PATIENCE_S} | options) as stream:
        while len(samples) < count and time.monotonic() < end:
            samples += stream.arrived()
            time.sleep(0.003)
    return stream, samples


class StampLess:
    """A socket whose ``recvmsg`` is another function of the real one."""

    def __init__(self, real, recvmsg):
        self.real, self._recvmsg = real, recvmsg

    def __getattr__(self, name):
        return getattr(self.real, name)

    def recvmsg(self, *sizes):
        return self._recvmsg(self.real, *sizes)


def test_packets_that_are_read_late_are_stamped_when_they_came():
    """The kernel says when: a slow frame must not shift the labels."""
    unit = Unit(count=60)
    unit.start()
    with NetFt("127.0.0.1", unit.port, delay_s=0.0, timeout_s=PATIENCE_S) as stream:
        end_s = time.monotonic() + PATIENCE_S
        while unit.sent < 59 and time.monotonic() < end_s:
            time.sleep(0.01)
        sent_s = time.monotonic()
        time.sleep(0.5)
        samples = list(stream.arrived())
    assert len(samples) == 60 and max(sample.time_s for sample in samples) < sent_s + 0.1


def test_a_first_packet_without_a_stamp_does_not_count_as_long_on_its_way(monkeypatch):
    """The kernel begins to stamp a moment after it was asked to; packets of that moment are read without."""
    received, real = [], socket.socket.recvmsg

    def without_first_stamps(self, *sizes):
        data, extra, *rest = real(self, *sizes)
        received.append(data)
        return data, [] if len(received) < 4 else extra, *rest

    unit = Unit(count=60)
    unit.start()
    with NetFt("127.0.0.1", unit.port, timeout_s=PATIENCE_S) as stream:
        monkeypatch.setattr(stream, "_socket", StampLess(stream._socket, without_first_stamps))
        end_s = time.monotonic() + PATIENCE_S
        while unit.sent < 59 and time.monotonic() < end_s:
            time.sleep(0.01)
        time.sleep(1.0)
        samples = list(stream.arrived())
    assert len(samples) == 58 and samples[0].wrench[0] == pytest.approx(0.2)  # of 60 and one of another size
    assert stream._times.delay_s < 0.2 and (np.diff([s.time_s for s in samples]) > -0.05).all()


def test_half_the_answer_time_is_taken_for_the_delay_unless_it_is_known():
    begin_s = time.monotonic()
    stream, _ = first_samples(Unit(count=30, delay_s=0.082))
    took_s = time.monotonic() - begin_s
    assert 0.041 <= stream._times.delay_s < took_s / 2 and "ms on the way" in stream.note
    stream, _ = first_samples(Unit(count=30, delay_s=0.082), delay_s=0.01)
    assert stream._times.delay_s == 0.01
    stream = NetFt("127.0.0.1")
    stream._asked_s = 10.0
    stream._stamped(0, 0, 10.08)
    assert stream._times.delay_s == pytest.approx(0.04)
    with pytest.raises(ParameterError, match="delay_s=3"):
        NetFt("127.0.0.1", delay_s=3)


def test_a_unit_that_sends_faster_than_it_is_read_does_not_hold_the_reader(monkeypatch):
    now = [10.0]
    stream = NetFt("127.0.0.1", 49152, clock=lambda: now[0])
    with stream:

        def packet():
            now[0] += 1e-3  # one comes while the one before is read
            return REPLY.pack(0, round(1e3 * now[0]), 0, 0, 0, 0, 0, 0, 0), now[0]

        monkeypatch.setattr(stream, "_receive", packet)
        assert 20 <= len(list(islice(stream.arrived(), 100))) <= 22


def test_samples_with_an_error_are_dropped_and_the_error_named():
    with pytest.raises(StreamError, match=r"nothing but errors for 0\.2 s \(saturated\)"):
        first_samples(unit := Unit(status=0x80020000), timeout_s=0.2, clock=unit.clock)
    stream, samples = first_samples(Unit(count=30, status=0x80010000 & ~(1 << 31)))  # a threshold was crossed: no error
    assert len(samples) >= 20 and stream.faulty == 1  # the junk


def test_forces_that_cannot_be_are_refused(tmp_path):
    with pytest.raises(StreamError, match=r"fy_n=-20000 outside -2000\.\.2000: are the counts"):
        first_samples(Unit(), counts_per_n=100.0)
    path = tmp_path / "big.csv"
    path.write_text(",".join(CSV_COLUMNS) + "\n0,0,0,20000,0,0,0\n")
    with pytest.raises(FileError, match=r"line 2: fz_n=20000 outside -2000\.\.2000"):
        CsvFt(path)
    path.write_text(",".join(CSV_COLUMNS) + "\n0,0,0,2,0,0,-300\n")
    with pytest.raises(FileError, match=r"tz_nm=-300 outside -200\.\.200"):
        CsvFt(path)


def test_a_file_of_excel_is_read_and_an_empty_one_refused(tmp_path):
    path = tmp_path / "excel.csv"
    path.write_bytes(b"\xef\xbb\xbf" + (",".join(CSV_COLUMNS) + "\r\n0.5,1,2,3,4,5,6\r\n").encode())
    (sample,) = CsvFt(path).arrived()
    assert sample.time_s == 0.5 and sample.wrench.tolist() == [1, 2, 3, 4, 5, 6]
    for text, said in ((",".join(CSV_COLUMNS) + "\n", "no sample in it"), ("", "no column time_s"),
                       (";".join(CSV_COLUMNS) + "\n1;2;3;4;5;6;7\n", "separated by commas")):  # fmt: skip
        path.write_text(text)
        with pytest.raises(FileError, match=said):
            CsvFt(path)


def test_a_silent_or_absent_unit_is_reported_in_one_line():
    unit = Unit(silent=True)
    unit.start()
    with NetFt("127.0.0.1", unit.port, timeout_s=0.05) as stream:
        time.sleep(0.1)
        with pytest.raises(StreamError, match=r"silent for 0\.05 s"):
            list(stream.arrived())
    with pytest.raises(ParameterError, match="counts_per_n=0"):
        NetFt("127.0.0.1", counts_per_n=0)


@pytest.mark.parametrize("port", [-1, 0, 65536, 99999])
def test_a_port_that_no_unit_has_is_refused(port):
    with pytest.raises(ParameterError, match=f"port={port} outside 1..65535"):
        NetFt("127.0.0.1", port)


def test_a_host_that_no_network_names_is_reported():
    stream = NetFt("a." * 200)
    with pytest.raises(StreamError, match="check address and network"), stream:
        pass
    assert stream._socket.fileno() == -1  # closed


@pytest.mark.parametrize("text", ["\u0663", "nan", "1_0", "inf"])
def test_samples_are_decimal_numbers_as_programs_write_them(tmp_path, text):
    path = tmp_path / "ft.csv"
    path.write_text(",".join(CSV_COLUMNS) + f"\n0,1e-05,0,-2.5E+00,0,0,0\n0.1,0,{text},0,0,0,0\n", encoding="utf-8")
    with pytest.raises(FileError, match="line 3: not seven finite numbers"):
        CsvFt(path)
    path.write_text(path.read_text(encoding="utf-8").replace(text, "0"), encoding="utf-8")
    assert next(CsvFt(path).arrived()).wrench[:3].tolist() == [1e-5, 0, -2.5]


def test_a_column_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "ft.csv"
    path.write_text(",".join([*CSV_COLUMNS, "time_s"]) + "\n0,0,0,0,0,0,0,9\n")
    with pytest.raises(FileError, match="more than one column time_s"):
        CsvFt(path)


def test_a_file_that_is_not_there_is_named_once(tmp_path):
    path = tmp_path / "none.csv"
    with pytest.raises(FileError) as refused:
        CsvFt(path)
    assert str(refused.value).startswith(f"{path}: cannot read (No such file or directory): give")
    assert "Errno" not in str(refused.value)
