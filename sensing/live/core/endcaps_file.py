"""Reads and writes ``endcaps.toml``, the file of :mod:`sensing.live.core.config`."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cad import plugins
from cad.errors import FileError, ParameterError, printable
from cad.whole_file import replace_file
from sensing.interpreter import typed_command
from sensing.live.core.config import LiveConfig, one_each
from sensing.live.core.endcap_config import OF_BEFORE, EndcapConfig
from sensing.sources.choose import is_address
from sensing.wrench.relaxation import MOST_TERMS

TEXTS = (
    "name", "source", "model", "method", "zero", "camera", "weights", "silicone", "dots", "lens", "gain_date",
    "gain_weights", "own_weight",
)  # fmt: skip
EXAMPLE = "sensing.live.core.config"  # module whose text has every key
MOST_BYTES = 1 << 20  # of the file
LEAST_REACH_MM = 2.0  # from the robot's origin to the farthest of two or more endcaps: 2 m written as m
Made = TypeVar("Made")
NO_KEYS = ("endcaps", "own_weights")  # of a configuration: tables of their own, and what only a recording carries


def load_config(path: Path) -> LiveConfig:
    """Read ``endcaps.toml``.

    Raises:
        FileError: missing, no TOML, an unknown or missing key.
        ParameterError: a bad value, with the file and its endcap.
    """
    try:
        with path.open("rb") as stream:
            text = stream.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES} bytes")
        reported = tomllib.loads(text.decode("utf-8-sig"))  # some editors begin a file with a byte order mark
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}: write it with python -m sensing.setup") from None
    except (ValueError, RecursionError) as error:  # no TOML, no UTF-8, numbers of thousands of digits, deep nesting
        said = printable(str(error))[:200]
        raise FileError(f"{path}: no TOML ({said}): fix it or write it anew with python -m sensing.setup") from None
    endcaps = reported.pop("endcap", [])
    if not isinstance(endcaps, list) or not all(isinstance(endcap, dict) for endcap in endcaps):
        raise FileError(f"{path}: endcap is no list of tables: begin each with [[endcap]]")
    checked = [OF_BEFORE | _checked(path, EndcapConfig, endcap) for endcap in endcaps]
    made = tuple(_named(f"{path}, {values['name']}", partial(EndcapConfig, **values)) for values in checked)
    config = _named(str(path), partial(LiveConfig, made, **_checked(path, LiveConfig, reported)))
    _require_apart(path, config.endcaps)
    return config


def _named(where: str, make: Callable[[], Made]) -> Made:
    """What is made of values of the file; an error of theirs says where they stand."""
    try:
        return make()
    except ParameterError as error:
        raise ParameterError(f"{where}: {error}", name=error.name, value=error.value) from None


def _require_apart(path: Path, endcaps: Sequence[EndcapConfig]) -> None:
    """Refuse what no robot is, and what a copied or mistaken line makes of one.

    Raises:
        ParameterError: one address for two endcaps, or places in metres.
    """
    seen: dict[str, str] = {}
    for endcap in endcaps:
        other = seen.setdefault(endcap.source, endcap.name)
        if other != endcap.name and _is_one_camera(endcap.source):
            raise ParameterError(
                f"{path}: {other} and {endcap.name} have the same source, {endcap.source}: {one_each('address')}",
                name="source",
            )
    reaches_mm = [float(np.linalg.norm(endcap.T_robot_endcap[:3, 3])) for endcap in endcaps]
    if len(endcaps) > 1 and 0 < max(reaches_mm) < LEAST_REACH_MM:
        raise ParameterError(
            f"{path}: T_robot_endcap puts all endcaps within {max(reaches_mm):.3g} mm of the robot's origin: give mm "
            "(these look like metres)",
            name="T_robot_endcap",
            value=max(reaches_mm),
        )


def _is_one_camera(source: str) -> bool:
    """Whether an address, or a word of a plug-in, is a camera, which sees one endcap; files may be of several."""
    name, colon, address = source.partition(":")
    of_plugin = colon and name in plugins.names(plugins.Kind.CAMERA) and not os.path.exists(address)
    return is_address(source) or bool(of_plugin)


def save_config(config: LiveConfig, path: Path) -> None:
    """Write ``endcaps.toml`` under a temporary name, then rename.

    Raises:
        FileError: the place cannot be written.
    """
    lines = ["# Written by python -m sensing.setup; read by python -m sensing.live --config FILE.", ""]
    lines += _lines(config, NO_KEYS, path.parent)
    for endcap in config.endcaps:
        lines += ["", "[[endcap]]", *_lines(endcap, (), path.parent)]
    replace_file(path, ("\n".join(lines) + "\n").encode())


def live_command(path: Path) -> str:
    """The command that reads such a file, ready to be pasted."""
    return typed_command("sensing.live", "--config", str(path))


def next_words(path: Path, trained_for: str = "") -> str:
    """What to run once such a file is written, for the end of a line.

    Args:
        path: of the file.
        trained_for: silicone of the weights where an endcap is of another one: live refuses it until it is weighed.
    """
    if not trained_for:
        return f"run {live_command(path)}"
    weigh = typed_command("sensing.weigh", "--config", str(path))
    return f"its weights are for {trained_for}, so weigh each endcap first: {weigh}; then {live_command(path)}"


def _lines(record: Any, without: tuple[str, ...], folder: Path) -> list[str]:
    found = []
    for entry in fields(record):
        value = getattr(record, entry.name)
        if entry.name in without or value is None:
            continue
        if isinstance(value, Path):
            value = str(value.relative_to(folder)) if value.is_relative_to(folder) else str(value.resolve())
        elif isinstance(value, np.ndarray):
            value = value.tolist()
        found.append(f"{entry.name} = {json.dumps(value, ensure_ascii=False)}")
    return found


def _checked(path: Path, kind: type, reported: dict[str, Any]) -> dict[str, Any]:
    """The table's values in the types of a record's fields.

    Raises:
        FileError: a key that is unknown, missing or of another type.
    """
    known, other = ({entry.name for entry in fields(each)} - set(NO_KEYS) for each in (kind, _other(kind)))
    unknown = sorted(set(reported) - known)
    if unknown and set(unknown) <= other:
        where = "above the first [[endcap]]" if kind is EndcapConfig else "under the [[endcap]] that it is of"
        raise FileError(f"{path}: {', '.join(unknown)} in the wrong place: write it {where}")
    if unknown:
        raise FileError(f"{path}: unknown key {', '.join(unknown)}: known are {', '.join(sorted(known))}")
    if kind is EndcapConfig and not {"name", "source"} <= set(reported):
        raise FileError(f"{path}: a [[endcap]] without name or source: give both")
    values: dict[str, Any] = {}
    for key, value in reported.items():
        if key in TEXTS:
            good = isinstance(value, str)
        elif key == "T_robot_endcap":
            good = _is_matrix(value)
        elif key == "relaxation":
            good = isinstance(value, list) and len(value) <= MOST_TERMS and all(_is_row(term, 3) for term in value)
        else:
            good = _is_number(value)
        if not good:
            raise FileError(
                f"{path}: {key} = {_short(value)} is of the wrong type or size: see the example of "
                f"python -m pydoc {EXAMPLE}"
            )
        if key in ("zero", "camera", "weights"):
            value = path.parent / value if value else None
        elif key == "method":
            value = value or None
        values[key] = value
    return values


def _other(kind: type) -> type:
    return LiveConfig if kind is EndcapConfig else EndcapConfig


def _is_matrix(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 4 and all(_is_row(row, 4) for row in value)


def _is_row(value: Any, length: int) -> bool:
    return isinstance(value, list) and len(value) == length and all(map(_is_number, value))


def _is_number(value: Any) -> bool:
    """Of a size that a float can have."""
    return isinstance(value, float) or (type(value) is int and abs(value) < 1 << 64)


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # thousands of digits
        text = type(value).__name__
    return printable(text if len(text) < 60 else text[:57] + "...")
