"""One table of ``robot.toml``: values by key; missing, unknown or malformed ones are refused in one line."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NoReturn

import numpy as np

from cad.errors import FileError, ParameterError, printable
from sensing.tensegrity.description import Array

MOST_TABLES = 1000


class Table:
    """Values of one table; each key that was read counts as known, and :meth:`finish` refuses the rest."""

    def __init__(self, path: str, label: str, values: dict[str, Any]) -> None:
        """Take the values of a table.

        Args:
            path: of the file.
            label: of the table, for messages.
            values: as the file states them.
        """
        self.path, self.label, self.values = path, label, values
        self.known: set[str] = set()

    def tables(self, key: str, fewest: int = 1) -> list[Table]:
        """The tables ``[[key]]``."""
        self.known.add(key)
        found = self.values.get(key, [])
        if not isinstance(found, list) or not all(isinstance(entry, dict) for entry in found):
            raise FileError(f"{self.path}: {key} is no list of tables: begin each with [[{key}]]")
        if not fewest <= len(found) <= MOST_TABLES:
            raise FileError(f"{self.path}: {len(found)} tables [[{key}]]: give {fewest} to {MOST_TABLES}")
        return [Table(self.path, _label(key, place, entry), entry) for place, entry in enumerate(found, 1)]

    def finish(self, key: str = "") -> str:
        """The text under a key, once every key that the table may have was read.

        Raises:
            FileError: the table has another key.
        """
        text = self.text(key) if key else ""
        unknown = sorted(set(self.values) - self.known)
        if unknown:
            known = ", ".join(sorted(self.known))
            raise FileError(f"{self.where()}unknown key {printable(', '.join(unknown))[:80]}: known are {known}")
        return text

    def where(self) -> str:
        """Begin of a message."""
        return f"{self.path}: {self.label}: " if self.label else f"{self.path}: "

    def number(self, key: str, default: float | None = None, above: float = -math.inf, most: float = math.inf) -> float:
        """A finite number.

        Args:
            key: of the value.
            default: where there is none.
            above, most: limits.
        """
        value = _finite(self._get(key, default))
        if value is None:
            refuse(self, key, self.values[key], "not a finite number")
        if not above < value <= most:
            refuse(
                self, key, value, f"it must be above {above:g}" + (f", at most {most:g}" if math.isfinite(most) else "")
            )
        return value

    def row(self, key: str, sizes: tuple[int, ...], default: list[float] | None = None) -> Array:
        """Numbers in a list.

        Args:
            key: of the value.
            sizes: how many there may be.
            default: where there is none.
        """
        found = self._numbers(self._get(key, default))
        if found is None or len(found) not in sizes:
            refuse(self, key, self.values[key], f"no list of {' or '.join(map(str, sizes))} finite numbers")
        return found

    def rows(self, key: str, count: int, size: int) -> Array:
        """(count, size) numbers in a list of lists.

        Args:
            key: of the value.
            count: of lists.
            size: of each.
        """
        value = self._get(key, None)
        found = [self._numbers(row) for row in value] if isinstance(value, list) else []
        good = [row for row in found if row is not None and len(row) == size]
        if len(good) != count or len(found) != count:
            refuse(self, key, value, f"no {count} lists of {size} finite numbers")
        return np.array(good)

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self._get(key, None)
        if not isinstance(value, str) or not value.strip():
            refuse(self, key, value, "no text")
        return value

    def texts(self, key: str, count: int) -> list[str]:
        """As many texts in a list."""
        value = self._get(key, None)
        if not isinstance(value, list) or len(value) != count or not all(isinstance(text, str) for text in value):
            refuse(self, key, value, f"no list of {count} texts")
        return value

    def choice(self, key: str, choices: Collection[str]) -> str:
        """One of some texts."""
        value = self.text(key)
        if value not in choices:
            refuse(self, key, value, f"unknown: one of {', '.join(choices)}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self._get(key, default)
        if not isinstance(value, bool):
            refuse(self, key, value, "neither true nor false")
        return value

    def _get(self, key: str, default: Any) -> Any:
        self.known.add(key)
        value = self.values.get(key, default)
        if value is None:
            raise FileError(f"{self.where()}{key} is missing")
        return value

    def _numbers(self, value: Any) -> Array | None:
        numbers = [_finite(number) for number in value] if isinstance(value, list) else [None]
        return None if None in numbers else np.array(numbers, float)


def refuse(table: Table, key: str, value: object, reason: str) -> NoReturn:
    """Refuse a value.

    Args:
        table: in which it stands.
        key: of the value.
        value: as the file states it.
        reason: why, and what is accepted.

    Raises:
        ParameterError: always.
    """
    raise ParameterError(f"{table.where()}{key} = {_short(value)}: {reason}", name=key, value=value)


def _finite(value: Any) -> float | None:
    if type(value) not in (int, float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer of hundreds of digits
        return None
    return number if math.isfinite(number) else None


def _short(value: object) -> str:
    try:
        text = value if isinstance(value, str) else repr(value)
    except (ValueError, RecursionError):  # thousands of digits, deep nesting
        text = type(value).__name__
    return printable(text if len(text) < 80 else text[:77] + "...")


def _label(key: str, place: int, entry: dict[str, Any]) -> str:
    name = entry.get("name")
    return f'{key} "{printable(name)[:40]}"' if isinstance(name, str) else f"{key} {place}"
