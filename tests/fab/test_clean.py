"""`make clean`: generated files go, everything else stays and is named."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest

from cad.whole_file import lock_if_free
from fab import clean
from fab.cache import ROOT
from fab.exports.whole_folder import whole_folder, write_record


def test_the_record_of_every_command_is_known():
    sources = [path.read_text(encoding="utf-8") for name in ("fab", "endcap") for path in (ROOT / name).rglob("*.py")]
    named = {name for text in sources for name in re.findall(r'^RECORD = "(.+)"$', text, re.MULTILINE)}
    assert named == set(clean.RECORDS)


def test_an_interruption_is_one_line(tmp_path, monkeypatch, capsys):
    def interrupted(_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(clean, "remove_partial", interrupted)
    assert clean.main(["--exports", str(tmp_path)]) == 130
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.fixture
def exports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An export with slices and a note, a data set, weights, a recording, a dead run, and the folder's README."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "exports"
    for final, record, name in ((folder / "D130_T8", "manifest.json", "base.stl"),) * 1:
        with whole_folder(final, record) as new:
            (new / name).write_text("solid")
            write_record(new, record, {})
    with whole_folder(folder / "D130_T8" / "slice", "slice.json") as new:
        (new / "base.prusa.3mf").write_text("project")
        write_record(new, "slice.json", {})
    with whole_folder(folder / "coupons", "coupons.json") as new:
        (new / "fit_plate.stl").write_text("plate")
        write_record(new, "coupons.json", {})
    (folder / "D130_T8" / "notes.txt").write_text("tried PETG")
    for name in ("data_D130_T8_static_1/shards/0.npz", "wrench_train/small.safetensors", "sensor3/take.mcap"):
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_text(name)
    (folder / ".D150_T9.partial-0a").mkdir()
    (folder / "README.md").write_text("kept by version control")
    return folder


def files(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


KEPT = ["D130_T8/notes.txt", "README.md", "data_D130_T8_static_1/shards/0.npz", "sensor3/take.mcap"]
KEPT += ["wrench_train/small.safetensors"]


def test_generated_files_go_and_the_rest_stays_and_is_named(exports, monkeypatch, capsys):
    monkeypatch.setattr(clean, "KEPT", {exports / "README.md"})
    assert clean.main(["--exports", str(exports)]) == 0
    assert files(exports) == KEPT
    assert sorted(os.listdir(exports)) == ["D130_T8", "README.md", "data_D130_T8_static_1", "sensor3", "wrench_train"]
    out = capsys.readouterr().out
    for name in (
        "D130_T8/ (1 files)",
        "data_D130_T8_static_1/",
        "sensor3/",
        "wrench_train/",
        "make clean-all SURE=yes",
    ):
        assert name in out
    assert "README" not in out


def test_a_changed_file_stays_with_its_record(exports):
    (exports / "D130_T8" / "base.stl").write_text("repaired")
    clean.remove_made(exports)
    assert "D130_T8/base.stl" in files(exports) and "D130_T8/manifest.json" in files(exports)
    assert "D130_T8/slice/slice.json" not in files(exports)


def test_a_record_that_points_outside_its_folder_removes_nothing(exports, capsys):
    record = exports / "D130_T8" / "manifest.json"
    record.write_text(json.dumps({"files": {"../sensor3/take.mcap": "0"}}))
    clean.remove_made(exports)
    assert "sensor3/take.mcap" in files(exports) and record.exists()
    assert "outside its folder" in capsys.readouterr().err


def test_a_run_that_is_still_writing_keeps_its_files(exports):
    with whole_folder(exports / "D200_T10", "manifest.json") as new:
        (new / "cup.stl").write_text("cup")
        write_record(new, "manifest.json", {})
        clean.remove_made(exports)
        assert (new / "cup.stl").exists()
    assert (exports / "D200_T10" / "cup.stl").exists()


def test_a_run_that_has_just_begun_keeps_its_folder(exports):
    with whole_folder(exports / "D200_T10", "manifest.json") as new:
        clean.remove_made(exports)
        (new / "cup.stl").write_text("cup")
        write_record(new, "manifest.json", {})
    assert (exports / "D200_T10" / "cup.stl").exists()


def test_a_folder_that_a_run_is_filling_stays_as_it_is(exports):
    before = files(exports / "D130_T8" / "slice")
    with lock_if_free(exports / "D130_T8" / "slice"):
        clean.remove_made(exports)
    assert files(exports / "D130_T8" / "slice") == before and not (exports / "D130_T8" / "manifest.json").exists()


def test_only_folders_that_lost_their_files_go(exports):
    for name in ("photos", "D130_T8/gcode", "D150_T9/slice"):
        (exports / name).mkdir(parents=True)
    clean.remove_made(exports)
    assert all((exports / name).is_dir() for name in ("photos", "D130_T8/gcode", "D150_T9/slice"))
    assert not (exports / "D130_T8" / "slice").exists() and not (exports / "coupons").exists()


def test_a_record_of_another_program_stays(exports):
    page = exports / "site" / "manifest.json"
    page.parent.mkdir()
    page.write_text(json.dumps({"name": "mine", "files": {"http://a/b": "x"}}))
    clean.remove_made(exports)
    assert page.exists()


def test_a_design_of_which_only_the_record_is_left_goes(exports):
    record = exports / "D150_T9" / "manifest.json"
    record.parent.mkdir()
    record.write_text(json.dumps({"parameters": {}, "digest": "0", "files": {"base.stl": "0"}}))
    clean.remove_made(exports)
    assert not record.parent.exists()


def test_everything_goes_only_when_asked_twice(exports, monkeypatch, capsys):
    monkeypatch.setattr(clean, "KEPT", {exports / "README.md"})
    before = files(exports)
    assert clean.main(["--all", "--exports", str(exports)]) == 2
    assert files(exports) == before and "SURE=yes" in capsys.readouterr().out
    assert clean.main(["--all", "--sure", "--exports", str(exports)]) == 0
    assert files(exports) == ["README.md"]


@pytest.mark.parametrize(("words", "work"), [([], "unlink"), (["--all", "--sure"], "rmtree")])
def test_what_cannot_be_removed_is_one_line_and_status_2(exports, monkeypatch, capsys, words, work):
    def refused(path: Path, *_: object, **__: object) -> None:
        raise PermissionError(1, "Operation not permitted", str(path))

    monkeypatch.setattr(*((Path, "unlink") if work == "unlink" else (clean.shutil, "rmtree")), refused)
    before = files(exports)
    assert clean.main(["--exports", str(exports), *words]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and "Operation not permitted: it stays" in err and str(exports) in err
    assert files(exports) == before


def test_an_exports_folder_that_is_not_there_is_clean(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for words in ([], ["--all", "--sure"]):
        assert clean.main(["--exports", str(tmp_path / "none"), *words]) == 0
