"""Recording: synchronisation in closed form, a NetFT stand-in on loopback, resume, refusals, training on the result."""

import contextlib
import io
import json
import socket
import struct
import threading
import time

import cv2
import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing import record
from sensing.frames import FtMount
from sensing.recording.folder import Recording
from sensing.recording.ft_streams import CSV_COLUMNS, CsvFt, FtSample, NetFt, StreamError
from sensing.recording.progress import Progress
from sensing.recording.sequence_clock import RateError, SequenceClock
from sensing.recording.synchronise import ClockError, Synchroniser
from sensing.records import Frame
from sensing.records_labelled import LabelledSet
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image

PATIENCE_S = 60.0


class Unit(threading.Thread):
    """What a NetFT does on its UDP port, written from the public protocol: waits for the request, then streams."""

    def __init__(self, count=400, step_s=0.002, silent=False, status=0, delay_s=0.0, gain=1.0, per_packet=10):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE_S)
        self.port = self.socket.getsockname()[1]
        self.count, self.step_s, self.silent, self.heard = count, step_s, silent, []
        self.status, self.delay_s, self.gain, self.per_packet = status, delay_s, gain, per_packet
        self.sent = 0

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
                counts = [int(1e6 * self.gain * v) for v in (0.1 * number, -2.0, 3.0, 0.01, 0.02, -0.03)]
                ticks = self.per_packet * number
                self.sent = number
                self.socket.sendto(struct.pack(">III6i", number, ticks, self.status, *counts), who)
                time.sleep(self.step_s)
        with contextlib.suppress(OSError):
            self.heard.append(struct.unpack(">HHI", self.socket.recvfrom(64)[0]))


def test_netft_streams_in_its_own_units_and_is_reported_to_stop(monkeypatch):
    stamps, stamp = [], SequenceClock.stamp
    monkeypatch.setattr(SequenceClock, "stamp", lambda *call: stamps.append((*call[1:], stamp(*call))) or stamps[-1][2])
    unit = Unit(count=60)
    stream, samples = first_samples(unit, 60, rate_hz=5000.0, delay_s=0.0, clock=unit.clock)
    assert stream.faulty == 1
    unit.join(PATIENCE_S)
    assert unit.heard == [(0x1234, 2, 0), (0x1234, 0, 0)]
    assert np.allclose(samples[30].wrench, [3.0, -2.0, 3.0, 0.01, 0.02, -0.03])
    counts, came, given = map(np.array, zip(*stamps, strict=True))
    assert counts.tolist() == [10 * k for k in range(60)]  # what the unit counts, not the packets
    assert [s.time_s for s in samples] == given.tolist()  # the unit's own clock, tested below, not the arrival
    assert (np.diff(came) >= 0).all() and (given <= came).all() and came[-1] <= unit.clock()


def arrivals(rate_hz, seconds=20.0, packets_hz=500.0, late_s=0.004, drift=0.0, seed=1):
    """(counts, sampling times, arrivals) of a sensor whose packets wait for a random while on their way."""
    rng = np.random.default_rng(seed)
    taken = 1000.0 + np.arange(int(seconds * packets_hz)) / packets_hz
    counts = np.rint((taken - taken[0]) * rate_hz * (1 + drift)).astype(int)
    return counts, taken, taken + rng.exponential(late_s, len(taken))


@pytest.mark.parametrize("rate_hz", [7000.0, 1000.0, 500.0])
@pytest.mark.parametrize("given", [False, True], ids=["found_out", "given"])
def test_sampling_times_follow_what_the_sensor_counts(rate_hz, given):
    counts, taken, came = arrivals(rate_hz)
    clock = SequenceClock(rate_hz if given else None)
    times = np.array([clock.stamp(int(c) + 4294960000, t) for c, t in zip(counts, came, strict=True)])  # it wraps
    off = times - taken
    assert np.abs(off[1000:]).max() < 1e-3 and np.abs(off).max() < 0.05  # 7000 Hz for a sensor of 500: 18 s
    assert np.std(off[1000:]) < 0.05 * np.std(came - taken)
    assert clock.rate_hz == pytest.approx(rate_hz, rel=1e-3)


def test_a_clock_that_drifts_is_followed_and_one_that_begins_anew_too():
    counts, taken, came = arrivals(1000.0, seconds=400.0, packets_hz=50.0, drift=1e-4)
    counts[10000:] = counts[10000:] - counts[10000] + 10_000_000  # switched off and on: seen by the step
    clock = SequenceClock()
    off = np.array([clock.stamp(int(c), t) for c, t in zip(counts, came, strict=True)]) - taken
    assert np.abs(off[100:10000]).max() < 2e-3 and np.abs(off[10100:]).max() < 2e-3


