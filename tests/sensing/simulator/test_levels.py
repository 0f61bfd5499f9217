"""The one facade of the levels: same answers whatever mesh half or level gives them."""

import re
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cad.errors import ParameterError
from cad.materials import silicone
from cad.messages import LOG
from cad.params import EndcapParams
from sensing.camera.mount import mount, rotation_matrix
from sensing.camera.nominal import nominal_mount
from sensing.simulator.__main__ import main
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Press, Target
from sensing.simulator.press.ramp import ramp
from sensing.simulator.press.state import Refusal
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import OUTLINE_RADII, dot_directions, outline_directions, turn_wrench

GEOMETRY, LAW = shell_geometry(130, 8), silicone().neo_hooke()
CAMERA = nominal_mount(EndcapParams(130, 8))
SCENE = Scene(Indenter(tilt_deg=25), friction=0.6)


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    return Simulator(GEOMETRY, LAW, "draft", level=1)


def test_half_and_whole_mesh_give_one_surface(simulator: Simulator) -> None:
    tiny = 1e-9  # leaves the mirror plane, so the whole mesh is used
    of_half = list(simulator.follow(SCENE, [Target(normal_n=8.0)]))[-1]
    of_whole = list(simulator.follow(SCENE, [Target(normal_n=8.0, shift_mm=(0.0, tiny))]))[-1]
    size = np.abs(of_half.surface_mm).max()
    assert np.abs(of_half.surface_mm - of_whole.surface_mm).max() < 1e-6 * size
    assert np.allclose(of_half.wrench, of_whole.wrench, atol=1e-5 * 8 * 65)
    assert of_half.patch_mm2 == pytest.approx(of_whole.patch_mm2, rel=1e-9)
    assert of_half.patch is not None and of_half.patch.pressure @ of_half.patch.area > 7.9


def test_a_tangential_force_is_met_and_its_wrench_agrees(simulator: Simulator) -> None:
    target = Target(normal_n=10.0, tangential_n=(2.0, -1.5))
    state = list(simulator.follow(SCENE, [Target(normal_n=10.0), target]))[-1]
    assert state.tangential_n == pytest.approx((2.0, -1.5), abs=0.02)
    frame = SCENE.indenter.frame()
    force = frame @ [-state.normal_n, *state.tangential_n]
    assert np.allclose(state.wrench[:3], force)
    with pytest.raises(Refusal, match=r"^range: tangential_n=\(7\.0, 0\.0\) outside 5\.82 N"):
        list(simulator.follow(SCENE, [Target(normal_n=10.0, tangential_n=(7.0, 0.0))]))


def test_a_turned_contact_turns_markers_and_wrench(simulator: Simulator) -> None:
    state = list(simulator.follow(SCENE, [Target(normal_n=6.0)]))[-1]
    still, turned = simulator.markers(state), simulator.markers(state, 180.0)
    assert still.shape == turned.shape and not np.allclose(still, turned)
    largest = [np.linalg.norm(field, axis=1).max() for field in (still, turned)]
    assert largest[0] == pytest.approx(largest[1], rel=0.1)  # dots lie elsewhere against the contact
    assert np.allclose(turn_wrench(state.wrench, 180.0)[:3], state.wrench[:3] * [-1, -1, 1], atol=1e-9)


def test_an_outline_moves_as_the_skin_does_round_its_dot(simulator: Simulator) -> None:
    """The mean of z = a |x|^2 over a ring is a r^2 above its centre; that of a shift is the same."""
    state = list(simulator.follow(SCENE, [Target(normal_n=6.0)]))[-1]
    place = simulator.surface.position
    straight = replace(state, surface_mm=place * 0 + [0.2, 0.1, 0.3])
    bowl = replace(state, surface_mm=0.005 * (place[:, :1] ** 2 + place[:, 1:2] ** 2) * [[0.0, 0.0, 1.0]])
    tip = 0  # where the ring is level
    gap = simulator.outlines(straight, CAMERA) - simulator.markers(straight)
    assert np.abs(gap[tip]).max() < 2e-3
    risen = (simulator.outlines(bowl, CAMERA) - simulator.markers(bowl))[tip, 2]
    assert risen == pytest.approx(0.005 * (OUTLINE_RADII * GEOMETRY.dot_radius_mm) ** 2, rel=0.1)  # of a draft mesh


