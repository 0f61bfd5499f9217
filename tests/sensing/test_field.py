"""The command line as a user runs it, and the function behind it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cad.errors import ParameterError
from cad.identity import identity
from cad.params import EndcapParams
from cad.pattern import parse_rings
from sensing.field import compute_fields, main
from sensing.records import Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.sources.warp import Bump, Displacement, cell_truth, warp_image
from sensing.tracking.methods import METHODS, field_method
from sensing.tracking.zero import save_zero, single_zero

IMAGE, _ = draw_dots(Drawing())
PRESS = Displacement((1.0, 0.5), bumps=(Bump((400.0, 280.0), (8.0, 6.0), 60.0),))


@pytest.fixture
def files(tmp_path):
    cv2.imwrite(str(tmp_path / "a.jpg"), IMAGE)
    cv2.imwrite(str(tmp_path / "b.jpg"), warp_image(IMAGE, PRESS))
    cv2.imwrite(str(tmp_path / "small.png"), IMAGE[::2, ::2])
    cv2.imwrite(str(tmp_path / "blank.png"), np.full_like(IMAGE, 90))
    (tmp_path / "text.jpg").write_text("no picture")
    made_of = identity(EndcapParams(130, 8)).without("camera", "silicone")
    save_zero(replace(single_zero(Frame(0, 0, "a", image=IMAGE)), made_of=made_of), tmp_path / "z.npz")
    return tmp_path


def call(files, *arguments: str) -> int:
    words = [str(files / a[1:]) if a.startswith("@") else a for a in arguments]
    return main(words)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_writes_a_field_near_the_truth_and_a_picture(files, method, capsys):
    status = call(files, "--method", method, "--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@f.npy",
                  "--picture", "@f.png")  # fmt: skip
    field = np.load(files / "f.npy", allow_pickle=False)
    assert status == 0 and field.shape == (2, 30, 30) and field.dtype == np.float32
    assert np.linalg.norm(field - cell_truth(PRESS, (640, 480)), axis=0).mean() < 0.3
    picture = cv2.imread(str(files / "f.png"))
    assert picture.shape[:2] == (960, 1280) and picture.std() > 20
    assert f"{method}: 1 frame(s)" in capsys.readouterr().out
    assert not [p for p in files.iterdir() if p.name.startswith("tmp")]


def test_video_and_tracks(files):
    folder = files / "press"
    folder.mkdir()
    for index, share in enumerate((0.0, 0.5, 1.0)):
        cv2.imwrite(str(folder / f"{index}.jpg"), warp_image(IMAGE, PRESS.scaled(share)))
    assert (
        call(files, "--reference", "@a.jpg", "--video", "@press", "--out", "@f.npz", "--channels", "u,v,div,sol_u") == 0
    )
    with np.load(files / "f.npz", allow_pickle=False) as data:
        assert data["channels"].shape == (3, 4, 30, 30) and data["names"].tolist() == ["u", "v", "div", "sol_u"]
        assert data["position_px"].shape == (3, *data["reference_px"].shape) and data["valid"].shape == (3, 30, 30)
        size = np.linalg.norm(data["channels"][:, :2], axis=1).mean(axis=(1, 2))
    assert size[0] < 0.05 < size[1] < size[2]


def test_cells_without_a_followed_dot_are_no_numbers(files, capsys):
    folder = files / "covered"
    folder.mkdir()
    for index, kept in enumerate((640, 0, 300, 640)):
        cv2.imwrite(str(folder / f"{index}.png"), np.where(np.arange(640)[:, None] < kept, IMAGE, 90))
    assert call(files, "--reference", "@a.jpg", "--video", "@covered", "--out", "@f.npy") == 0
    said = capsys.readouterr()
    assert "in 2 of 4 frame(s) over 12% of the dots are not seen" in said.err and "of the last one, mean" in said.out
    share = np.isnan(np.load(files / "f.npy")).mean(axis=(1, 2, 3))
    assert share[[0, 1, 3]].tolist() == [0, 1, 0] and 0.2 < share[2] < 0.6


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--reference", "@none.jpg", "--frame", "@b.jpg", "--out", "@f.npy"), "none.jpg: No such file"),
        (("--reference", "@text.jpg", "--frame", "@b.jpg", "--out", "@f.npy"), "text.jpg: no picture"),
        (("--reference", "@blank.png", "--frame", "@b.jpg", "--out", "@f.npy"), "blank.png: 0 dots found"),
        (("--reference", "@a.jpg", "--frame", "@small.png", "--out", "@f.npy"), "320x240 px, but the reference"),
        (("--reference", "@a.jpg", "--frame", "@blank.png", "--out", "@f.npy"), "none of the reference's dots are"),
        (("--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@no/f.npy"), "f.npy: No such file or directory"),
        (("--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@f.csv"), "must end in .npy or .npz"),
        (("--reference", "@a.jpg", "--frame", "@b.jpg"), "nothing to write"),
        (
            ("--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@f.npy", "--shape", "100000x100000"),
            "shape=100000x100000 outside 2x2..100x100",
        ),
        (("--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@f.npy", "--channels", "u,w"), "channels=w"),
        (
            ("--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@f.npy", "--channels", "du"),
            "only --method gelslim",
        ),
        (
            ("--reference", "@a.jpg", "--frame", "@b.jpg", "--out", "@f.npy", "--picture", "@g.gif"),
            "end in .png or .jpg",
        ),
        (
            ("--reference", "@z.npz", "--frame", "@b.jpg", "--out", "@f.npy", "--diameter", "180", "--wall", "10"),
            "--diameter 180 --wall 10: ",
        ),
        (
            ("--reference", "@z.npz", "--frame", "@b.jpg", "--out", "@f.npy", "--dot-rings", "1-6-10-12"),
            "--dot-rings 1-6-10-12: ",
        ),
    ],
)
def test_bad_input_gets_one_line_and_status_2(files, arguments, words, capsys):
    before = {p.name for p in files.iterdir()}
    assert call(files, *arguments) == 2
    message = capsys.readouterr().err
    assert words in message and message.count("\n") == 1 and "Traceback" not in message
    assert {p.name for p in files.iterdir()} == before


@pytest.mark.parametrize("words", [[], ["--wall", "8"], ["--diameter", "130", "--wall", "8.0"]])
def test_a_reference_is_taken_with_the_options_that_agree_with_it(files, words):
    assert call(files, "--reference", "@z.npz", "--frame", "@b.jpg", "--out", "@f.npy", *words) == 0


def test_unknown_method_lists_the_known():
    with pytest.raises(ParameterError, match="choose from dots, gelslim"):
        field_method("magic", Frame(0, 0, "a", image=IMAGE))


@pytest.mark.parametrize("method", ["dots", "lk"])
def test_a_method_looks_for_the_dots_of_the_design(method):
    """Lucas and Kanade's found none of 8 mm on a small dome, though the design was given."""
    design = EndcapParams(101, 10, parse_rings("1-5-9-12"), 8.0)
    picture = Frame(0, 0, "a", image=draw_dots(Drawing(specks=0, digit=""), design)[0])
    assert field_method(method, picture, (8, 8), design).update(picture).valid.any()


def test_results_come_frame_by_frame():
    def endless():
        while True:
            yield Frame(0, 0, "a", image=IMAGE)

    results = compute_fields("dots", Frame(0, 0, "a", image=IMAGE), endless())
    assert next(results).field.channels.shape == (2, 30, 30) and next(results).tracks is not None
