"""Damaged recordings and configurations, made from whole ones by a seeded generator."""

from __future__ import annotations

import hashlib
import io
import json
import random
import struct
from collections.abc import Callable
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata
from mcap.writer import CompressionType, Writer

from sensing.live import mcap_records
from sensing.live.outputs.mcap.config import METADATA
from sensing.live.outputs.ros import types as ros

NASTY = (
    "9" * 400, "9" * 5000, "-1", "0", "1e400", "nan", "-inf", "true", '"²"', '""', '"\\u001b[2J"', '"\\u0000"',
    "[" * 3000, '"/dev/zero"', '"/"', '"."', '"none such"', '"x' + "y" * 3000 + '"', "[]", "{}", "[[1]]", "1979-05-27",
    '"http://"', '"http://127.0.0.1:1/"', '"http://[::1"', '"scene:99"', '"scene:²"', "'''\n'''", "0x10", "1_0",
    '"../../../etc/passwd"',
)  # fmt: skip
HUGE_PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">II", 60000, 60000) + bytes(99)


def mutated_bytes(rng: random.Random, data: bytes) -> bytes:
    """Bits flipped, bytes overwritten, a slice cut out, doubled or moved, or the end cut off."""
    out, kind = bytearray(data or b"\0"), rng.randrange(6)
    start = rng.randrange(len(out))
    length = min(len(out) - start, int(2 ** rng.uniform(0, 16)))
    if kind == 0:
        for _ in range(rng.randint(1, 8)):
            out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    elif kind == 1:
        return data[:start]
    elif kind == 2:
        out[start : start + length] = rng.choice((b"\0", b"\xff", b"\x89")) * length
    elif kind == 3:
        del out[start : start + length]
    elif kind == 4:
        out[start:start] = out[start : start + length]
    else:
        out[start : start + length] = rng.randbytes(length)
    return bytes(out)


def mutated_text(rng: random.Random, text: str) -> str:
    """A configuration with a value replaced, a line lost, doubled or moved, or bytes mutated."""
    lines, kind = text.splitlines() or ["x"], rng.randrange(5)
    line = rng.randrange(len(lines))
    if kind <= 1 and "=" in lines[line]:
        lines[line] = lines[line].split("=")[0] + "= " + rng.choice(NASTY)
    elif kind == 2:
        del lines[line]
    elif kind == 3:
        lines.insert(rng.randrange(len(lines)), lines[line])
    else:
        return mutated_bytes(rng, text.encode("utf-8", "surrogateescape")).decode("utf-8", "surrogateescape")
    return "\n".join(lines) + "\n"


def mutated_recording(rng: random.Random, path: Path) -> bytes:
    """Bytes that are damaged, or a file that is whole and holds nonsense."""
    if rng.random() < 0.5:
        return mutated_bytes(rng, path.read_bytes())
    if rng.random() < 0.2:
        return bomb(rng)
    nonsense: tuple[Callable[[random.Random, McapRecord], McapRecord], ...] = (_bad_message, _bad_config, _bad_order)
    change, chosen = rng.choice(nonsense), rng.choice(list(CompressionType))
    return rewritten(path, lambda record: change(rng, record), chosen)


def rewritten(path: Path, change: Callable[[McapRecord], McapRecord], compression: CompressionType) -> bytes:
    """The recording with all check sums right, every record changed as asked for."""
    out = io.BytesIO()
    writer = Writer(out, compression=compression)
    writer.start(profile="ros2", library="fuzz")
    numbers: dict[int, int] = {}
    for record in map(change, list(mcap_records.read_records(path))):
        if isinstance(record, Channel):
            kind = writer.register_schema("x", "ros2msg", b"")
            numbers[record.id] = writer.register_channel(record.topic, "cdr", kind)
        elif isinstance(record, Message):
            channel = numbers.get(record.channel_id, 1)
            writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        elif isinstance(record, Attachment):
            writer.add_attachment(0, 0, record.name, "", record.data)
    writer.finish()
    return out.getvalue()


def bomb(rng: random.Random) -> bytes:
    """A few bytes that unpack to gigabytes, with or without saying so."""
    size = 1 << rng.randint(20, 31)
    squeezed = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    block = bytes(1 << 20)
    data = b"".join([*(squeezed.compress(block) for _ in range(size >> 20)), squeezed.flush()])
    reported = rng.choice((size, 1 << 16, 1 << 62, 0))
    chunk = Chunk("zstd", data, 0, 0, 0, reported)
    builder = RecordBuilder()
    chunk.write(builder)
    return mcap_records.MAGIC + builder.end()


def _bad_message(rng: random.Random, record: McapRecord) -> McapRecord:
    if not isinstance(record, Message) or rng.random() > 0.05:
        return record
    data = rng.choice((
        b"", b"\0\1\0\0", record.data[: rng.randrange(1 + len(record.data))], mutated_bytes(rng, record.data),
        ros.float64(rng.choice((float("nan"), float("inf"), 1e300, -1e8))),
        ros.compressed_image(HUGE_PNG, "png", 0, "a"),
        ros.compressed_image(rng.randbytes(500), rng.choice(("jpeg", "png", "\x1b[2J")), 0, "\x1b]0;x\7"),
        record.data[:20] + b"\xff\xfe\xfd" + record.data[23:],
    ))  # fmt: skip
    return Message(record.channel_id, record.log_time, data, record.publish_time, record.sequence)


def _bad_config(rng: random.Random, record: McapRecord) -> McapRecord:
    if not isinstance(record, Metadata):
        return record
    reported = json.loads(record.metadata["config"])
    place = rng.choice((reported, reported["endcaps"][0], reported["files"]))
    key = rng.choice(list(place))
    place[key] = rng.choice((None, 1, -1, 10**400, "x" * 5000, "\x1b[2J", [], {}, [[]] * 4, "/dev/zero", True, 1e308))
    text = json.dumps(reported)
    if rng.random() < 0.2:
        text = rng.choice(("[" * 100_000, "{", '"\\ud800"', "9" * 5000, mutated_text(rng, text + "\n")))
    data = text.encode("utf-8", "replace")
    return Metadata(METADATA, {"config": data.decode(), "sha256": hashlib.sha256(data).hexdigest()})


def _bad_order(rng: random.Random, record: McapRecord) -> McapRecord:
    """Messages on the channel of another topic, and weights that are none."""
    if isinstance(record, Message) and rng.random() < 0.05:
        other = rng.randint(0, 12)
        return Message(other, record.log_time, record.data, record.publish_time, record.sequence)
    if isinstance(record, Attachment) and rng.random() < 0.5:
        return Attachment(0, 0, record.name, "", mutated_bytes(rng, record.data))
    return record