def test_a_dot_moves_in_the_picture_as_its_outline_does_on_the_mean(simulator: Simulator) -> None:
    """Also far from the axis, where the lens bends most; of a camera that stands askew, too."""
    state = list(simulator.follow(SCENE, [Target(normal_n=8.0)]))[-1]
    askew = mount(CAMERA.camera, (1.0, -0.5, 16.0), rotation_matrix([0.05, -0.02, 0.3]))
    rest = np.array(GEOMETRY.centre_mm) + GEOMETRY.inner_radius_mm * dot_directions(GEOMETRY)
    ring = np.array(GEOMETRY.centre_mm) + GEOMETRY.inner_radius_mm * outline_directions(GEOMETRY)
    moved = simulator.surface.interpolation(ring) @ state.surface_mm
    for camera in (CAMERA, askew):
        seen = camera.project(rest + simulator.outlines(state, camera)) - camera.project(rest)
        expected = (camera.project(ring + moved) - camera.project(ring)).reshape(len(rest), -1, 2).mean(axis=1)
        whole = np.isfinite(expected).all(axis=1)
        assert whole.sum() > 60 and np.abs(seen - expected)[whole].max() < 1e-6
        plain = camera.project(rest + moved.reshape(len(rest), -1, 3).mean(axis=1)) - camera.project(rest)
        assert np.abs(plain - expected)[whole].max() > 0.01  # the picture of the mean is not the mean in the picture


def test_levels_agree_and_say_which_answered(simulator: Simulator) -> None:
    fast = Simulator(GEOMETRY, LAW, "draft", level=2)
    path = [Target(normal_n=n) for n in (4.0, 7.0, 9.0)]
    exact, found = list(simulator.follow(SCENE, path)), list(fast.follow(SCENE, path))
    assert {state.level for state in exact} == {1}
    assert found[-1].level == 2 and 0 < found[-1].error_estimate < fast.tolerance
    wrong = found[-1].surface_mm - exact[-1].surface_mm
    assert np.sqrt((wrong**2).mean()) < 1e-3 * np.sqrt((exact[-1].surface_mm ** 2).mean())


def test_bad_requests_are_refused() -> None:
    with pytest.raises(ParameterError, match="level=7 is unknown: choose one of 1, 2, 3, 4"):
        Simulator(GEOMETRY, LAW, level=7)
    with pytest.raises(ParameterError, match=r"tolerance=0\.5 outside"):
        Simulator(GEOMETRY, LAW, tolerance=0.5)
    press = Press(Simulator(GEOMETRY, LAW, "draft")._shell.model(True), Indenter(), 0.5)
    with pytest.raises(Refusal, match=r"^path: .*levels\.Simulator"):
        press.advance(press.start(), Target(normal_n=1.0, tangential_n=(0.1, 0.0)))


@pytest.mark.parametrize("normal_n", [float("nan"), float("inf"), float("-inf"), 20_000.0])
def test_a_force_that_no_shell_bears_is_refused_at_once(simulator: Simulator, normal_n: float) -> None:
    with pytest.raises(Refusal, match=r"^range: normal_n=.* outside 0\.\.10000 N"):
        simulator.press(normal_n)


@pytest.mark.parametrize("shift_mm", [(500.0, 0.0), (0.0, -131.0), (float("nan"), 0.0), (100.0, 100.0)])
def test_a_travel_beyond_the_dome_is_refused_at_once(simulator, shift_mm, monkeypatch) -> None:
    """500 mm gave no answer in 150 s."""
    monkeypatch.setattr(Simulator, "walk", lambda *_: pytest.fail("it was pressed first"))
    with pytest.raises(Refusal, match=r"^range: tangential travel of .* mm outside 0\.\.130 mm"):
        simulator.press(20.0, 30.0, shift_mm)


def test_a_press_passes_loads_that_its_mesh_cannot_feel() -> None:
    simulator = Simulator(shell_geometry(243, 21), LAW, "data", level=1)
    bump = {"tilt_deg": 40.0, "kind": "sphere", "radius_mm": 33.0}
    with pytest.raises(Refusal, match=r"^mesh: the sphere .* or press deeper"):
        simulator.press(5.0, **bump)
    assert simulator.press(20.0, **bump).normal_n == pytest.approx(20.0)  # its steps begin at 5 N


