"""Tables of the benches as files: whole or not at all, because a bench that is stopped must not leave half of one."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path

from cad.whole_file import replace_file


def write_table(
    path: Path,
    rows: Sequence[Mapping[str, object]],
    columns: Sequence[str] = (),
    figures: int = 0,
    missing: str = "",
) -> None:
    """Write rows as CSV under their names.

    Args:
        path: the file; an existing one is replaced.
        rows: values by column.
        columns: their order; empty for that in which the rows name them.
        figures: significant figures of floats; 0 writes them as they are.
        missing: what stands where a row lacks a column.

    Raises:
        FileError: the file cannot be written.
        ValueError: a row has a column that ``columns`` lacks.
    """
    columns = columns or list(dict.fromkeys(name for row in rows for name in row))
    writer = csv.DictWriter(stream := io.StringIO(), columns, restval=missing, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _text(value, figures) for name, value in row.items()} for row in rows)
    replace_file(path, stream.getvalue().encode())


def _text(value: object, figures: int) -> object:
    plain = not figures or isinstance(value, Integral) or not isinstance(value, Real)
    return value if plain else f"{value:.{figures}g}"
