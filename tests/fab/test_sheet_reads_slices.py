"""What the sheet takes of `make slice`: whole, of this design and of this export, or refused in one line."""

from __future__ import annotations

import copy
import json

import pytest

from cad.errors import FileError, ParameterError
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.build_sheet.sliced import read_slices, require_sliced_for
from fab.slice.projects import Export
from fab.variant import Variant

PARAMS = EndcapParams(142.0, 7.5)
REGION = {"density_percent": 10.0, "pattern": "gyroid"}
PIECE = {
    "name": "interface", "grams": 8.5, "cost_usd": 0.3, "own_settings": {"zone": REGION},
    "settings": {**REGION, "walls": 2, "brim_mm": 0.0, "support": False, "grow_mm": 0.0},
}  # fmt: skip
PROJECT = {
    "name": "interface_infill", "material": "TPU 95A", "layer_mm": 0.2, "time_s": 60.0, "grams": 8.5, "pieces": [PIECE],
    "zone": {"fraction": 0.1, "open_share": 0.95},
}  # fmt: skip
PRINTER = {
    "name": "a1_mini", "title": "A1 mini", "size": "180", "nozzle_mm": 0.4, "prusa_printer": "", "orca_printer": "",
}  # fmt: skip
RECORD = {
    "digest": PARAMS.digest, "slicer": "PrusaSlicer", "printer": PRINTER, "projects": [PROJECT],
    "checks": [{"name": "base.empty_layers", "value": 0.0, "limit": "<= 0", "ok": True}],
}  # fmt: skip


@pytest.fixture
def export(tmp_path):
    (tmp_path / "manifest.json").write_text("{}")
    (tmp_path / "slice").mkdir()
    return Export(tmp_path, Variant(MoldLayout(PARAMS)), {})


def written(export, record):
    (export.folder / "slice" / "slice.json").write_text(record if isinstance(record, str) else json.dumps(record))
    return record


def test_slices_of_this_export_are_taken_and_of_an_earlier_one_left_out(export):
    assert read_slices(export) is None
    record = written(export, RECORD | {"manifest_sha256": export.manifest_sha256})
    assert read_slices(export) == record
    (export.folder / "manifest.json").write_text('{"another": "run"}')
    assert read_slices(export) is None


def test_slices_of_another_design_are_refused(export):
    written(export, RECORD | {"digest": "other"})
    with pytest.raises(FileError, match="another design"):
        read_slices(export)


def places(value, place=()):
    """Every place of a record."""
    yield place
    for key, own in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from places(own, (*place, key))


@pytest.mark.parametrize("place", [*places(RECORD)][1:], ids=lambda place: ".".join(map(str, place)))
def test_a_place_of_another_form_is_named(export, place):
    record = copy.deepcopy(RECORD)
    holder = record
    for key in place[:-1]:
        holder = holder[key]
    holder[place[-1]] = [[]]
    written(export, record)
    with pytest.raises(FileError, match=r"not what make slice writes.*run `make slice D=142 T=7.5 .*` again") as error:
        read_slices(export)
    assert "\n" not in str(error.value) and str(place[-1]) in str(error.value)
    del holder[place[-1]]
    written(export, record)
    if place[-2:] != ("own_settings", "zone"):  # regions may have any name
        with pytest.raises(FileError, match="not what make slice writes"):
            read_slices(export)


@pytest.mark.parametrize("text", ["{", "[]", "null"])
def test_what_is_no_record_is_refused(export, text):
    written(export, text)
    with pytest.raises(FileError, match="not what make slice writes"):
        read_slices(export)


def test_slices_of_another_printer_than_asked_are_refused():
    words = Variant(MoldLayout(PARAMS)).words
    require_sliced_for("", RECORD, words)
    require_sliced_for("a1_mini", RECORD, words)
    require_sliced_for("mk4", None, words)
    with pytest.raises(ParameterError, match=r"printer=mk4: it was sliced for a1_mini.*printer=mk4` first"):
        require_sliced_for("mk4", RECORD, words)


def test_the_command_that_slices_for_another_printer_names_the_camera_module(monkeypatch):
    """Without it the command read, or did not find, the export of the released module."""
    monkeypatch.setenv("ENDCAP_CAMERA", "ELP-USBFHD01M-L170")
    with pytest.raises(ParameterError, match=r"run `ENDCAP_CAMERA=ELP-USBFHD01M-L170 make slice D=\d+ .*printer=mk4`"):
        require_sliced_for("mk4", RECORD, Variant(MoldLayout(PARAMS)).words)
