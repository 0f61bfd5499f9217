"""The bench that sends random designs through every command of the workshop: what it draws, and that it sees faults."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
import trimesh

from bench import bench_chain
from bench.bench_chain import Done, designs, made


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder that looks as one should."""
    (tmp_path / "slice").mkdir()
    (tmp_path / "sheet").mkdir()
    for name in ("index.html", "assembly.glb", "slice/plate_1.prusa.3mf"):
        (tmp_path / name).write_bytes(bytes(200_000))
    trimesh.creation.box().export(tmp_path / "base.stl")
    words = " ".join(designs(1, 1)[0].variant.words.split()[:2])
    (tmp_path / "sheet" / "build_sheet.html").write_text(
        f"<p>make ring {words}</p> files of make ring to a board house"
    )
    (tmp_path / "sheet" / "build_sheet.pdf").write_bytes(b"/Type /Pages /Type/Page /Type /Page")
    return tmp_path


def test_every_design_drawn_is_another_and_can_be_made():
    drawn = designs(5, 8)
    assert len({each.typed for each in drawn}) == 8
    assert len({each.variant.silicone for each in drawn}) > 2 and len({each.printer for each in drawn}) > 2
    assert sum("dots=" in each.typed for each in drawn) == 4
    assert sum("joint_clearance=" in each.typed for each in drawn) == 4
    assert designs(5, 8) == drawn


def test_a_folder_as_it_should_be_has_nothing_wrong(folder):
    done = Done(designs(1, 1)[0])
    bench_chain._read(done, folder)
    assert (done.wrong, done.plates, done.pages, done.files) == ([], 1, 2, 6)


@pytest.mark.parametrize("fault", ["base.stl is open", "assembly.glb has 9 bytes", "sheet: make ring D=130 T=8"])
def test_what_is_wrong_is_seen(folder, fault):
    if "stl" in fault:
        box = trimesh.creation.box()
        trimesh.Trimesh(box.vertices, box.faces[1:], process=False).export(folder / "base.stl")
    elif "glb" in fault:
        (folder / "assembly.glb").write_bytes(bytes(9))
    else:
        (folder / "sheet" / "build_sheet.html").write_text("<p>make ring D=130 T=8</p>")
    done = Done(designs(1, 1)[0])
    bench_chain._read(done, folder)
    assert done.wrong == [fault]


def test_a_command_that_fails_is_named_with_its_last_line(tmp_path, monkeypatch):
    ended = subprocess.CompletedProcess([], 1, "", "first\nlast line\n")
    monkeypatch.setattr(bench_chain.subprocess, "run", lambda *_, **__: ended)
    assert made(designs(1, 1)[0], tmp_path, tmp_path).wrong == ["molds: status 1: last line"]
