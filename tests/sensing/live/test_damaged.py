"""Recordings that are damaged, cut, hostile or moved: what can be read is read, the rest is one line."""

import hashlib
import json
import math
import os
import re
import struct
import subprocess
import sys
import zlib
from dataclasses import replace
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from live_stand_in import PATIENCE_S, film, frames, pipeline, stand_in
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, Metadata

from cad.errors import FileError
from sensing.camera.nominal import nominal_mount
from sensing.decode import jpeg_size
from sensing.live.cli import main
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.mcap_records import HEAD, MAGIC, CutError, DamagedError, read_records
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.replay import read_config, recorded_frames, verify

FRAMES = 24


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())


def record(path: Path, config: LiveConfig, count: int = FRAMES) -> None:
    recorder = Recorder(path, config, {"endcap_0": 0}, lambda _: None)
    recorder.idle = lambda: None  # this test writes in its own thread
    recorder.start()
    recorder._flushed_s, pipe = math.inf, pipeline()
    for k, frame in enumerate(frames(film([0, 0, 0.5, 1.0] * (count // 4)))):
        recorder.write(pipe.update(frame))
        if k % 6 == 5:
            recorder._flush()  # four chunks, however slow this computer is
            recorder._flushed_s = math.inf
    recorder.close(PATIENCE_S)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("damaged") / "run.mcap"
    record(path, LiveConfig((EndcapConfig("endcap_0", "test"),)))
    return path.read_bytes()


def records_of(data: bytes) -> list[tuple[int, int, int]]:
    """(byte, kind, length) of every record."""
    found, place = [], len(MAGIC)
    while place + HEAD.size <= len(data) - len(MAGIC):
        kind, length = HEAD.unpack_from(data, place)
        found.append((place, kind, length))
        place += HEAD.size + length
    return found


def bad_head(jpeg: bytes, kind: str) -> bytes:
    """A picture whose head is damaged: its size is lost, or another one."""
    if kind == "upright":  # one bit of its height
        place = jpeg.find(b"\xff\xc0") + 5
        return jpeg[:place] + bytes([jpeg[place] ^ 0x40]) + jpeg[place + 1 :]
    return {"html": b"<html>no picture", "text": b"\xff\xd8 no picture", "cut": jpeg[:20]}[kind]


@pytest.mark.parametrize("kind", ["html", "text", "cut", "upright"])
def test_a_picture_with_a_damaged_head_is_replayed_like_any_other(tmp_path, kind):
    path, pipe = tmp_path / "run.mcap", pipeline()
    recorder = Recorder(path, LiveConfig((EndcapConfig("endcap_0", "test"),)), {"endcap_0": 0}, lambda _: None)
    recorder.start()
    given = frames(film([0, 0, 0.5, 1.0] * 3))
    bad = bad_head(given[6].jpeg, kind)
    given[6] = replace(given[6], jpeg=bad, size=jpeg_size(bad))
    readings = [pipe.update(frame) for frame in given]
    for reading in readings:
        recorder.put(reading)
    recorder.close(PATIENCE_S)
    assert [reading.valid for reading in readings] == [True] * 6 + [False] + [True] * 5
    found = verify(path, read_config(path), lambda _: stand_in())
    assert (found.frames, found.different, found.end) == (12, 0, None)


def chunks(data: bytes) -> list[tuple[int, int]]:
    return [(place, length) for place, kind, length in records_of(data) if kind == Opcode.CHUNK]


def check(tmp_path: Path, data: bytes):
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    return verify(path, read_config(path), lambda _: stand_in())


@pytest.mark.long
def test_a_flipped_bit_is_found_where_it_is(tmp_path, whole, capsys):
    place, length = chunks(whole)[2]
    data = bytearray(whole)
    data[place + length // 2] ^= 4  # in a picture
    found = check(tmp_path, bytes(data))
    assert found.frames == 12 and found.different == 0 and isinstance(found.end, DamagedError)
    assert f"damaged at byte {place} (the check sum of a chunk differs)" in str(found.end)
    assert main(["--replay", str(tmp_path / "x.mcap"), "--check"]) == 1
    reported = capsys.readouterr()
    assert "12 frames computed again, 0 differ" in reported.out and "damaged at byte" in reported.err
    assert main(["--replay", str(tmp_path / "x.mcap"), "--no-page", "--speed", "0"]) == 1
    reported = capsys.readouterr()
    assert "12 frames" in reported.out and reported.err.count("damaged at byte") == 1


def test_every_part_of_the_file_is_covered_by_a_check_sum(tmp_path, whole):
    rng = np.random.default_rng(3)
    for place, kind, length in records_of(whole):
        data = bytearray(whole)
        data[place + HEAD.size + int(rng.integers(length))] ^= 1 << int(rng.integers(8))
        path = tmp_path / "x.mcap"
        path.write_bytes(data)
        with pytest.raises(FileError):
            read_config(path)
            list(recorded_frames(path, "endcap_0"))
            pytest.fail(f"a change in record {kind} at byte {place} went unseen")


def test_a_cut_is_named_and_all_before_it_is_read(tmp_path, whole, capsys):
    place, length = chunks(whole)[3]
    found = check(tmp_path, whole[: place + length // 3])
    assert found.frames == 18 and found.different == 0 and isinstance(found.end, CutError)
    assert f"cut at byte {place} (its writer was killed, or the disk was full)" in str(found.end)
    for words in (["--check"], ["--check", "--from", "0.1"], ["--no-page", "--speed", "0"]):
        assert main(["--replay", str(tmp_path / "x.mcap"), *words]) == 1  # as of a damaged one: it is not whole
        assert capsys.readouterr().err.count("cut at byte") == 1
    assert "in its index: all pictures are read" in str(check(tmp_path, whole[:-20]).end)


def with_chunk(data: bytes, number: int, make) -> bytes:
    """The file with a chunk made anew; check sums of the whole are left out."""
    place, length = chunks(data)[number]
    body = data[place + HEAD.size : place + HEAD.size + length]
    start, end, size, crc, name = struct.unpack_from("<QQQII", body)
    chunk = make(body[32 + name + 8 :], size, crc)
    builder = RecordBuilder()
    Chunk(chunk[0], chunk[1], end, start, chunk[3], chunk[2]).write(builder)
    end_place = next(at for at, kind, _ in records_of(data) if kind == Opcode.DATA_END)
    cleared = data[: end_place + HEAD.size] + bytes(4) + data[end_place + HEAD.size + 4 :]
    return cleared[:place] + builder.end() + cleared[place + HEAD.size + length :]


@pytest.mark.parametrize("name", ["zstd", "lz4"])
def test_a_recording_that_another_tool_has_compressed_replays(tmp_path, whole, name):
    pack = zstandard.compress if name == "zstd" else lz4.frame.compress
    found = check(tmp_path, with_chunk(whole, 1, lambda data, size, crc: (name, pack(data), size, crc)))
    assert found.frames == FRAMES and found.different == 0 and found.end is None


ZEROS = bytes(1 << 26)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda *_: ("zstd", zstandard.compress(ZEROS), 1 << 26, 0), "claims to hold 67108864"),
        (lambda *_: ("zstd", zstandard.compress(ZEROS), 5000, 0), "should hold 5000 bytes"),
        (lambda *_: ("lz4", lz4.frame.compress(ZEROS), 5000, 0), "should hold 5000 bytes"),
        (lambda *_: ("zstd", b"\x28\xb5\x2f\xfd" + b"\xff" * 50, 5000, 0), "zstd"),
        (lambda *_: ("lz4", b"nonsense", 5000, 0), "lz4"),
        (lambda *_: ("brotli", b"nonsense", 5000, 0), "no compression that is known"),
        (lambda data, size, crc: ("", data, 1 << 62, crc), "claims to hold"),
    ],
)
def test_bombs_and_broken_compression_are_refused_before_they_are_unpacked(tmp_path, whole, make, said):
    found = check(tmp_path, with_chunk(whole, 1, make))
    assert found.frames == 6 and said in str(found.end) and "\n" not in str(found.end)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.replace(b"jpeg", b"j\xff\xfeg", 1),  # no UTF-8
        lambda data: data.replace(b"jpeg", b"JPEG", 1),  # no format that is known: no picture
    ],
)
def test_messages_that_are_none_are_named(tmp_path, whole, change):
    def make(data, size, crc):
        changed = change(data)
        assert changed != data and len(changed) == size
        return "", changed, size, zlib.crc32(changed)

    found = check(tmp_path, with_chunk(whole, 1, make))
    assert found.frames == 6 and re.search(r"message 6 of .* is damaged", str(found.end))


def with_config(data: bytes, text: str) -> bytes:
    """The file with another configuration, its digest right."""
    place, _, length = next(each for each in records_of(data) if each[1] == Opcode.METADATA)
    builder = RecordBuilder()
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    Metadata("endcap_live", {"config": text, "sha256": digest}).write(builder)
    return data[:place] + builder.end() + data[place + HEAD.size + length :]


def config_of(data: bytes, tmp_path: Path) -> dict:
    path = tmp_path / "whole.mcap"
    path.write_bytes(data)
    (reported,) = [record.metadata for record in read_records(path) if isinstance(record, Metadata)]
    return json.loads(reported["config"])


@pytest.mark.parametrize(
    "change",
    [
        {"weight_n": 10**400}, {"endcaps": []}, {"endcaps": 3}, {"files": None}, {"model": "\x1b[2J"}, {"model": []},
        {"format": 99}, {"method": "none such"}, {"files": {"weights": "0" * 64}}, {"files": {"camera/endcap_0": "1"}},
    ],
)  # fmt: skip
def test_a_configuration_that_is_none_is_one_line(tmp_path, whole, change):
    path = tmp_path / "x.mcap"
    path.write_bytes(with_config(whole, json.dumps(config_of(whole, tmp_path) | change)))
    with pytest.raises(FileError, match=r"x\.mcap") as caught:
        read_config(path)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "[]", "9" * 5000, '{"format": 2}'])
