"""Reader of slice.json, which `make slice` writes, for the build sheet."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from cad.errors import FileError, ParameterError
from cad.lens import camera_setting
from fab.slice.projects import Export
from fab.variant import printer_option

EVERY = "*"  # key of the form that all entries of a table share
SETTINGS = {"density_percent": float, "pattern": str}
PIECE = {
    "name": str, "grams": float, "cost_usd": float, "own_settings": {EVERY: SETTINGS},
    "settings": SETTINGS | {"walls": float, "brim_mm": float, "support": bool, "grow_mm": float},
}  # fmt: skip
ZONE = {"fraction": float, "open_share": float}
PROJECT = {
    "name": str, "material": str, "layer_mm": float, "time_s": float, "grams": float, "pieces": [PIECE],
    "zone": (ZONE, None),
}  # fmt: skip
PRINTER = {"name": str, "title": str, "size": str, "nozzle_mm": float, "prusa_printer": str, "orca_printer": str}
CHECK = {"name": str, "value": float, "limit": str, "ok": bool}
FORM = {"digest": str, "slicer": str, "printer": PRINTER, "projects": [PROJECT], "checks": [CHECK]}


def read_slices(export: Export) -> dict[str, Any] | None:
    """Read ``slice.json`` of this export; ``None`` where ``make slice`` has not run since ``make molds``.

    Args:
        export: folder of `make molds`.

    Raises:
        FileError: the file cannot be read, or belongs to another design.
    """
    path = export.folder / "slice" / "slice.json"
    if not path.exists():
        return None
    again = f"run `{camera_setting()}make slice {export.words}` again"
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: not what make slice writes ({error}): {again}") from error
    if wrong := _misfit(record, FORM):
        raise FileError(f"{path}: not what make slice writes ({wrong}): {again}")
    if record["digest"] != export.params.digest:
        raise FileError(f"{path}: belongs to another design: {again}")
    return dict(record) if record.get("manifest_sha256") == export.manifest_sha256 else None


def require_sliced_for(asked_printer: str, sliced: Mapping[str, Any] | None, words: str) -> None:
    """Refuse slices of another printer than the one given to the command of the sheet.

    Args:
        asked_printer: name in the printers' table; empty where none was given.
        sliced: ``slice.json``; None where it has not been sliced.
        words: options that name the export.

    Raises:
        ParameterError: the printers differ; the message has the command that slices for the given one.
    """
    found = sliced["printer"]["name"] if sliced else ""
    if asked_printer and found and found != asked_printer:
        raise ParameterError(
            f"printer={asked_printer}: it was sliced for {found}, and the sheet prints those plates: run "
            f"`{camera_setting()}make slice {words} {printer_option(asked_printer)}` first, or leave printer= out",
            name="printer",
            value=asked_printer,
        )


def _misfit(value: Any, form: Any, place: str = "") -> str:
    """Path of the first entry that does not have the form; empty where all have.

    A form is a type (``float``: any number), a dictionary of forms by key, a list whose entries all have one form, or
    a tuple of a form and None: either of them.
    """
    name = place or "the file"
    if isinstance(form, tuple):
        return "" if value is None else _misfit(value, form[0], place)
    if isinstance(form, dict):
        if not isinstance(value, dict):
            return f"{name} is no table"
        found = (
            _misfit(value[key], own, f"{place}.{key}".lstrip(".")) if key in value else f"{name} has no {key}"
            for key, own in (dict.fromkeys(value, form[EVERY]) if EVERY in form else form).items()
        )
    elif isinstance(form, list):
        if not isinstance(value, list) or not value:
            return f"{name} is no list of at least one"
        found = (_misfit(entry, form[0], f"{place}[{number}]") for number, entry in enumerate(value))
    else:
        kinds = (int, float) if form is float else form
        fits = isinstance(value, kinds) and (form is bool or not isinstance(value, bool))
        return "" if fits else f"{name} is {value!r}"
    return next((words for words in found if words), "")