def test_a_rate_that_is_not_the_sensors_is_refused():
    counts, _, came = arrivals(1000.0, seconds=4.0)
    clock = SequenceClock(7000.0)
    with pytest.raises(RateError, match="counts 1000 times a second, not 7000: leave --ft-rate out"):
        for c, t in zip(counts, came, strict=True):
            clock.stamp(int(c), t)


def first_samples(unit, count=20, **options):
    unit.start()
    samples, end = [], time.monotonic() + PATIENCE_S
    with NetFt("127.0.0.1", unit.port, **{"timeout_s": PATIENCE_S} | options) as stream:
        while len(samples) < count and time.monotonic() < end:
            samples += stream.arrived()
            time.sleep(0.003)
    return stream, samples


def test_half_the_answer_time_is_taken_for_the_delay_unless_it_is_known():
    begin_s = time.monotonic()
    stream, _ = first_samples(Unit(count=30, delay_s=0.082))
    took_s = time.monotonic() - begin_s
    assert 0.041 <= stream._times.delay_s < took_s / 2 and "ms on the way" in stream.note
    stream, _ = first_samples(Unit(count=30, delay_s=0.082), delay_s=0.01)
    assert stream._times.delay_s == 0.01
    with pytest.raises(ParameterError, match="delay_s=3"):
        NetFt("127.0.0.1", delay_s=3)


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


def test_progress_says_what_is_waited_for():
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    progress = Progress(30, Terminal())
    assert "waiting for the first picture" in progress.line()
    progress.frames = 4
    assert "4 pictures, waiting for the force sensor" in progress.line()
    progress.samples, progress.rest = 9, 3
    assert "leave it untouched: 3 of 30 pictures" in progress.line()
    progress.rest, progress.written, progress.force_n, progress.waiting = 30, 7, 3.25, 2
    assert "7 frames written, 3.2 N, 2 wait for their force" in progress.line()
    with progress:
        end = time.monotonic() + PATIENCE_S
        while not progress._stream.getvalue() and time.monotonic() < end:
            time.sleep(0.05)
    assert "7 frames written" in progress._stream.getvalue() and progress._stream.getvalue().endswith("\n")
    with Progress(30, io.StringIO()) as quiet:
        assert not quiet._thread.is_alive()


def test_a_recording_without_a_pair_is_no_success(pressed, tmp_path, capsys):
    folder, mount = tmp_path / "pictures", tmp_path / "mount.json"
    folder.mkdir()
    for k in range(3):
        (folder / f"{k}.jpg").write_bytes(pressed[0][k].jpeg)
    mount.write_text(json.dumps({"T_endcap_ft": np.eye(4).tolist(), "reads": 1}))
    csv = tmp_path / "late.csv"
    csv.write_text(",".join(CSV_COLUMNS) + "\n500,0,0,0,0,0,0\n")
    arguments = ["--source", str(folder), "--ft-csv", str(csv), "--mount", str(mount), "--out", str(tmp_path / "set")]
    assert record.main(arguments) == 1
    assert "do frames and forces have the same clock?" in capsys.readouterr().err


def test_a_silent_or_absent_unit_is_reported_in_one_line():
    unit = Unit(silent=True)
    unit.start()
    with NetFt("127.0.0.1", unit.port, timeout_s=0.05) as stream:
        time.sleep(0.1)
        with pytest.raises(StreamError, match=r"silent for 0\.05 s"):
            list(stream.arrived())
    with pytest.raises(ParameterError, match="counts_per_n=0"):
        NetFt("127.0.0.1", counts_per_n=0)


def test_pairs_are_interpolated_within_the_slop_only():
    sync = Synchroniser(0.05)
    for k in range(11):
        sync.add(FtSample(0.02 * k, np.full(6, 2.0 * k)))
    assert np.allclose(sync.at(0.05), 5.0)  # a straight line is exact
    assert np.allclose(sync.at(0.1), 10.0)
    assert sync.covers(0.2) and not sync.covers(0.21)
    assert sync.at(0.21) is None  # nothing after it yet
    sync.add(FtSample(0.5, np.full(6, 50.0)))
    assert sync.at(0.3) is None  # neighbours further than the slop
    sync.add(FtSample(0.48, np.full(6, 48.0)))  # out of order, within the slop: taken
    assert np.allclose(sync.at(0.49), 49.0)
    with pytest.raises(ParameterError, match="slop_s=5"):
        Synchroniser(5.0)


@pytest.mark.parametrize("jump", [-3.0, 2.0, np.nan, np.inf])
def test_clock_jumps_are_refused(jump):
    sync = Synchroniser()
    sync.add(FtSample(100.0, np.zeros(6)))
    with pytest.raises(ClockError, match="clock"):
        sync.add(FtSample(100.0 + jump, np.zeros(6)))
    sync.at(100.0)
    with pytest.raises(ClockError, match="frame"):
        sync.at(100.0 + (jump if jump < 0 or not np.isfinite(jump) else 11.0))


