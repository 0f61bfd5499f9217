"""The MJCF in MuJoCo: force independent of the carried mass, the springs' own force, signs, isotropy, masses, creep."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.robot_model import mjcf
from sensing.simulator.robot_model.measured import Rig
from sensing.simulator.robot_model.mjcf import Bodies, Inertial, endcap_file, endcap_pieces
from sensing.simulator.robot_model.model import robot_model

mujoco = pytest.importorskip("mujoco")
DEPTHS_MM = np.array([2.0, 5.0, 8.0, 10.0])


def inertial(mass_kg: float, height_m: float) -> Inertial:
    tensor = mass_kg * 1e-3 * np.array([[2.0, 0.1, -0.2], [0.1, 1.9, 0.15], [-0.2, 0.15, 1.5]])
    return Inertial(mass_kg, np.array([1e-3, -2e-3, height_m]), tensor)


BODIES = Bodies(inertial(0.5, 0.01), inertial(0.09, 0.05))


@pytest.fixture(scope="module")
def model():
    return robot_model(EndcapParams(99, 6.5))


@pytest.fixture(scope="module")
def path(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("mjcf") / "endcap.xml"
    path.write_text(endcap_file(endcap_pieces(model, BODIES), "endcap", "-- a comment --"))
    return path


@pytest.mark.parametrize(("tilt_deg", "azimuth_deg"), [(0.0, 0.0), (35.0, 0.0), (55.0, 17.0), (55.0, 130.0)])
def test_force_is_that_of_the_springs_whatever_is_carried_and_wherever_it_touches(model, path, tilt_deg, azimuth_deg):
    outward = Indenter(tilt_deg).frame()[:, 0]
    wanted = -model.stiffness.force_n(-DEPTHS_MM[:, None] * outward) @ outward
    light, heavy = (Rig(path, tilt_deg, kg, azimuth_deg).ramp(1.2 * wanted[-1]) for kg in (1.0, 12.0))
    assert light.normal_at(DEPTHS_MM) == pytest.approx(wanted, rel=0.01)
    assert heavy.normal_at(DEPTHS_MM) == pytest.approx(light.normal_at(DEPTHS_MM), rel=0.01)


def test_the_sensors_negative_is_what_the_world_does_to_the_endcap(path):
    ramp = Rig(path, 40.0, 2.0, azimuth_deg=25.0).ramp(30.0)
    assert ramp.sensor_error_n < 1e-3
    assert (ramp.contact[-1, :3] @ np.array([0, 0, 1])) < -10  # the ground pushes the dome back to its base
    lever = np.cross(ramp.sensor[-1, :3], ramp.sensor[-1, 3:])
    assert np.isfinite(lever).all()
    weight = np.concatenate([ramp.shell_n, np.cross(BODIES.shell.centre_m, ramp.shell_n)])
    assert -ramp.sensor[-1] == pytest.approx(ramp.contact[-1] + weight, abs=5e-3)


def test_no_contact_is_missed_where_meshes_are_drawn_beside_the_sphere(tmp_path):
    """A body of two shapes goes through MuJoCo's bounding boxes; at this size rounding of the plane's fell below it."""
    model = robot_model(EndcapParams(147, 8.5))
    drawn = trimesh.creation.icosphere(2, 0.9 * model.radius_m)
    drawn.apply_translation([0, 0, model.centre_m])
    drawn.export(tmp_path / "shell.stl")
    path = tmp_path / "endcap.xml"
    path.write_text(endcap_file(endcap_pieces(model, BODIES, meshes={"shell": "shell.stl"}), "endcap", ""))
    ramp = Rig(path, 0.0, 12.0).ramp(50.0)
    wanted = -model.stiffness.force_n(np.array([0.0, 0.0, -5.0]))[2]
    assert ramp.sensor_error_n < 1e-3
    assert ramp.normal_n.min() > 0 and ramp.normal_at(np.array([5.0]))[0] == pytest.approx(wanted, rel=1e-3)


def test_the_gap_pushes_nothing_away(path):
    rig = Rig(path, 0.0, 1.0)
    rig.data.joint("depth").qpos[0] = -0.5 * mjcf.GAP_M
    mujoco.mj_forward(rig.model, rig.data)
    assert rig.data.ncon == 1 and rig.data.nefc == 0


def test_it_stays_where_friction_holds_it(path):
    assert Rig(path, 25.0, 6.0, travels=True).creep_mm_s() < 0.005


def test_masses_are_those_of_the_parts(path):
    compiled = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    assert compiled.body_mass.sum() == pytest.approx(BODIES.whole.mass_kg)
    assert data.subtree_com[compiled.body("endcap").id] == pytest.approx(BODIES.whole.centre_m, abs=1e-7)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, compiled.body("endcap").iquat)
    axes = turn.reshape(3, 3)
    tensor = axes @ np.diag(compiled.body("endcap").inertia) @ axes.T
    assert tensor == pytest.approx(BODIES.base.inertia_kg_m2, abs=1e-9)


def test_two_bodies_together_are_one():
    points = np.random.default_rng(2).uniform(-1, 1, (2, 50, 3))

    def cloud(place: np.ndarray) -> Inertial:
        centre = place.mean(axis=0)
        arms = place - centre
        return Inertial(float(len(place)), centre, (arms**2).sum() * np.eye(3) - arms.T @ arms)

    both, whole = cloud(points[0]) + cloud(points[1]), cloud(points.reshape(-1, 3))
    assert both.mass_kg == whole.mass_kg and both.centre_m == pytest.approx(whole.centre_m)
    assert both.inertia_kg_m2 == pytest.approx(whole.inertia_kg_m2)


def bar_of_two(model, height_m: float):
    """A bar with an endcap on each end, tilted over the floor; names foot_1 and foot_2."""
    places = ('pos="0 0 0.3"', 'pos="0 0 -0.3" quat="0 1 0 0"')
    pieces = [endcap_pieces(model, BODIES, f"foot_{k}", place) for k, place in enumerate(places, 1)]
    bodies, tendons, sensors = ("".join(getattr(p, part) for p in pieces) for part in ("body", "tendons", "sensors"))
    bar = f'<body name="bar" pos="0 0 {height_m}" euler="0 75 0"><freejoint/>{bodies}</body>'
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option {mjcf.OPTIONS}/><worldbody><geom type="plane" size="5 5 1"/>{bar}</worldbody>'
        f"<tendon>{tendons}</tendon><sensor>{sensors}</sensor></mujoco>"
    )


def test_two_endcaps_on_a_robot_have_their_own_names(model):
    compiled = bar_of_two(model, 1.0)
    assert compiled.nsensor == 4 and compiled.ntendon == 2 * len(mjcf.AZIMUTHS_DEG) and compiled.nv == 12


def test_a_dropped_bar_comes_to_rest_on_forces_that_sum_to_its_weight(model):
    compiled = bar_of_two(model, 0.3)
    data, highest = mujoco.MjData(compiled), 0.0
    for step in range(20_000):
        mujoco.mj_step(compiled, data)
        data.qvel[:6] *= 0.999 if step > 2_000 else 1.0  # what rolling would take, after the bounces
        highest = max(highest, float(data.body("bar").xpos[2]))
    assert highest < 0.31  # no energy out of nothing
    total, loads = np.zeros(3), []
    for name in ("foot_1", "foot_2"):
        axes = data.body(name).xmat.reshape(3, 3)
        loads.append(-axes @ data.sensor(f"{name}_force").data)
        total += loads[-1]
    carried = BODIES.base.mass_kg * 2 * 9.81  # the sensors have the shells' weight in them already
    assert np.abs(data.qvel).max() < 1e-3
    assert total == pytest.approx([0, 0, carried], abs=0.05)
    assert all(load[2] > 0.3 * carried for load in loads)


def test_a_file_that_is_no_endcap_is_refused_in_one_line(tmp_path):
    bad = tmp_path / "bad.xml"
    bad.write_text("<mujoco><worldbody/></mujoco>")
    with pytest.raises(FileError, match="cannot read it") as caught:
        Rig(bad, 0.0, 1.0)
    assert "\n" not in str(caught.value)
