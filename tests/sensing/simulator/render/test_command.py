"""What the renderer's command says of files that are not what it needs."""

import numpy as np
import pytest

from cad.identity import identity
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.simulator.render.cli import main
from sensing.simulator.render.mesh import surface_mesh

NODES = surface_mesh(EndcapParams(130, 8), 24).vertices_mm
INWARD = np.zeros_like(NODES) - [0.0, 0.0, 1.0]


@pytest.mark.parametrize("data", [b"", b"text", b"PK\x03\x04", "an array alone"])
def test_a_displacement_that_is_none_gets_one_line(data, tmp_path, capsys):
    path = tmp_path / "field.npz"
    if isinstance(data, str):
        with path.open("wb") as stream:
            np.save(stream, np.zeros(3))
    else:
        path.write_bytes(data)
    assert main(["--displacement", str(path), "--out", str(tmp_path / "frame.png")]) == 2
    said = capsys.readouterr().err
    assert "need arrays surface_mm and displacement_mm" in said and said.count("\n") == 1


def changed(array, place, value):
    found = array.copy()
    found[place] = value
    return found


@pytest.mark.parametrize(
    ("surface", "displacement", "words"),
    [
        (changed(NODES, (3, 1), np.nan), INWARD, "surface_mm of shape (625, 3) and type float64: need finite real"),
        (
            NODES,
            changed(INWARD, (3, 1), np.inf),
            "displacement_mm of shape (625, 3) and type float64: need finite real",
        ),
        (NODES[:, :2], INWARD, "surface_mm of shape (625, 2)"),
        (NODES.ravel(), INWARD, "surface_mm of shape (1875,)"),
        (np.zeros(625, dtype=[("x", float), ("y", float)]), INWARD, "surface_mm of shape (625,) and type [('x'"),
        (NODES, INWARD * 1j, "displacement_mm of shape (625, 3) and type complex128"),
        (NODES, INWARD[1:], "displacement_mm of shape (624, 3)"),
        (np.repeat(NODES[:1], 20, axis=0), INWARD[:20], ": 1, need 6 or more: give each node once"),
        (NODES, changed(INWARD, (3, 2), 1e300), "displacement_mm up to 1e+300, outside 0..114"),
        (NODES, -1000 * INWARD, "displacement_mm up to 1000, outside 0..114"),
    ],
)
def test_a_displacement_of_other_numbers_gets_one_line(surface, displacement, words, tmp_path, capsys):
    path = tmp_path / "field.npz"
    np.savez(path, surface_mm=surface, displacement_mm=displacement)
    assert main(["--displacement", str(path), "--level", "draft", "--out", str(tmp_path / "frame.png")]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not (tmp_path / "frame.png").exists()


def test_a_frame_under_zero_gets_one_line_and_whole_numbers_are_displacements(tmp_path, capsys):
    out = tmp_path / "frame.png"
    assert main(["--frame", "-1", "--level", "draft", "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert "frame=-1 is under 0: it numbers the noise; give 0 or more" in said and said.count("\n") == 1
    np.savez(tmp_path / "field.npz", surface_mm=NODES, displacement_mm=INWARD.astype(int))
    assert main(["--displacement", str(tmp_path / "field.npz"), "--level", "draft", "--out", str(out)]) == 0
    assert out.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--displacement", "field.npz", "--bulge", "5"], "--bulge 5: the displacement comes from field.npz"),
        (["--tilt", "50"], "--tilt 50 says where a bulge lies, and there is none: give --bulge MM"),
        (["--azimuth", "0", "--bulge", "0"], "--azimuth 0 says where a bulge lies, and there is none: give --bulge MM"),
        (["--displacement", "field.npz", "--tilt", "50"], "and there is none: leave it out"),
    ],
)
def test_an_option_that_would_change_nothing_is_refused(words, said, tmp_path, monkeypatch, capsys):
    """Bulge, tilt and azimuth were left out without a word."""
    monkeypatch.chdir(tmp_path)
    np.savez("field.npz", surface_mm=NODES, displacement_mm=INWARD)
    assert main([*words, "--level", "draft", "--out", "frame.png"]) == 2
    found = capsys.readouterr().err
    assert said in found and found.count("\n") == 1
    assert not (tmp_path / "frame.png").exists()


def test_a_camera_of_another_endcap_is_refused(tmp_path, capsys):
    """Without ``--diameter`` it drew the dome of D=130 through the camera of another one."""
    other, path = EndcapParams(180, 10), tmp_path / "camera.json"
    nominal_mount(other).save(path, identity(other))
    drawn = ["--camera", str(path), "--level", "draft", "--out", str(tmp_path / "frame.png")]
    assert main(drawn) == 2
    said = capsys.readouterr().err
    assert "a camera for the design D180_T10, this endcap has the design D130_T8" in said and said.count("\n") == 1
    assert main([*drawn, "--diameter", "180", "--wall", "10"]) == 0