@pytest.fixture(scope="module")
def pressed():
    """(frames, forces): a picture whose dots shift with the force, three presses after a rest."""
    image = draw_dots(Drawing())[0]
    frames, forces = [], []
    for k in range(76):
        press = max(0.0, np.sin((k - 40) / 12 * 2 * np.pi)) if k >= 40 else 0.0
        force = np.array([3.0 * press, 1.0 * press, -8.0 * press])
        bump = Bump((320.0, 240.0), (0.8 * force[0], 0.8 * force[1]), 90.0)
        picture = warp_image(image, Displacement((0.0, 0.0), -0.004 * force[2], bumps=(bump,))) if press else image
        frames.append(Frame(k / 30, k, "made", jpeg=cv2.imencode(".jpg", picture)[1].tobytes()))
        forces.append(force)
    return frames, np.array(forces)


def write_csv(path, forces, tare=0.0):  # four samples a frame, one of them at its time
    times = np.arange(4 * len(forces)) / 120
    rows = [",".join(CSV_COLUMNS)]
    for t in times:
        f = [np.interp(t * 30, np.arange(len(forces)), forces[:, axis]) + tare for axis in range(3)]
        rows.append(",".join(f"{v:.9f}" for v in (t, *f, 0.0, 0.0, 0.0)))
    path.write_text("\n".join(rows) + "\n")
    return path


MOUNT = FtMount(np.eye(4), 1)


def test_recording_pairs_tares_parts_paths_and_goes_on(pressed, tmp_path):
    frames, forces = pressed
    csv = write_csv(tmp_path / "ft.csv", forces, tare=5.0)
    with Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT) as recording:
        result = record.record(frames, CsvFt(csv), recording)
    assert (result.written, result.unpaired) == (46, 0)
    data = LabelledSet(tmp_path / "set")
    items = list(data.frames())
    assert np.abs(np.array([i.wrench.force_n for i in items]) - forces[30:]).max() < 1e-5  # tare gone, interpolated
    assert sorted({i.path for i in items}) == [0, 1, 2, 3] and items[0].phase == "recorded"
    assert items[0].frame.jpeg == frames[30].jpeg
    seed = data.manifest["request"]["seed"]
    again = Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)
    record.record(frames, CsvFt(csv), again)
    more = LabelledSet(tmp_path / "set")
    assert more.manifest["request"]["seed"] == seed and set(more.column("path")) == set(range(8))
    with pytest.raises(FileError, match="another recording is writing"):
        Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)
    again.close()
    with pytest.raises(FileError, match="holds a set with wall_mm"):
        Recording(tmp_path / "set", EndcapParams(130, 10), MOUNT)
    assert not list((tmp_path / "set").rglob("*.part"))


def test_a_clock_jump_keeps_what_was_paired(pressed, tmp_path):
    frames, forces = pressed
    jumped = [*frames[:60], Frame(1.0, 60, "made", jpeg=frames[60].jpeg), *frames[61:]]
    csv = write_csv(tmp_path / "ft.csv", forces)
    with pytest.raises(ClockError, match=r"frame at 1\.000 s"):
        record.record(jumped, CsvFt(csv), Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT))
    assert len(list(LabelledSet(tmp_path / "set").frames())) == 30


def test_bad_input_is_one_line(tmp_path, capsys):
    mount = tmp_path / "mount.json"
    mount.write_text(json.dumps({"T_endcap_ft": np.eye(4).tolist(), "reads": 1}))
    bad = tmp_path / "bad.csv"
    bad.write_text(",".join(CSV_COLUMNS) + "\n0,1,2,3,4,5\n")
    picture = tmp_path / "p.jpg"
    cv2.imwrite(str(picture), np.zeros((48, 64, 3), np.uint8))
    base = ["--source", str(picture), "--out", str(tmp_path / "set")]
    for more, said in (
        (["--ft-csv", str(bad), "--mount", str(mount)], "line 2: not seven finite numbers"),
        (["--ft-csv", str(tmp_path / "none"), "--mount", str(mount)], "cannot read"),
        (["--ft-csv", str(bad), "--mount", str(bad)], "not seven"),
        (["--netft", "127.0.0.1", "--mount", str(bad)], "no mounting"),
    ):
        assert record.main([*base, *more]) == 2
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1


def test_a_recording_trains(pressed, tmp_path, capsys):
    pytest.importorskip("torch")
    from sensing import train

    frames, forces = pressed
    csv = write_csv(tmp_path / "ft.csv", forces)
    record.record(frames, CsvFt(csv), Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT))
    arguments = [str(tmp_path / "set"), "--method", "dots", "--out", str(tmp_path / "w.safetensors"), "--epochs", "3"]
    assert train.main(arguments) == 0
    assert "46 frames of 4 paths" in capsys.readouterr().out
    assert train.main([str(tmp_path / "set"), "--out", str(tmp_path / "w2")]) == 2
    assert "give --method dots" in capsys.readouterr().err
