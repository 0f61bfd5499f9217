"""The command robot-model: masses against closed forms, the folder whole or not at all, one line for bad words."""

from __future__ import annotations

import csv
import json
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import trimesh

from cad.arm_adapter import adapter_part
from cad.base import base_part
from cad.camera import camera_part
from cad.interface import build_flange
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from endcap.robot_model import __main__ as command
from endcap.robot_model import checked, folder, usd
from endcap.robot_model.fasteners import fasteners_inertial, tube_inertial
from endcap.robot_model.parts import EndcapParts, endcap_parts, printed_inertial, solid_inertial
from endcap.robot_model.urdf import endcap_urdf
from fab.build_sheet.plastic import estimated_part_g
from fab.clean import remove_made
from fab.meshing.mesh import from_manifold, tessellate, to_manifold
from fab.slice.filaments import filament
from fab.variant import Variant
from sensing.simulator.robot_model.model import MOVING_SHARE, robot_model

SIDES_MM = np.array([40.0, 60.0, 100.0])


def box(offset_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(SIDES_MM)
    mesh.apply_translation(offset_mm)
    return mesh


def parts(variant, progress) -> EndcapParts:
    """Stands in for the CAD."""
    drawn = {name: trimesh.creation.icosphere(3, 0.05) for name in ("base", "shell")}
    return EndcapParts({"base": solid_inertial(box((0, 0, -10)), 1.24)}, solid_inertial(box((0, 0, 50)), 1.24), drawn)


@pytest.fixture(scope="module")
def released_meshes():
    """Of the parts that the endcap's screws hold together, at D=130 T=8; the interface without its gyroid."""
    params = EndcapParams(130.0, 8.0)
    solids = {"base": base_part, "arm_adapter": adapter_part, "camera": camera_part}
    meshes = {name: tessellate(make(params).solid) for name, make in solids.items()}
    return meshes | {"interface": tessellate(build_flange(params))}


@pytest.fixture
def stub(monkeypatch):
    monkeypatch.setattr(folder, "endcap_parts", parts)


def test_mass_and_inertia_of_a_box_and_of_a_ball():
    a, b, c = SIDES_MM / 1000
    found = solid_inertial(box((5, -3, 20)), 1.2)
    assert found.mass_kg == pytest.approx(1200 * a * b * c)
    assert found.centre_m == pytest.approx([0.005, -0.003, 0.02])
    diagonal = found.mass_kg / 12 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    assert found.inertia_kg_m2 == pytest.approx(np.diag(diagonal), abs=1e-12)
    ball = solid_inertial(trimesh.creation.icosphere(5, 50.0), 1.0)
    assert ball.inertia_kg_m2 == pytest.approx(0.4 * ball.mass_kg * 0.05**2 * np.eye(3), rel=2e-3, abs=1e-9)


def test_base_and_moving_shell_are_together_all_parts():
    made = parts(None, None)
    bodies, silicone, base = made.bodies, made.silicone, made.by_part["base"]
    assert bodies.shell.mass_kg == pytest.approx(MOVING_SHARE * silicone.mass_kg)
    whole = base + silicone
    assert bodies.whole.mass_kg == pytest.approx(whole.mass_kg)
    assert bodies.whole.centre_m == pytest.approx(whole.centre_m)
    assert bodies.whole.inertia_kg_m2 == pytest.approx(whole.inertia_kg_m2)


def test_the_parts_of_an_endcap_weigh_their_materials_and_none_counts_twice(monkeypatch):
    """Boxes stand in for the CAD: silicone fills the shell less the gyroid, which is TPU, as the flange is."""
    variant = Variant(MoldLayout(EndcapParams(150.0, 9.0), silicone="Dragon Skin 30"))
    flange_mm = variant.params.flange_thickness_mm
    flange, gyroid = (trimesh.creation.box((60.0, 60.0, high)) for high in (flange_mm, 20.0))
    flange.apply_translation((0.0, 0.0, flange_mm / 2))
    gyroid.apply_scale((0.5, 0.5, 1.0)).apply_translation((0.0, 0.0, flange_mm + 10.0))
    interface = from_manifold(to_manifold(flange) + to_manifold(gyroid))
    bought = ("led_ring", trimesh.creation.box((50.0, 50.0, 2.0))), ("camera", trimesh.creation.box((38.0, 38.0, 20.0)))
    hardware = [(SimpleNamespace(name="base", material="PLA", role="printed"), box((0, 0, -60)))]
    hardware += [(SimpleNamespace(name=name, material=name, role="bought"), mesh) for name, mesh in bought]
    packed = [SimpleNamespace(unpacked=lambda pair=pair: pair) for pair in hardware]
    screws = tube_inertial((0.0, 0.0), 0.0, 6.0, 0.0, 100.0)
    stand_ins = {
        "packed_group": packed,
        "core_body": None,
        "shell_part": SimpleNamespace(solid=None),
        "tessellate": box((0, 0, 60)),
        "kept_interface_mesh": SimpleNamespace(mesh=interface),
        "fasteners_inertial": screws,
    }
    for name, answer in stand_ins.items():
        monkeypatch.setattr(f"endcap.robot_model.parts.{name}", lambda *_, answer=answer: answer)
    made = endcap_parts(variant, lambda _: None)
    grams = {name: 1000 * part.mass_kg for name, part in made.by_part.items()}
    gyroid_cm3, flange_cm3 = 30 * 30 * 20 / 1000, 60 * 60 * flange_mm / 1000
    assert 1000 * made.silicone.mass_kg == pytest.approx(1.08 * (240.0 - gyroid_cm3))
    assert grams.pop("interface") == pytest.approx(filament("TPU 95A").density_g_cm3 * (gyroid_cm3 + flange_cm3))
    assert grams.pop("camera") + grams.pop("led_ring") == pytest.approx(35.0)
    assert grams.pop("fasteners") == pytest.approx(1000 * screws.mass_kg)
    assert grams.pop("base") == pytest.approx(estimated_part_g("base", "PLA", hardware[0][1])) and not grams
    assert made.drawn["shell"].bounds == pytest.approx(0.001 * box((0, 0, 60)).bounds)
    assert made.drawn["base"].bounds[:, 2] == pytest.approx([-0.11, 0.001 * max(flange_mm, 10.0)])  # and no gyroid


def test_the_screws_of_the_endcap_weigh_what_their_standards_say(released_meshes):
    """They were left out: 33 g of steel and brass, at D=99 a tenth of all else."""
    params = EndcapParams(130.0, 8.0)
    found = fasteners_inertial(params, released_meshes)
    # As suppliers list them, g: M3 x 8, M4 x 20, nut DIN 562, washer ISO 7092, insert, M2 x 8 for plastic.
    expected_g = 10 * 0.88 + 5 * 2.9 + 10 * 0.37 + 10 * 0.08 + 5 * 1.1 + 4 * 0.2
    assert 1000 * found.mass_kg == pytest.approx(expected_g, rel=0.1)
    assert found.centre_m[:2] == pytest.approx([0.0, 0.0], abs=1e-9)  # circles of five and ten, a square of four
    assert -0.036 < found.centre_m[2] < 0.004  # between the adapter's lower face and the nuts
    assert found.inertia_kg_m2[2, 2] < found.mass_kg * 0.06**2  # none beyond the lugs' circle


def test_a_tube_is_a_cylinder_less_its_bore():
    outer, inner = (trimesh.creation.cylinder(radius, 12.0, sections=720) for radius in (5.0, 3.0))
    for mesh in (outer, inner):
        mesh.apply_translation([20.0, -7.0, 4.0])
    wanted = solid_inertial(outer, 7.85) + solid_inertial(inner, 7.85).times(-1)
    found = tube_inertial((20.0, -7.0), 6.0, 10.0, 10.0, -2.0)
    assert found.mass_kg == pytest.approx(wanted.mass_kg, rel=1e-4)
    assert found.centre_m == pytest.approx(wanted.centre_m)
    assert found.inertia_kg_m2 == pytest.approx(wanted.inertia_kg_m2, rel=1e-3, abs=1e-12)


@pytest.mark.parametrize(("size", "base_g", "adapter_g"), [((150.0, 9.0), 117.7, 89.3), ((213.7, 17.3), 230.3, 124.6)])
def test_a_printed_part_weighs_what_its_sliced_file_does(size, base_g, adapter_g):
    """`make slice` measured them; a skin of 1.5 mm on every face made the base 6 and 9 % too heavy."""
    params = EndcapParams(*size)
    for part, sliced_g in ((base_part(params), base_g), (adapter_part(params), adapter_g)):
        mesh = tessellate(part.solid)
        found, solid = printed_inertial(part, mesh), solid_inertial(mesh, 1.24)
        assert 1000 * found.mass_kg == pytest.approx(sliced_g, rel=0.025)
        assert found.centre_m == pytest.approx(solid.centre_m)
        assert found.inertia_kg_m2 / found.mass_kg == pytest.approx(solid.inertia_kg_m2 / solid.mass_kg)


def test_the_folder_is_written_whole_and_the_record_lists_every_file(tmp_path, stub, capsys):
    pytest.importorskip("mujoco")
    assert command.main(["D=99", "T=6.5", f"exports={tmp_path}"]) == 0
    made = tmp_path / "D99_T6.5" / "robot_model"
    record = json.loads((made / "robot_model.json").read_text())
    on_disk = {path.name for path in made.iterdir()} - {"robot_model.json"}
    assert set(record["files"]) == on_disk >= {"endcap.xml", "endcap.urdf", "base.stl", "shell.stl", "check.csv"}
    assert record["mujoco"]["force_within_limit"] and all(check["ok"] for check in record["mujoco"]["checks"])
    assert any("held out" in fact and "%" in fact for fact in record["facts"])
    comment = (made / "endcap.xml").read_text().split("-->")[0].lower()
    assert all(fact.lower() in comment for fact in record["facts"])
    rows = list(csv.DictReader((made / "check.csv").open()))
    assert {float(row["tilt_deg"]) for row in rows} >= {0.0, 25.0, 54.0}
    assert max(float(row["error"]) for row in rows) == pytest.approx(record["mujoco"]["force_error"], rel=1e-3)
    out = capsys.readouterr().out
    assert "not published" in out and "two carried masses" in out
    first = {path.name: path.read_bytes() for path in made.iterdir()}
    assert command.main(["D=99", "T=6.5", f"exports={tmp_path}"]) == 0
    assert {path.name: path.read_bytes() for path in made.iterdir()} == first


def test_a_slippery_floor_is_no_fault_of_the_springs(tmp_path, stub, capsys):
    """At 50 degrees D=99 T=6.5 pulls with 0.4 of the normal force: at friction 0.35 it slipped and nothing was made."""
    pytest.importorskip("mujoco")
    assert command.main(["D=99", "T=6.5", "friction=0.35", f"exports={tmp_path}"]) == 0, capsys.readouterr().err
    made = tmp_path / "D99_T6.5" / "robot_model"
    assert 'friction="0.35 ' in (made / "endcap.xml").read_text()
    assert json.loads((made / "robot_model.json").read_text())["mujoco"]["force_within_limit"]


def test_without_mujoco_it_says_so_and_writes(tmp_path, stub, capsys, monkeypatch):
    monkeypatch.setattr(checked, "is_installed", lambda: False)
    monkeypatch.setattr(usd, "is_installed", lambda: False)
    assert command.main([f"exports={tmp_path}", "friction=0.5"]) == 0
    out = capsys.readouterr().out
    assert checked.NOT_CHECKED in out and usd.MISSING in out
    made = tmp_path / "D130_T8" / "robot_model"
    assert json.loads((made / "robot_model.json").read_text())["mujoco"] == checked.NOT_CHECKED
    assert 'friction="0.5 ' in (made / "endcap.xml").read_text() and not (made / "check.csv").exists()
    assert remove_made(tmp_path) == 5 and not list(tmp_path.iterdir())  # make clean knows its record


def test_a_file_that_creeps_is_not_kept(tmp_path, stub, capsys, monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setattr(checked, "CREEP_LIMIT_MM_S", 0.0)
    assert command.main([f"exports={tmp_path}"]) == 1
    assert "robot_model.creep_mm_s" in capsys.readouterr().err
    assert not list(tmp_path.rglob("*.xml"))


def test_a_force_that_depends_on_what_is_carried_stops_the_file():
    pressed = ((1.0, 20.1), (2.0, 20.4))
    rows = [checked.PressRow(tilt, 2.0, 20.0, 20.0, heavy_n, 0.01 * tilt, False) for tilt, heavy_n in pressed]
    found = checked.Checked(rows, 0.0, 0.0)
    assert found.force_error == 0.02
    failed = [(gate.name, gate.value) for gate in found.gates if not gate.ok]
    assert failed == [("robot_model.carried_mass_force_ratio", pytest.approx(0.02))]
    assert all(gate.ok for gate in checked.Checked(rows[:1], 0.0, 0.0).gates)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["D=130"], "D=130 without T"),
        (["friction=0"], "friction=0 is not above 0 and at most 3: give"),
        (["friction=slippery"], "friction=slippery is not a number: give Coulomb's mu"),
        (["friction=nan"], "friction=nan is not a number"),
        (["material=Jelly"], "choose one of"),
        (["stiffness=4"], "'stiffness=4' is not an option"),
    ],
)
def test_bad_words_are_one_line(tmp_path, words, said, capsys):
    assert command.main([*words, f"exports={tmp_path}"]) == 2
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 1 and said in errors[0] and not list(tmp_path.iterdir())


