"""Recording: synchronisation in closed form, resume, refusals, training on the result."""

import io
import json
import time
from contextlib import nullcontext

import cv2
import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from cad.params import EndcapParams
from sensing import record
from sensing.frames import FtMount
from sensing.recording.folder import Recording
from sensing.recording.ft_streams import CSV_COLUMNS, CsvFt, FtSample
from sensing.recording.progress import Progress
from sensing.recording.synchronise import ClockError, Synchroniser
from sensing.records import Frame
from sensing.records_labelled import LabelledSet
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, warp_image
from sensing.tracking.zero import single_zero, take_zero

PATIENCE_S, MOUNT = 60.0, FtMount(np.eye(4), 1)


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
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("more", [["--rest", "0"], ["--rest", "-1"], ["--frames", "-1"], ["--slop", "5"]])
def test_numbers_that_make_no_recording_leave_nothing(pressed, tmp_path, capsys, more):
    """Without untouched frames there was neither reference nor tare, and a set was written all the same."""
    (tmp_path / "0.jpg").write_bytes(pressed[0][0].jpeg)
    (tmp_path / "mount.json").write_text(json.dumps({"T_endcap_ft": np.eye(4).tolist(), "reads": 1}))
    csv = write_csv(tmp_path / "ft.csv", pressed[1])
    base = ["--source", str(tmp_path / "0.jpg"), "--ft-csv", str(csv), "--mount", str(tmp_path / "mount.json")]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    for folder in ("new", "mine"):
        assert record.main([*base, "--out", str(tmp_path / folder), *more]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "new").exists()
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]


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
    assert np.allclose(sync.at(0.485), 48.5)
    sync.add(FtSample(0.56, np.full(6, 56.0)))
    assert sync.at(0.505) is None and sync.at(0.555) is None  # the one after it, the one before it too far away
    with pytest.raises(ClockError, match="frame"):
        sync.at(0.554)  # frames come in order
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
    record.record(frames, CsvFt(write_csv(tmp_path / "more.csv", 1.1 * forces)), again)
    more = LabelledSet(tmp_path / "set")
    assert more.manifest["request"]["seed"] == seed and set(more.column("path")) == set(range(8))
    with pytest.raises(FileError, match="another recording is writing"):
        Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)
    again.close()
    with pytest.raises(FileError, match="holds a set with wall_mm"):
        Recording(tmp_path / "set", EndcapParams(130, 10), MOUNT)
    assert not list((tmp_path / "set").rglob("*.part"))


def test_a_video_recorded_again_after_a_stop_is_refused_as_training_and_test_would_share_it(pressed, tmp_path):
    refused = pytest.raises(FileError, match="holds this recording, or its beginning, already")
    for count, factor, ends in ((60, 1.0, nullcontext()), (76, 1.1, nullcontext()), (76, 1.0, refused)):
        stream = CsvFt(write_csv(tmp_path / "a.csv", factor * pressed[1]))
        with Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT) as recording, ends:
            record.record(pressed[0][:count], stream, recording)
    assert len(list(LabelledSet(tmp_path / "set").frames())) == 30 + 46


def test_the_reference_is_looked_for_with_the_design_s_dots(pressed, tmp_path, monkeypatch):
    frames, forces = pressed
    design, looked = EndcapParams(150, 9, dot_mm=5.0), []
    monkeypatch.setattr(record, "take_zero", lambda rest, name, params: looked.append(params) or single_zero(rest[0]))
    with Recording(tmp_path / "set", design, MOUNT) as recording:
        record.record(frames[:35], CsvFt(write_csv(tmp_path / "ft.csv", forces)), recording)
    assert looked == [design]


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


@pytest.mark.long
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


def test_a_folder_that_may_not_be_entered_is_named(tmp_path, monkeypatch):
    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr("pathlib.Path.exists", refuse)
    with pytest.raises(FileError, match=r"set: cannot be written \(Permission denied\): choose another folder"):
        Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)


DEEP = "[" * 100_000


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"request": []}, "its request is no table"),
        ({"request": None}, "its request is no table"),
        (("dot_rings", 5), "dot_rings=5 is no text"),
        (DEEP, "recursion"),
    ],
)
def test_a_manifest_of_another_form_is_named(tmp_path, change, said):
    Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT).close()
    Recording(tmp_path / "kept", EndcapParams(130, 8), MOUNT)  # not closed: its manifest stays
    manifest = json.loads((tmp_path / "kept" / "manifest.json").read_text())
    if isinstance(change, tuple):
        manifest["request"][change[0]] = change[1]
    elif isinstance(change, dict):
        manifest |= change
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "manifest.json").write_text(change if isinstance(change, str) else json.dumps(manifest))
    with pytest.raises(FileError, match=said) as caught:
        Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 400


def test_a_file_beside_the_shards_that_is_none_is_left_alone(pressed, tmp_path):
    frames = pressed[0]
    (tmp_path / "set" / "shards").mkdir(parents=True)
    for name in ("0x.npz", "\u0663.npz", "0\u0663.npz"):
        (tmp_path / "set" / "shards" / name).write_text("mine")
    with Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT) as recording:
        recording.begin(take_zero(frames[:4]), np.zeros(6))
        recording.add(frames[0], np.zeros(6))
        recording.flush()
    assert [path.name for path in LabelledSet(tmp_path / "set").shards] == ["00000.npz"]
    assert (tmp_path / "set" / "shards" / "0x.npz").read_text() == "mine"


def test_a_shard_without_a_path_is_named(tmp_path):
    (tmp_path / "set" / "shards").mkdir(parents=True)
    np.savez(tmp_path / "set" / "shards" / "00000.npz", path=np.zeros(0))
    with pytest.raises(FileError, match="not a shard of a recording"):
        Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)
    (tmp_path / "set" / "shards" / "00000.npz").write_text("none")
    for _ in range(2):  # the folder is let go each time
        with pytest.raises(FileError, match=r"shards/00000\.npz: not a whole shard"):
            Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)


def test_a_lock_that_is_a_link_is_neither_followed_nor_emptied(tmp_path):
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / ".lock").symlink_to(mine)
    with pytest.raises(FileError, match=r"its \.lock is a link"):
        Recording(tmp_path / "set", EndcapParams(130, 8), MOUNT)
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("reads", [1.9, "1", True, None, [1], 0])
def test_a_mounting_reads_one_way_or_the_other(tmp_path, reads):
    path = tmp_path / "mount.json"
    path.write_text(json.dumps({"T_endcap_ft": np.eye(4).tolist(), "reads": reads}))
    with pytest.raises(FileError, match=r"no mounting \(reads="):
        record.read_mount(path)
    for way in (1, -1):
        path.write_text(json.dumps({"T_endcap_ft": np.eye(4).tolist(), "reads": way}))
        assert record.read_mount(path).reads == way
