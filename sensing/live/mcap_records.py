"""The records of an MCAP file in order, read so that no file can hurt: lengths are checked before anything is read,
sizes before anything is decompressed, and check sums before anything is used.

    for record in read_records(path): ...              # Channel, Message, Metadata and Attachment of the library mcap

A damaged file gives all that stands before the damage and then raises :class:`DamagedError`; one that ends too early
raises :class:`CutError` there. Format: https://mcap.dev/spec, version 0.
"""

from __future__ import annotations

import contextlib
import io
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Footer, McapRecord, Message, Metadata

from cad.errors import FileError

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # kind and length of a record
TAIL = HEAD.size + 20 + len(MAGIC)  # the last record and what follows it
BLOCK_BYTES = 1 << 20
MOST_BYTES = 1 << 26  # of a record, and of a chunk when decompressed
MOST_RATIO = 100  # of a chunk to its compressed size: pictures give 1, numbers alone some ten
LEAST_MESSAGE = 22  # bytes before its data
SPAN, CHANNEL = struct.Struct("<QQ"), struct.Struct("<H")  # first words of a chunk, and of the index of one channel
Place = tuple[Path, int]  # file and byte


class DamagedError(FileError):
    """A recording with bytes that are not those that were written."""


class CutError(FileError):
    """A recording whose end is missing: its writer was killed, or the disk was full."""


@dataclass(frozen=True)
class ChunkPlace:
    """Where a chunk lies.

    Attributes:
        byte: of its record.
        begin_ns, end_ns: first and last stamp of its messages.
        channels: numbers of those that have messages in it; empty where the file does not say.
    """

    byte: int
    begin_ns: int
    end_ns: int
    channels: frozenset[int] = frozenset()


def read_records(path: Path, start: int = 0) -> Iterator[McapRecord]:
    """All channels, messages, metadata and attachments; chunks are opened.

    Args:
        path: of the file.
        start: byte of the record to begin with; 0 for the first.

    Raises:
        FileError: missing, no regular file, no MCAP.
        DamagedError, CutError: after all that can be read.
    """
    with _opened_file(path) as stream:
        yield from _records(path, stream, path.stat().st_size, start)


def read_chunk(path: Path, byte: int) -> Iterator[McapRecord]:
    """The records of one chunk.

    Raises:
        FileError: missing, no regular file.
        DamagedError: damaged.
    """
    with _opened_file(path) as stream:
        yield from _records(path, stream, path.stat().st_size, byte, once=True)


def chunk_places(path: Path) -> list[ChunkPlace]:
    """The chunks in order, from the heads of the records alone; as far as the file is whole.

    Raises:
        FileError: missing, no regular file.
    """
    found: list[ChunkPlace] = []
    with _opened_file(path) as stream:
        size, byte = path.stat().st_size, len(MAGIC)
        while byte + HEAD.size <= size:
            stream.seek(byte)
            kind, length = HEAD.unpack(stream.read(HEAD.size))
            if kind == Opcode.DATA_END or length > size - byte - HEAD.size:
                break
            if kind == Opcode.CHUNK and length >= SPAN.size:
                found.append(ChunkPlace(byte, *SPAN.unpack(stream.read(SPAN.size))))
            elif kind == Opcode.MESSAGE_INDEX and length >= CHANNEL.size and found:
                number = CHANNEL.unpack(stream.read(CHANNEL.size))
                found[-1] = replace(found[-1], channels=found[-1].channels.union(number))
            byte += HEAD.size + length
    return found


@contextlib.contextmanager
def _opened_file(path: Path) -> Iterator[BinaryIO]:
    try:
        if path.exists() and not path.is_file():
            raise FileError(f"{path}: no regular file: give a recording")
        with path.open("rb") as stream:
            yield stream
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: give a recording") from None


def damaged(place: Place, reason: object) -> DamagedError:
    """The error of a byte."""
    said = " ".join(str(reason).split())[:120]
    return DamagedError(f"{place[0]}: damaged at byte {place[1]} ({said}): what stands before it is read")


def _records(path: Path, stream: BinaryIO, size: int, start: int, once: bool = False) -> Iterator[McapRecord]:
    if stream.read(len(MAGIC)) != MAGIC:
        raise FileError(f"{path}: no MCAP file: give one made with --record")
    check_sum = zlib.crc32(MAGIC)  # of the data section
    stream.seek(max(start, len(MAGIC)))
    while True:
        place = path, stream.tell()
        head = stream.read(HEAD.size)
        kind, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, size)
        if length > size - stream.tell():
            raise _too_short(place, stream, size)
        if length > MOST_BYTES:
            raise damaged(place, f"a record of {length} bytes, at most {MOST_BYTES} allowed")
        body = stream.read(length)
        if kind == Opcode.DATA_END:
            if not start:
                _check_end(place, body, check_sum, stream)
            return
        check_sum = zlib.crc32(body, zlib.crc32(head, check_sum))
        yield from _opened(place, kind, body)
        if once:
            return


