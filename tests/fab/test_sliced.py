"""A plate that an earlier run sliced is not sliced again, and what it is found by is all that its numbers depend on."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import trimesh

from cad.params import EndcapParams
from fab.cache import Cache
from fab.exports.whole_folder import file_sha256
from fab.slice import result as result_module
from fab.slice import sliced as sliced_module
from fab.slice.measure import PrintFigures, ZoneFigures
from fab.slice.printers import printer
from fab.slice.project_3mf import Project, Volume, single
from fab.slice.result import slice_project
from fab.slice.run import NAMES, ModelInfo
from fab.slice.settings import part_settings
from fab.slice.sliced import Sliced, keep_sliced, measure_project, read_sliced, sliced_key

SMALL, OTHER = EndcapParams(100.0, 8.0), EndcapParams(100.0, 8.0, gyroid=0.11)
FIGURES = PrintFigures(3600.1, 1 / 3, 0.007, 15, 0, 2, (30.1, 20.2, 3.0), 0.0, 1e-17)
MADE = Sliced(ModelInfo(True, 1, ("edges_fixed = 2",)), ("a warning",), FIGURES, None, {"base": 0.4, "hanger": 0.6})
WITH_ZONE = replace(MADE, zone=ZoneFigures(0.1001, 0.92, 0.93, 0.8))
SLICER = next((path for name in NAMES if (path := shutil.which(name))), None)


def plate(name: str = "ring_spacer", height_mm: float = 3.0) -> Project:
    mesh = trimesh.creation.box((30, 20, height_mm), transform=trimesh.transformations.translation_matrix((0, 0, 1.5)))
    return single(name, part_settings("ring_spacer", "PLA"), (Volume("ring_spacer", mesh),))


@pytest.fixture
def cache(tmp_path) -> Cache:
    return Cache(tmp_path / "cache")


@pytest.fixture
def slicer(tmp_path) -> str:
    program = tmp_path / "prusa-slicer"
    program.write_text("#!/bin/sh\necho PrusaSlicer-2.5.0\n")
    program.chmod(0o755)
    sliced_module._slicer_digest.cache_clear()
    return str(program)


@pytest.mark.parametrize("made", [MADE, WITH_ZONE])
def test_what_is_kept_comes_back_to_the_last_digit(cache, made):
    assert read_sliced(cache, "a") is None
    keep_sliced(cache, "a", made)
    assert read_sliced(cache, "a") == replace(made, is_kept=True)


def test_the_key_holds_the_file_the_printer_the_spool_the_slicer_and_the_design_of_a_zone(cache, slicer, tmp_path):
    written = tmp_path / "a.3mf"
    written.write_bytes(b"project")

    def key(project: Project, params: EndcapParams = SMALL) -> str:
        return sliced_key(cache, slicer, project, file_sha256(written), params)

    first, zoned = key(plate()), key(plate("interface_infill"))
    assert key(plate()) == first and key(plate(), OTHER) == first  # a part without a zone is the same in both designs
    assert key(plate("interface_infill"), OTHER) != zoned != first
    piece = plate().pieces[0]
    dear = replace(piece.settings, filament=replace(piece.settings.filament, price_usd_kg=99.0))
    assert key(replace(plate(), pieces=(replace(piece, settings=dear),))) != first
    elsewhere = replace(piece.settings, printer=printer("mk4"))
    assert key(replace(plate(), pieces=(replace(piece, settings=elsewhere),))) != first
    written.write_bytes(b"changed")
    assert key(plate()) != first
    written.write_bytes(b"project")
    Path(slicer).write_text("#!/bin/sh\necho PrusaSlicer-2.6.0\n")
    sliced_module._slicer_digest.cache_clear()
    assert key(plate()) != first


def test_a_project_is_sliced_once_and_anew_for_its_gcode_or_without_a_cache(cache, slicer, tmp_path, monkeypatch):
    calls = []
    measured = replace(MADE, info=ModelInfo(True, 1, ()), shares={"ring_spacer": 1.0})
    monkeypatch.setattr(result_module, "measure_project", lambda *_: calls.append(1) or measured)

    def run(keep_gcode: bool = False, where: Cache | None = cache):
        return slice_project(slicer, plate(), tmp_path, SMALL, keep_gcode, where)

    first, again = run(), run()
    assert len(calls) == 1 and again.record() == first.record() and (first.is_kept, again.is_kept) == (False, True)
    run(keep_gcode=True), run(where=None)
    assert len(calls) == 3


def test_what_fails_a_gate_is_sliced_again(cache, slicer, tmp_path, monkeypatch):
    calls = []
    torn = replace(MADE, info=ModelInfo(False, 1, ()), shares={"ring_spacer": 1.0})
    monkeypatch.setattr(result_module, "measure_project", lambda *_: calls.append(1) or torn)
    for _ in range(2):
        result = slice_project(slicer, plate(), tmp_path, SMALL, False, cache)
        assert [check.name for check in result.checks if not check.ok] == ["ring_spacer.slicer_manifold"]
    assert len(calls) == 2


@pytest.mark.skipif(SLICER is None, reason="PrusaSlicer is not installed: run scripts/slicer.sh")
def test_the_slicers_own_numbers_come_back(cache, tmp_path, monkeypatch):
    first = slice_project(SLICER, plate(), tmp_path, SMALL, False, cache)
    monkeypatch.setattr(result_module, "measure_project", None)
    again = slice_project(SLICER, plate(), tmp_path, SMALL, False, cache)
    assert again.is_kept and replace(again, is_kept=False) == first
    assert json.dumps(again.record()) == json.dumps(first.record())
    monkeypatch.setattr(result_module, "measure_project", measure_project)
    assert not slice_project(SLICER, plate(height_mm=4.0), tmp_path, SMALL, False, cache).is_kept
