"""Solids as STEP: equal bytes from equal solids, and one line where the disk is full."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
import trimesh
from build123d import Box, import_step

from cad.errors import FileError
from fab.coupons.__main__ import write_parts
from fab.exports.writer import write_solids

FULL = "/dev/full"  # every write fails with "No space left on device"


def one_part(name: str) -> SimpleNamespace:
    return SimpleNamespace(parts={name: SimpleNamespace(role="printed", solid=Box(1, 2, 3))})


def test_a_solid_comes_back_and_a_second_time_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_solids(one_part(name), tmp_path)
    assert import_step(tmp_path / "a.step").volume == pytest.approx(6)
    assert (tmp_path / "a.step").read_bytes() == (tmp_path / "b.step").read_bytes()


def test_a_full_disk_is_one_line_with_what_to_do(tmp_path):
    (tmp_path / "base.step").symlink_to(FULL)
    message = r"^base\.step: cannot be written .*: free some space or name another folder with exports=DIR$"
    with pytest.raises(FileError, match=message):
        write_solids(one_part("base"), tmp_path)
    with pytest.raises(FileError, match=message):
        write_parts(one_part("base").parts, {"base": trimesh.creation.box((1.0, 2.0, 3.0))}, tmp_path)