def test_urdf_has_the_endcap_s_mass_sphere_and_meshes():
    model = robot_model(EndcapParams(130, 8))
    whole = parts(None, None).bodies.whole
    root = ElementTree.fromstring(endcap_urdf(model, whole, {"base": "base.stl"}, "endcap_D130_T8"))
    inertial = root.find("link/inertial")
    assert float(inertial.find("mass").get("value")) == pytest.approx(whole.mass_kg, rel=1e-5)
    assert float(inertial.find("inertia").get("izz")) == pytest.approx(whole.inertia_kg_m2[2, 2], rel=1e-5)
    assert float(root.find("link/collision/geometry/sphere").get("radius")) == pytest.approx(0.065)
    assert root.find("link/visual/geometry/mesh").get("filename") == "base.stl"


def test_usd_has_the_endcap_s_mass_and_inertia(tmp_path):
    pxr = pytest.importorskip("pxr")
    from pxr import Gf, Usd, UsdPhysics

    assert pxr
    whole = parts(None, None).bodies.whole
    path = tmp_path / "endcap.usda"
    usd.write_usd(path, robot_model(EndcapParams(130, 8)), whole, {"base": box()})
    stage = Usd.Stage.Open(str(path))
    mass = UsdPhysics.MassAPI(stage.GetDefaultPrim())
    axes = np.array(Gf.Matrix3d(Gf.Rotation(Gf.Quatd(mass.GetPrincipalAxesAttr().Get())))).T
    tensor = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
    assert mass.GetMassAttr().Get() == pytest.approx(whole.mass_kg)
    assert tensor == pytest.approx(whole.inertia_kg_m2, abs=1e-9)
