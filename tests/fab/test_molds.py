"""The command line: one small design made twice, and bad input."""

from __future__ import annotations

import hashlib
import json
import re
from importlib import metadata
from pathlib import Path

import pytest
from started_molds import SMALL, left_in, start

from cad.errors import ParameterError
from cad.materials import silicones
from cad.options import make_variables, parse_length, parse_options
from cad.params import EndcapParams
from cad.robot_sides import robot_sides
from fab import molds
from fab.command import VARIANT_DEFAULTS, parse_variant
from fab.slice.printers import printer, printers


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The whole command: folder and what was printed."""
    cache = tmp_path_factory.mktemp("cache")

    def made(use: str) -> tuple[Path, str, str]:
        exports = tmp_path_factory.mktemp("exports")
        process = start(*SMALL, f"exports={exports}", f"cache={use}", cache=cache)
        out, err = process.communicate()
        assert process.returncode == 0, err
        return exports / "D100_T8", out, err

    return made


@pytest.fixture(scope="module")
def first(run):
    return run("yes")


@pytest.fixture(scope="module")
def written(first):
    return first[0], json.loads((first[0] / "manifest.json").read_text())


def test_in_a_pipe_the_command_prints_a_plain_line_a_step_and_one_line_of_result(first):
    folder, out, err = first
    assert len(out.splitlines()) == 1 and str(folder) in out and "checks passed" in out
    assert len(err.splitlines()) > 5 and "\r" not in err and "\033" not in err
    assert all(re.fullmatch(r" *\d+\.\d s \S.*", line) for line in err.splitlines()), err


def test_manifest_has_parameters_and_digest(written):
    params = EndcapParams(100.0, 8.0)
    assert written[1]["parameters"] == {"diameter_mm": 100.0, "wall_mm": 8.0}
    assert written[1]["digest"] == params.digest
    assert written[1]["toolkit"] == f"endcap-toolkit {metadata.version('endcap-toolkit')}"


def test_manifest_names_every_part_with_its_figures(written):
    folder, manifest = written
    parts = {part["name"]: part for part in manifest["parts"]}
    mold = [f"cup_{half}_{k}" for half in ("bowl", "collar") for k in (1, 2, 3)]
    mold += ["core_centre", *(f"core_{kind}_{k}" for kind in ("key", "wedge") for k in (1, 2, 3)), "hanger"]
    assert set(parts) == {*mold, "interface", "base", "ring_spacer", "arm_adapter", "shell", "led_ring", "camera"}
    for name, part in parts.items():
        assert part["role"] in ("printed", "cast", "bought") and part["quantity"] >= 1 and part["material"]
        assert part["volume_mm3"]["solid"] > 0 and part["volume_mm3"]["mesh"] > 0
        assert all(low < high for low, high in zip(*part["bounding_box_mm"], strict=True))
        assert part["triangles"] > 0
        if part["role"] == "bought":
            assert part["files"] == {}
            continue
        assert part["watertight"] is True and part["self_intersections"] == 0
        project = {f"{name}.3mf"} if part["role"] == "printed" else set()
        assert set(part["files"]) == {f"{name}.stl", f"{name}.step"} | project
        assert (folder / f"{name}.stl").stat().st_size == 84 + 50 * part["triangles"]


def test_manifest_has_the_true_digest_of_every_file_and_there_are_no_others(written):
    folder, manifest = written
    digests = dict(manifest["files"])
    for part in manifest["parts"]:
        digests |= part["files"]
    assert {"assembly.step", "assembly.glb", "exploded.png", "section.png", "parts.png"} <= set(manifest["files"])
    assert set(digests) | {"manifest.json"} == {path.name for path in folder.iterdir()}
    for name, digest in digests.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest, name


def test_manifest_has_every_check_with_its_number(written):
    checks = {check["name"]: check for check in written[1]["checks"]}
    assert len(checks) == len(written[1]["checks"]) > 200
    assert all(check["ok"] is True for check in checks.values())
    assert all(isinstance(check["value"], (int, float)) and check["limit"] for check in checks.values())
    wanted = ["cavity.balance_error_ratio", "cavity.wall_error_mm", "cavity.air_traps", "cavity.leak_ratio"]
    wanted += ["endcap.overlap_mm3", "mold.overlap_mm3", "bumps.count", "bumps.position_error_mm"]
    wanted += [f"{name}.screw_axis_error_mm" for name in ("interface", "base", "hanger")]
    for part in written[1]["parts"]:
        name = part["name"]
        if part["role"] != "bought":
            wanted += [f"{name}.watertight", f"{name}.self_intersections", f"{name}.step_volume_error_ratio"]
        if name.startswith(("core_", "cup_")):
            wanted += [f"{name}.{what}" for what in ("way_out_penetration_mm", "way_out_gap_mm", "rim_strain")]
    assert [name for name in wanted if name not in checks] == []


@pytest.mark.long
def test_a_second_run_reproduces_every_mesh_and_the_manifest(run, first):
    folder, out, _ = run("no")
    names = [*sorted(path.name for path in first[0].glob("*.stl")), "manifest.json"]
    assert len(names) > 15 and "from the cache" not in out
    assert [n for n in names if (first[0] / n).read_bytes() != (folder / n).read_bytes()] == []


def test_the_cache_gives_the_same_bytes_without_building_anything(run, first):
    folder, out, err = run("yes")
    names = sorted(path.name for path in first[0].iterdir())
    assert names == sorted(path.name for path in folder.iterdir())
    assert [n for n in names if (first[0] / n).read_bytes() != (folder / n).read_bytes()] == []
    assert "from the cache" in out and "from the cache" not in first[1]
    assert [line.split(" s ")[1] for line in err.splitlines()] == ["cache"]


# --- bad input ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["D=abc", "T=8"], "D=abc is not a number"),
        (["D=130mm", "T=8"], "D=130mm is not a number: give plain millimetres without a unit"),
        (["D=nan", "T=8"], "D=nan is not a number"),
        (["D=130", "T=inf"], "T=inf is not a number"),
        (["D=-130", "T=8"], "D=-130 is not a positive"),
        (["D=5.118", "T=8"], "looks like inches"),
        (["D=130", "T=40"], "T=40 outside 6.5..13"),
        (["D=130", "T=0.3"], "T=0.3 outside 6.5..13"),
        (["d=130"], "'d=130' is not an option: did you mean D=130?"),
        (["clearance=0.2"], "did you mean joint_clearance=0.2?"),
        (["D=\uff11\uff13\uff10", "T=8"], "is not a number: give plain millimetres"),
        (["D=1_30", "T=8"], "D=1_30 is not a number"),
        (["D=1e2", "T=8"], "D=1e2 is not a number"),
        (["D=130;T=10", "T=8"], "D=130;T=10 is not a number"),
        (["150", "10"], "'150' is not an option: name each number"),
        (["D=150"], "D=150 without T: a design is two numbers"),
        (["D=100"], "for example D=100 T=8"),
        (["T=22"], "for example D=250 T=22"),
        (["D=90"], "D=90 outside"),
        (["D=130", "T=8", "D=150"], "D is given twice (130 and 150)"),
        (["material=Jelly"], "material=Jelly is not in cad/materials.csv"),
        (["material=dragon skin"], "did you mean Dragon Skin 30 or Dragon Skin 20"),
        (["D=300"], "D=300 outside"),
        (["printer=a1mini"], "did you mean a1_mini? Choose one of mk4"),
        (["printer=ender"], "did you mean ender3?"),
        (["robot=blnk"], "did you mean blank?"),
        (["--fast"], "'--fast' is not an option"),
        (["D"], "'D' is not an option"),
        (["D="], "'D=' has no value: give D=..., or leave D out"),
    ],
)
def test_bad_input_gets_one_line_status_2_and_no_files(words, expected, tmp_path, capsys):
    exports = tmp_path / "exports"
    assert molds.main([*words, f"exports={exports}"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and len(err.splitlines()) == 1
    assert err.startswith("make molds: ") and expected in err
    assert not exports.exists()


def test_an_exports_folder_that_cannot_be_made_gets_one_line_and_status_2(tmp_path):
    (tmp_path / "file").write_text("in the way")
    process = start(*SMALL, f"exports={tmp_path / 'file' / 'exports'}")
    out, err = process.communicate()
    assert process.returncode == 2 and out == "" and len(err.splitlines()) == 1
    assert "exports=" in err and "Not a directory" in err and "exports=DIR" in err
    assert left_in(tmp_path) == ["file"]


def test_help_names_every_option_and_status(capsys):
    with pytest.raises(SystemExit) as caught:
        molds.main(["--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert [word for word in ("D=130", "T=8", "exports=DIR", "exit status") if word not in text] == []


def test_parsing():
    assert parse_options(["D=99", "T=6"], VARIANT_DEFAULTS) == {**VARIANT_DEFAULTS, "D": "99", "T": "6"}
    assert parse_options([], VARIANT_DEFAULTS) == VARIANT_DEFAULTS
    assert parse_length("D", "130.5") == 130.5
    with pytest.raises(ParameterError):
        parse_length("D", "5 in")


@pytest.mark.parametrize(
    ("name", "text", "asked_for"),
    [("D", "5 in", "millimetres"), ("gyroid", "10%", "fraction"), ("leds", "8x", "number of LEDs")],
)
def test_what_is_no_number_is_asked_for_in_its_own_unit_and_in_one_line(name, text, asked_for):
    with pytest.raises(ParameterError, match=asked_for) as caught:
        parse_length(name, text)
    assert name in ("D",) or "millimetres" not in str(caught.value)
    with pytest.raises(ParameterError, match=r"\(5002 characters\)") as caught:
        parse_length(name, "1\n" + "9" * 5000)
    assert len(str(caught.value)) < 200 and "\n" not in str(caught.value)


def test_variables_of_make_arrive_as_they_were_typed():
    flags = r"k -j2 --jobserver-auth=3,4 -- VENV=x material=Dragon\ Skin\ 30 exports=/a\\b$$c T:=8 D=130;T=10 PYTHON=p"
    assert make_variables(flags) == ["D=130;T=10", "T=8", "exports=/a\\b$c", "material=Dragon Skin 30"]
    assert make_variables("") == make_variables("kw") == []


def test_variants_have_folders_of_their_own():
    def label(*words):
        return parse_variant(parse_options(["D=130", "T=8", *words], VARIANT_DEFAULTS)).label

    assert label() == label("joint_clearance=0.15", "material=Smooth-Sil 950") == "D130_T8"
    others = [["joint_clearance=0.2"], ["joint_clearance=0.20001"], ["joint_clearance=0.2000001"]]
    others += [["material=Dragon Skin 30"], ["material=Ecoflex 00-50", "joint_clearance=0.1"], ["robot=blank"]]
    labels = [label(*words) for words in others]
    assert labels[0] == "D130_T8_c0.2" and labels[3] == "D130_T8_Dragon-Skin-30"
    assert len({*labels, label()}) == len(others) + 1
    assert EndcapParams(130.0000001, 8).label != EndcapParams(130, 8).label


def test_names_of_tables_count_in_any_case_and_no_two_differ_in_case_alone():
    variant = parse_variant({**VARIANT_DEFAULTS, "material": "dragon SKIN 30", "robot": "BLANK"})
    assert (variant.silicone, variant.robot) == ("Dragon Skin 30", "blank")
    assert printer("X1C") is printer("x1c")
    for table in (silicones(), robot_sides(), printers()):
        assert len({name.lower() for name in table}) == len(table)
