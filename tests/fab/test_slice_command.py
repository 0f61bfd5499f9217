"""`make slice` at its command line, and the exports that it accepts."""

from __future__ import annotations

import dataclasses
import json
import time
from types import SimpleNamespace

import pytest

from cad.errors import FileError
from cad.identity import identity
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.slice import __main__ as command
from fab.slice.printers import printer
from fab.slice.projects import IN_EVERY_EXPORT, Export, read_export, read_part
from fab.slice.result import PieceResult, SliceResult, summary
from fab.slice.run import SlicerMissingError, find_slicer
from fab.slice.settings import part_settings
from fab.variant import Variant

SMALL = EndcapParams(100.0, 8.0)


SMALL_MOLD = Variant(MoldLayout(SMALL))


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["D=abc", "T=8"], "D=abc is not a number"),
        (["gcode=maybe"], "neither yes nor no"),
        (["plates=many"], "neither nested nor single"),
        (["printer=mk5"], "Choose one of mk4, x1c, a1_mini, ender3, generic180"),
        (["--quick"], "'--quick' is not an option"),
        ([], "run `make molds D=130 T=8 exports={exports}` first"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(words, expected, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("fab.slice.run.shutil.which", lambda name: f"/bin/{name}")
    assert command.main([*words, f"exports={tmp_path}"]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and expected.format(exports=tmp_path) in err and list(tmp_path.iterdir()) == []


def test_without_the_slicer_the_command_says_how_to_get_it(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("fab.slice.run.shutil.which", lambda name: None)
    assert command.main([f"exports={tmp_path}"]) == 2
    assert "apt-get install" in capsys.readouterr().err
    with pytest.raises(SlicerMissingError):
        find_slicer()


OTHER = {"digest": "other", "joint_clearance_mm": 0.15, "silicone": "Smooth-Sil 950", "parts": []}
PART = {"role": "printed", "material": "PLA", "quantity": 1, "volume_mm3": {"mesh": 1.0}, "files": {}}
WHOLE = {
    "parts": [PART | {"name": name} for name in sorted(IN_EVERY_EXPORT)],
    "checks": [{"name": "a.b", "value": 0.0, "limit": "<= 1", "ok": True}],
}


@pytest.mark.parametrize(
    ("lacking", "said"),
    [
        ({"checks": [1]}, "not subscriptable"),
        ({"checks": [{"name": "a.b"}]}, "'value'"),
        ({"parts": [part for part in WHOLE["parts"] if part["name"] != "base"]}, "no part base"),
        *(({"parts": [{k: v for k, v in part.items() if k != key} for part in WHOLE["parts"]]}, key) for key in PART),
        ({"parts": [part | {"files": []} for part in WHOLE["parts"]]}, "items"),
    ],
)
def test_a_manifest_that_lacks_something_is_one_line_with_the_command_that_writes_it(tmp_path, lacking, said):
    folder = tmp_path / SMALL.label
    folder.mkdir()
    layout = SMALL_MOLD.layout
    ours = {"digest": SMALL.digest, "joint_clearance_mm": layout.joint_clearance_mm, "silicone": SMALL_MOLD.silicone}
    (folder / "manifest.json").write_text(json.dumps(ours | WHOLE | lacking))
    with pytest.raises(FileError, match=f"{said}.*run `make molds D=100 T=8"):
        read_export(SMALL_MOLD, tmp_path)


def test_a_changed_or_foreign_export_is_refused(tmp_path):
    folder = tmp_path / SMALL.label
    folder.mkdir()
    (folder / "manifest.json").write_text("{}")
    with pytest.raises(FileError, match="not a manifest of ours"):
        read_export(SMALL_MOLD, tmp_path)
    (folder / "manifest.json").write_text(json.dumps(OTHER))
    with pytest.raises(FileError, match="other parameters"):
        read_export(SMALL_MOLD, tmp_path)
    ours = {"digest": SMALL.digest, "joint_clearance_mm": SMALL_MOLD.layout.joint_clearance_mm, "parts": []}
    made_of = identity(SMALL, SMALL_MOLD.silicone)
    (folder / "manifest.json").write_text(json.dumps(ours | {"silicone": SMALL_MOLD.silicone}))
    with pytest.raises(FileError, match=r"lacks what make molds writes \('checks'\): run `make molds D=100 T=8"):
        read_export(SMALL_MOLD, tmp_path)
    ours |= WHOLE  # of before identities: the released pattern
    (folder / "manifest.json").write_text(json.dumps(ours | {"silicone": SMALL_MOLD.silicone}))
    assert len(read_export(SMALL_MOLD, tmp_path).manifest["parts"]) == len(IN_EVERY_EXPORT)
    record = dataclasses.replace(made_of, aspects={**made_of.aspects, "dots": {"rings": "1-4"}}).record()
    (folder / "manifest.json").write_text(json.dumps(ours | {"silicone": SMALL_MOLD.silicone, "identity": record}))
    with pytest.raises(FileError, match=r"made for the dot pattern [0-9a-f]{8}, this endcap has the released"):
        read_export(SMALL_MOLD, tmp_path)
    (folder / "base.stl").write_bytes(b"changed")
    manifest = {"parts": [{"name": "base", "files": {"base.stl": "0" * 64}}]}
    with pytest.raises(FileError, match="changed since it was checked"):
        read_part(Export(folder, SMALL_MOLD, manifest), "base")


def test_a_variant_that_is_missing_names_those_that_have_been_made(tmp_path):
    other = Variant(MoldLayout(SMALL, 0.1, "Dragon Skin 30"))
    folder = tmp_path / other.label
    folder.mkdir()
    (folder / "manifest.json").write_text(json.dumps({"joint_clearance_mm": 0.1, "silicone": "Dragon Skin 30"}))
    (tmp_path / "D100_T8_notes").mkdir()
    with pytest.raises(FileError, match=r"first, or name what has been made: D=100 T=8 joint_clearance=0.1 material="):
        read_export(SMALL_MOLD, tmp_path)


def test_a_failing_gate_ends_with_status_1_and_leaves_nothing(tmp_path, capsys, monkeypatch):
    from fab.checks.check import Check

    bad = SimpleNamespace(checks=[Check("base.empty_layers", 2, high=0)])
    export = SimpleNamespace(folder=tmp_path, variant=SMALL_MOLD, manifest={})
    monkeypatch.setattr("fab.slice.run.find_slicer", lambda: "slicer")
    monkeypatch.setattr("fab.slice.projects.read_export", lambda *_: export)
    monkeypatch.setattr("fab.slice.projects.project_names", lambda _: ["base"])
    monkeypatch.setattr("fab.slice.projects.nested_plates", lambda *_: [SimpleNamespace(name="base")])
    monkeypatch.setattr(command, "_slice_one", lambda *_: bad)
    monkeypatch.setattr(command, "worker_pool", lambda _count: Inline())
    monkeypatch.setattr("fab.slice.result.summary", lambda *_: "")
    assert command.main(["D=100", "T=8", f"exports={tmp_path}"]) == 1
    assert "base.empty_layers = 2, wanted <= 0" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("manifest", "words", "expected"),
    [({}, [], "generic256"), ({"printer": "mk4"}, [], "mk4"), ({"printer": "mk4"}, ["printer=X1C"], "x1c"),
     ({"printer": "mk4"}, ["printer=generic256"], "generic256")],
)  # fmt: skip
def test_slices_are_for_the_printer_of_the_molds_where_none_is_named(manifest, words, expected, tmp_path, monkeypatch):
    used = []
    export = SimpleNamespace(folder=tmp_path, variant=SMALL_MOLD, manifest=manifest)
    monkeypatch.setattr("fab.slice.run.find_slicer", lambda: "slicer")
    monkeypatch.setattr("fab.slice.projects.read_export", lambda *_: export)
    monkeypatch.setattr(command, "slice_design", lambda _slicer, _export, how, *_: used.append(how.printer.name) or 0)
    assert command.main(["D=100", "T=8", f"exports={tmp_path}", *words]) == 0
    assert used == [expected]


def test_each_plate_has_its_own_seconds_whatever_its_neighbours_took(monkeypatch, caplog, tmp_path):
    spent = {"slow": 0.4, "quick": 0.0}
    ready = SimpleNamespace(checks=[])
    monkeypatch.setattr(command, "_slice_one", lambda _, __, plate, *___: time.sleep(spent[plate.name]) or ready)
    monkeypatch.setattr(command, "worker_pool", lambda _count: AtOnce())
    monkeypatch.setattr("fab.slice.result.summary", lambda *_: "")
    plates = [SimpleNamespace(name=name) for name in spent]
    how = command.SliceOptions(printer("mk4"))
    with caplog.at_level("INFO"):
        command._sliced_and_gated("slicer", SimpleNamespace(variant=SMALL_MOLD), plates, tmp_path, how, lambda: None)
    lines = [record.message for record in caplog.records]
    shown = {line.split()[2]: float(line.split()[0]) for line in lines}
    assert shown["slow"] >= 0.4 and shown["quick"] < 0.3


def test_the_sum_of_the_mold_counts_what_was_sliced_and_is_left_out_where_that_is_none_of_it():
    figures = SimpleNamespace(time_s=7200.0, grams=30.0, cost_usd=0.5, layers=9, floating_starts=0)
    spool = part_settings("base", "PLA")
    pieces = {name: PieceResult(name, spool, {}, grams) for name, grams in (("base", 10.0), ("hanger", 20.0))}

    def plate(*names):
        own = tuple(pieces[name] for name in names)
        return SliceResult("plate_1", own, names, 9, figures, None, 0.1, None, (), {})

    assert "mold:" not in summary([plate("base")])
    assert "mold: 2 h 00, 30 g" in summary([plate("base"), plate("hanger")])
    assert "mold: 1 h 20, 20 g" in summary([plate("base", "hanger")])  # two thirds of its plastic
    assert summary([plate("base", "hanger")], is_whole=False).splitlines()[-1].startswith("of the mold: 1 h 20, 20 g")
    assert "the paper" not in summary([plate("base", "hanger")], is_whole=False)


class AtOnce:
    """All work is done before anyone asks for it, as by workers side by side."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False

    def submit(self, call, *words):
        found = call(*words)
        return SimpleNamespace(result=lambda: found)


class Inline:
    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False

    def shutdown(self, **_):
        pass

    def submit(self, call, *words):
        return SimpleNamespace(result=lambda: call(*words))
