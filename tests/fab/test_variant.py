"""Another camera module or silicone: its variant has a folder, a cache entry and commands of its own."""

from __future__ import annotations

import json

import pytest

from cad import materials
from cad.errors import FileError
from cad.lens import VARIABLE
from cad.mold.layout import MoldLayout
from cad.options import chosen
from cad.params import EndcapParams
from fab import packed
from fab.cache import Cache
from fab.led_ring.__main__ import folder_name
from fab.slice.projects import read_export
from fab.variant import Variant

OTHER = "ELP-USBFHD01M-L170"
RELEASED = Variant(MoldLayout(EndcapParams(130.0, 8.0)))


@pytest.fixture
def other_camera(monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    usual = RELEASED.label, RELEASED.identity, RELEASED.command("slice")
    monkeypatch.setenv(VARIABLE, OTHER)
    return usual


def test_its_folder_identity_and_commands_name_it(other_camera):
    label, identity, command = other_camera
    assert (label, command) == ("D130_T8", "make slice D=130 T=8")
    assert RELEASED.label == f"D130_T8_{OTHER}"
    assert RELEASED.command("slice") == f"{VARIABLE}={OTHER} make slice D=130 T=8"
    assert RELEASED.identity != identity and json.dumps(RELEASED.identity)
    assert folder_name(EndcapParams(150.0, 9.0), 8) == f"led_ring_D150_T9_8leds_{OTHER}"


def test_base_and_camera_of_another_module_are_not_taken_from_the_cache(monkeypatch, tmp_path):
    keys = []
    monkeypatch.setattr(packed, "_kept", lambda _, key, __: keys.append(key) or [])
    for module in ("", OTHER, ""):
        monkeypatch.setenv(VARIABLE, module)
        packed.packed_group("hardware", RELEASED.layout, Cache(tmp_path))
    assert keys[0] == keys[2] != keys[1]


def test_a_missing_export_is_made_with_its_module_and_the_others_are_not_named(other_camera, tmp_path, monkeypatch):
    folder = tmp_path / RELEASED.label
    folder.mkdir()
    made = {"joint_clearance_mm": 0.15, "silicone": "Smooth-Sil 950"}
    (folder / "manifest.json").write_text(json.dumps(made))
    blank = Variant(RELEASED.layout, "blank")
    with pytest.raises(FileError, match=rf"`{VARIABLE}={OTHER} make molds D=130 T=8 robot=blank .*been made: D=130"):
        read_export(blank, tmp_path)
    monkeypatch.delenv(VARIABLE)
    with pytest.raises(FileError, match=r"run `make molds D=130 T=8 exports=\S+` first$"):
        read_export(RELEASED, tmp_path)


@pytest.fixture
def with_silicones(tmp_path, monkeypatch):
    """Adds rows to the table that are the last one's but for their names."""

    def add(*names: str) -> None:
        text = materials.TABLE.read_text(encoding="utf-8")
        numbers = text.splitlines()[-1].partition(",")[2]
        copy = tmp_path / "materials.csv"
        copy.write_text(text + "".join(f"{name},{numbers}\n" for name in names), encoding="utf-8")
        monkeypatch.setattr(materials, "TABLE", copy)
        materials.silicones.cache_clear()

    yield add
    monkeypatch.undo()
    materials.silicones.cache_clear()


def test_silicones_whose_names_a_folder_cannot_spell_have_folders_of_their_own(with_silicones):
    names = ["Силикон А", "Силикон Б", "Köraform 42 A", "Küraform 42 A"]
    with_silicones(*names)
    labels = {name: Variant(MoldLayout(EndcapParams(130.0, 8.0), 0.05, name)).label for name in names}
    assert len(set(labels.values())) == len(names) and all(label.isascii() for label in labels.values())
    assert Variant(MoldLayout(EndcapParams(130.0, 8.0), 0.15, "Smooth-Sil 940")).label == "D130_T8_Smooth-Sil-940"


@pytest.mark.parametrize("name", ["smooth-sil 950", "Smooth-Sil_950", "Smooth Sil 950"])
def test_no_row_takes_the_place_of_the_default_silicone(name, with_silicones):
    assert chosen("material", "smooth-SIL 950", materials.silicones(), "t") == materials.DEFAULT_SILICONE
    with_silicones(name)
    with pytest.raises(
        FileError, match=rf"materials.csv line 9 \({name}\): name='{name}' differs from 'Smooth-Sil 950'"
    ):
        materials.silicones()
