"""The index of a recording while it grows: in a file without a name, which is gone with the program."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex


class IndexOnDisk:
    """In place of the writer's list of chunks, which grows by 5 MB a minute with six endcaps: records in a file."""

    def __init__(self) -> None:
        self._file: IO[bytes] = io.BytesIO()

    def take_over(self, writer: Any, folder: Path) -> None:
        """Stand in for the list of a writer of the library, which has no setting for it.

        Args:
            writer: not yet started.
            folder: where the file lies.

        Raises:
            OSError: no file can be made there.
        """
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 (open until the recording ends)
        writer._Writer__chunk_indices = self

    def append(self, index: ChunkIndex) -> None:
        """Write one."""
        record = RecordBuilder()
        index.write(record)
        self._file.write(record.end())

    def __iter__(self) -> Iterator[IndexOnDisk]:
        return iter((self,))  # all of them as one

    def write(self, builder: RecordBuilder) -> None:
        """Copy all records."""
        self._file.seek(0)
        builder.write(self._file.read())

    def close(self) -> None:
        """Release the file and drop unwritten entries, which are not needed but would raise on a full disk."""
        with contextlib.suppress(OSError):
            self._file.close()