def test_json_that_is_none_is_one_line(tmp_path, whole, text):
    path = tmp_path / "x.mcap"
    path.write_bytes(with_config(whole, text))
    with pytest.raises(FileError, match=r"x\.mcap"):
        read_config(path)


def test_a_recording_carries_its_files_and_opens_no_path_that_it_names(tmp_path):
    camera, path = tmp_path / "camera.json", tmp_path / "run.mcap"
    config = EndcapConfig("endcap_0", "test")
    nominal_mount(config.params, 640, 480).save(camera)
    weights = tmp_path / "weights.safetensors"
    weights.write_bytes(b"weights of this run")
    record(path, LiveConfig((EndcapConfig("endcap_0", "test", camera=camera),), weights=weights), 4)
    kept = camera.read_bytes()
    camera.unlink()
    weights.unlink()
    os.mkfifo(weights)  # opened, it would wait for ever
    found = read_config(path)
    assert found.endcaps[0].camera.read_bytes() == kept and found.weights.read_bytes() == b"weights of this run"
    assert (tmp_path / "cache") in found.weights.parents and str(camera).encode() not in path.read_bytes()
    found.weights.write_bytes(b"changed by somebody")
    assert read_config(path).weights.read_bytes() == b"weights of this run"
    assert read_config(path, "paper").weights is None  # those of another model are not taken


def test_the_weights_that_ship_are_carried_too(tmp_path, whole):
    path = tmp_path / "x.mcap"
    path.write_bytes(whole)
    assert read_config(path).weights.stat().st_size > 100_000


def test_what_is_no_regular_file_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", tmp_path, Path("/dev/zero")):
        with pytest.raises(FileError, match="no regular file"):
            read_config(path)


@pytest.mark.long
def test_random_damage_is_borne():
    """A sample of ``python bench/bench_robust_files.py``, in a process of its own: it forks."""
    bench = Path(__file__).resolve().parents[3] / "bench"
    code = (
        "from bench_robust_files import cases\n"
        "print([fault for kind in ('configuration', 'recording') for _, fault in cases(kind, 6, 2, 11) if fault])"
    )
    environment = {**os.environ, "PYTHONPATH": f"{bench}{os.pathsep}{bench.parent}"}
    reported = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=3 * PATIENCE_S
    )
    assert reported.stdout.splitlines()[-1:] == ["[]"], reported.stdout + reported.stderr