def test_the_command_names_itself(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(["press", "--tilt", "200"]) == 2
    assert capsys.readouterr().err.startswith("sensing.simulator: tilt_deg=200 outside")

    def stopped(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Simulator, "press", stopped)
    assert main(["press"]) == 130
    assert capsys.readouterr().err == "sensing.simulator: stopped\n"


def test_a_press_that_takes_long_is_announced(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a new computer it compiles for half a minute: the first command of a researcher seemed to hang."""

    def slow(*_: object, **__: object) -> None:
        deadline = time.monotonic() + 30
        while time.monotonic() < deadline and not capsys.readouterr().err:
            time.sleep(0.01)
        raise KeyboardInterrupt if time.monotonic() < deadline else AssertionError("nothing was said")

    monkeypatch.setattr("sensing.simulator.__main__.PATIENCE_S", 0.01)
    monkeypatch.setattr(Simulator, "press", slow)
    assert main(["press"]) == 130


def test_a_softer_silicone_is_the_same_press_in_other_newtons(simulator: Simulator) -> None:
    """Steps of 5 N were one step for all that Ecoflex bears: dots off by 1 %, torque of the other sign."""
    soft = silicone("Ecoflex 00-30").neo_hooke()
    ratio = soft.shear_mpa / LAW.shear_mpa
    hard, other = simulator.press(10.0, 30.0), Simulator(GEOMETRY, soft, "draft", level=1).press(10.0 * ratio, 30.0)
    assert other.depth_mm == pytest.approx(hard.depth_mm, rel=1e-6)
    assert np.allclose(other.wrench / ratio, hard.wrench, atol=1e-5 * 10 * 65)


@pytest.mark.parametrize(("most_n", "said"), [(12.0, "; solved to 10 N at a depth of 12.3 mm: give less"), (0.0, "")])
def test_a_press_that_ends_early_says_how_far_it_came(simulator, most_n, said, monkeypatch):
    """Whoever asked for too much had to search the largest load by trial."""

    def answer(target: Target) -> SimpleNamespace:
        if target.normal_n > most_n:
            raise Refusal("range", "depth_mm=51.6 over 0.6 R")
        return SimpleNamespace(normal_n=target.normal_n, depth_mm=12.34)

    monkeypatch.setattr(Simulator, "_answers", lambda *_: answer)
    with pytest.raises(Refusal) as refused:
        simulator.press(50.0)
    assert str(refused.value) == f"range: depth_mm=51.6 over 0.6 R{said}" and refused.value.reason == "range"


def test_press_takes_the_bodies_and_the_interlock_as_data_does(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: dict[str, object] = {}

    def made(self: Simulator, *_: object, **options: object) -> None:
        seen.update(options)

    def pressed(self: Simulator, *_: object, **scene: object) -> None:
        seen.update(scene)
        raise KeyboardInterrupt

    monkeypatch.setattr(Simulator, "__init__", made)
    monkeypatch.setattr(Simulator, "press", pressed)
    words = ["--indenter", "edge", "--radius", "8", "--axis", "25", "--interlock", "1.49"]
    assert main(["press", *words]) == 130
    assert seen == {"level": 1, "interlock": 1.49, "friction": 0.5, "kind": "edge", "radius_mm": 8.0, "axis_deg": 25.0}
    assert main(["press", "--body", "sphere"]) == 130 and seen["kind"] == "sphere"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--radius", "5"], "--radius 5: a plane has none, so it would change nothing; give --indenter sphere or edge"),
        (["--indenter", "sphere", "--axis", "90"], "--axis 90: a sphere has none"),
    ],
)
def test_press_refuses_what_its_body_does_not_have(words, said, capsys):
    """A plane was pressed where a ball of 5 mm was meant."""
    assert main(["press", *words]) == 2
    found = capsys.readouterr()
    assert said in found.err and found.err.count("\n") == 1 and found.out == ""


def test_a_press_to_a_depth_is_the_press_to_its_force(simulator: Simulator) -> None:
    deep = simulator.press(tilt_deg=30.0, depth_mm=4.0)
    assert deep.depth_mm == pytest.approx(4.0)
    assert simulator.press(deep.normal_n, 30.0).depth_mm == pytest.approx(4.0, rel=2e-3)
    with pytest.raises(Refusal, match=r"^range: depth_mm=40 outside 0\.\.39 mm \(0\.6 R\)"):
        simulator.press(depth_mm=40.0)
    with pytest.raises(ParameterError, match="both given; give exactly one"):
        simulator.press(10.0, depth_mm=4.0)


def test_a_thin_shell_that_snaps_is_pressed_to_a_depth(capsys: pytest.CaptureFixture[str]) -> None:
    """The refusal of a force advises a depth, which the command could not take."""
    thin = ["press", "--diameter", "200", "--wall", "5", "--tilt", "0", "--density", "draft"]
    assert main([*thin, "--normal", "60"]) == 2
    assert "control the depth instead of the force" in capsys.readouterr().err
    assert main([*thin, "--depth", "20"]) == 0
    said = capsys.readouterr().out
    assert "depth       20.000 mm at a normal force of" in said
    assert re.search(r"^patch +\d+ mm2, counted in [1-9]\d* points of the mesh; ", said, re.M)


def test_a_press_past_a_snap_says_where_the_force_fell(simulator, monkeypatch, caplog):
    """Its last state looked like any other: the force had risen again, on another branch than a finer mesh's."""
    fell = {2.0: 5.0, 3.9: 7.1, 5.85: 6.6, 7.8: 9.4}

    def pressed(forces: dict[float, float], slope: float = 2.0, travel_mm: float = 0.0) -> str:
        common = {"certificate": SimpleNamespace(force_stiffness_n_mm=slope)}
        shift = {depth: (0.0, travel_mm * depth) for depth in forces}
        states = iter([SimpleNamespace(depth_mm=d, normal_n=n, shift_mm=shift[d], **common) for d, n in forces.items()])
        monkeypatch.setattr(Simulator, "_answers", lambda *_: lambda _: next(states))
        monkeypatch.setattr(LOG, "propagate", True)  # to caplog
        caplog.clear()
        simulator.press(depth_mm=7.8)
        return caplog.text

    assert "the force falls from 7.1 to 6.6 N at 5.85 mm of depth: the shell snaps" in pressed(fell)
    rose = dict(zip(fell, sorted(fell.values()), strict=True))
    assert "the force falls by 1.5 N/mm at 3.9 mm of depth" in pressed(rose, slope=-1.5)
    assert pressed(rose) == "" == pressed(fell, travel_mm=0.5)  # under a given force a sideways pull lets it sink in
    assert pressed({2.0: 7.0, 3.9: 7.0 - 1e-9, 5.85: 7.5, 7.8: 8.0}) == ""


def test_a_sideways_pull_is_that_of_many_steps(simulator: Simulator) -> None:
    """In one step the force across was 2.4 degrees behind, and the dots 2.5 % off: friction turns with the travel."""
    pulled = simulator.press(5.0, 30.0, (0.0, 2.5))
    path = [Target(normal_n=5.0, shift_mm=(0.0, 2.5 * part)) for part in np.linspace(0, 1, 17)]
    exact = list(simulator.follow(Scene(Indenter(30.0)), path))[-1]
    missed = pulled.surface_mm - exact.surface_mm
    assert np.linalg.norm(missed) < 0.012 * np.linalg.norm(exact.surface_mm)
    assert pulled.shift_mm == (0.0, 2.5)


def test_a_long_travel_takes_few_steps() -> None:
    ends = [ramp(GEOMETRY, LAW, 5.0, None, (0.0, travel)) for travel in (0.0, 0.9, 2.5, 60.0)]
    assert [len(end) - 1 for end in ends] == [0, 1, 3, 10]
    assert ends[-1][-1] == Target(normal_n=5.0, shift_mm=(0.0, 60.0))


def test_no_load_step_is_over_its_limit() -> None:
    """7 N were one step: loads were rounded to whole steps."""
    soft = silicone("Dragon Skin 30").neo_hooke()
    limits = {LAW: 5.0, soft: 5.0 * soft.shear_mpa / LAW.shear_mpa}
    for law, limit_n in limits.items():
        for loads in (1.0, 1.4, 2.0, 7.0):
            ends = [target.normal_n for target in ramp(GEOMETRY, law, loads * limit_n, None, (0.0, 0.0))]
            assert len(ends) == np.ceil(loads) and ends[-1] == pytest.approx(loads * limit_n)
