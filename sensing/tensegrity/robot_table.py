"""One table of ``robot.toml``: values by key; missing, unknown or malformed ones are refused in one line."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NoReturn

import numpy as np

from cad.errors import FileError, ParameterError, printable
from sensing.tensegrity.description import Array

MOST_TABLES = 1000  # largest number of tables of one kind


class Table:
    """Values of one table; keys that were read are accepted, and :meth:`finish` refuses all others."""

    def __init__(self, path: str, label: str, values: dict[str, Any]) -> None:
        """Take the values of a table.

        Args:
            path: path of the file.
            label: name of the table in messages.
            values: values of the file.
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
        """The text under a key, or the check alone without a key, after all accepted keys were read.

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
        """Beginning of a message: file and table."""
        return f"{self.path}: {self.label}: " if self.label else f"{self.path}: "

    def number(self, key: str, default: float | None = None, above: float = -math.inf, most: float = math.inf) -> float:
        """A finite number.

        Args:
            key: key of the value.
            default: value of a missing key; None refuses it.
            above, most: limits: greater than ``above``, at most ``most``.
        """
        value = _finite(self._get(key, default))
        if value is None:
            refuse(self, key, self.values[key], "not a finite number")
        if not above < value <= most:
            refuse(
                self, key, value, f"it must be above {above:g}" + (f", at most {most:g}" if math.isfinite(most) else "")
            )
        return value

    def number_if_given(self, key: str, above: float, most: float) -> float | None:
        """A finite number, None where the key is missing.

        Args:
            key: key of the value.
            above, most: limits, as in :meth:`number`.
        """
        self.known.add(key)
        return self.number(key, above=above, most=most) if key in self.values else None

    def row(self, key: str, sizes: tuple[int, ...], default: list[float] | None = None) -> Array:
        """A list of numbers.

        Args:
            key: key of the value.
            sizes: accepted numbers of entries.
            default: value of a missing key; None refuses it.
        """
        found = self._numbers(self._get(key, default))
        if found is None or len(found) not in sizes:
            refuse(self, key, self.values[key], f"no list of {' or '.join(map(str, sizes))} finite numbers")
        return found

    def rows(self, key: str, count: int, size: int) -> Array:
        """(count, size) numbers from a list of lists.

        Args:
            key: key of the value.
            count: number of lists.
            size: number of entries in each.
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
        """A list of ``count`` texts."""
        value = self._get(key, None)
        if not isinstance(value, list) or len(value) != count or not all(isinstance(text, str) for text in value):
            refuse(self, key, value, f"no list of {count} texts")
        return value

    def choice(self, key: str, choices: Collection[str]) -> str:
        """One of the accepted texts."""
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
        table: table of the value.
        key: key of the value.
        value: value in the file.
        reason: the reason, with the accepted range.

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