def _too_short(place: Place, stream: BinaryIO, size: int) -> FileError:
    """Of a file that has the last bytes of a whole one, a length is wrong; of another, the end is missing."""
    stream.seek(max(0, size - len(MAGIC)))
    if stream.read() == MAGIC and place[1] > 0:
        return damaged(place, "a record longer than the file")
    if place[1] == len(MAGIC):
        return FileError(f"{place[0]}: no MCAP file, or nothing but its first bytes: give one made with --record")
    return CutError(
        f"{place[0]}: cut at byte {place[1]} (its writer was killed, or the disk was full): what stands before is read"
    )


def _check_end(place: Place, body: bytes, check_sum: int, stream: BinaryIO) -> None:
    """The two check sums that the end of a whole file has; 0 stands for none."""
    reported = struct.unpack("<I", body)[0] if len(body) == 4 else None
    if reported is None or reported not in (0, check_sum):
        raise damaged(place, "the check sum of all before it differs")
    begin, end = stream.tell(), stream.seek(0, os.SEEK_END)
    stream.seek(max(begin, end - TAIL))
    tail = stream.read()
    if len(tail) < TAIL or tail[-len(MAGIC) :] != MAGIC:
        raise CutError(f"{place[0]}: cut at byte {end}, in its index: all pictures are read")
    footer = _parsed(place, Footer, tail[HEAD.size : -len(MAGIC)])
    if footer.summary_crc not in (0, _check_sum(stream, begin, end - len(MAGIC) - 4)):
        raise damaged(place, "the check sum of the index differs; all pictures are read")


def _check_sum(stream: BinaryIO, begin: int, end: int) -> int:
    stream.seek(begin)
    found = 0
    while begin < end:
        block = stream.read(min(BLOCK_BYTES, end - begin))
        found, begin = zlib.crc32(block, found), begin + max(1, len(block))
    return found


def _opened(place: Place, kind: int, body: bytes) -> Iterator[McapRecord]:
    """The records of a record: itself, those of a chunk, or none for kinds that a replay has no use for."""
    if kind == Opcode.CHUNK:
        yield from _of_chunk(place, _decompressed(place, _parsed(place, Chunk, body)))
    elif kind == Opcode.CHANNEL:
        yield _parsed(place, Channel, body)
    elif kind == Opcode.METADATA:
        yield _parsed(place, Metadata, body)
    elif kind == Opcode.ATTACHMENT:
        if struct.unpack("<I", body[-4:].rjust(4, b"\0"))[0] not in (0, zlib.crc32(body[:-4])):
            raise damaged(place, "the check sum of an attachment differs")
        yield _parsed(place, Attachment, body)
    elif kind == Opcode.MESSAGE:
        yield _message(place, body)


def _of_chunk(place: Place, data: bytes) -> Iterator[McapRecord]:
    start = 0
    while start < len(data):
        if len(data) - start < HEAD.size:
            raise damaged(place, "a chunk with half a record")
        kind, length = HEAD.unpack_from(data, start)
        start += HEAD.size
        if length > len(data) - start:
            raise damaged(place, "a chunk with half a record")
        if kind != Opcode.CHUNK:  # chunks do not hold chunks
            yield from _opened(place, kind, data[start : start + length])
        start += length


def _decompressed(place: Place, chunk: Chunk) -> bytes:
    """Records of a chunk, after checks of size and check sum."""
    size = chunk.uncompressed_size
    if size > min(MOST_BYTES, MOST_RATIO * (len(chunk.data) + 1024)):
        raise damaged(place, f"a chunk of {len(chunk.data)} bytes that claims to hold {size}")
    try:
        data = _unpacked(chunk.compression, chunk.data, size)
    except Exception as error:  # each library has its own
        raise damaged(place, f"{chunk.compression}: {error}") from None
    if len(data) != size:
        raise damaged(place, f"a chunk that should hold {size} bytes")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise damaged(place, "the check sum of a chunk differs")
    return data


def _unpacked(compression: str, data: bytes, size: int) -> bytes:
    """At most ``size`` + 1 bytes."""
    if compression == "":
        return data
    if compression == "zstd":
        import zstandard

        reader = zstandard.ZstdDecompressor(max_window_size=MOST_BYTES).stream_reader(io.BytesIO(data))
        return bytes(reader.read(size + 1))
    if compression == "lz4":
        import lz4.frame

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    raise ValueError("no compression that is known")


def _message(place: Place, body: bytes) -> Message:
    if len(body) < LEAST_MESSAGE:
        raise damaged(place, "a message without a head")
    return Message.read(ReadDataStream(io.BytesIO(body)), len(body))


def _parsed(place: Place, kind: Any, body: bytes) -> Any:
    try:
        return kind.read(ReadDataStream(io.BytesIO(body)))
    except (McapError, struct.error, ValueError, OverflowError) as error:
        raise damaged(place, f"{kind.__name__}: {error}") from None
