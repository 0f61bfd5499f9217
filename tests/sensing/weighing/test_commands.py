"""``sensing.weigh --postures`` and ``sensing.dwell`` from their files to endcaps.toml; pictures are stood in for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from dwell_stand_in import creep
from live_stand_in import film, stand_in

from cad.errors import FileError
from cad.params import EndcapParams
from sensing import dwell, weigh
from sensing.camera.nominal import nominal_mount
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config
from sensing.live.mcap_records import CutError, DamagedError
from sensing.live.outputs.mcap.config import about, parsed
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.records import Wrench
from sensing.weighing import robot
from sensing.weighing.film import film_readings

GAINS = (0.7, 0.9, 1.1)
UPS = ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 0.6, 0.8), (-0.48, 0.36, 0.8))
PARTS = ((0.2, 0.3, 0.5), (0.5, 0.25, 0.25), (0.3, 0.5, 0.2), (0.1, 0.6, 0.3))
ROBOT = "weight_n = 60.0\n" + "".join(
    f'[[endcap]]\nname = "endcap_{k}"\nsource = "{k}"\n'
    + (
        "T_robot_endcap = [[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]\n"
        if k == 1
        else f"T_robot_endcap = [[1, 0, 0, {300 * k}], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"
    )
    for k in range(4)
)
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@pytest.fixture
def standing(monkeypatch, tmp_path):
    """A robot in four postures; endcap_3 is in the air."""

    def at_rest(endcap, recording, model):
        number, posture = int(endcap.name[-1]), int(recording.stem)
        if number == 3:
            return None
        force = 60.0 * PARTS[posture][number] * np.array(UPS[posture]) / GAINS[number]
        return (TURN.T if number == 1 else np.eye(3)) @ force, np.eye(3) * 0.02**2

    monkeypatch.setattr(robot, "_at_rest", at_rest)
    (tmp_path / "endcaps.toml").write_text(ROBOT)
    rows = [f"{k}.mcap,{','.join(map(str, up))}" for k, up in enumerate(UPS)]
    (tmp_path / "postures.csv").write_text("\n".join(["recording,up_x,up_y,up_z", *rows]) + "\n")
    return tmp_path


def weighed(folder, *words):
    return weigh.main(["--config", str(folder / "endcaps.toml"), "--postures", str(folder / "postures.csv"), *words])


def test_a_robot_in_postures_stores_a_gain_for_each_endcap_that_stood(standing, capsys):
    assert weighed(standing, "--dry-run") == 0 and (standing / "endcaps.toml").read_text() == ROBOT
    assert weighed(standing) == 0
    assert "endcap_3: carried no load, gain unchanged" in capsys.readouterr().out
    found = [endcap.gain for endcap in load_config(standing / "endcaps.toml").endcaps]
    assert found == pytest.approx([*GAINS, 1.0], rel=1e-4)


def test_endcaps_whose_places_in_the_robot_are_not_stated_are_named(standing, capsys):
    text = "".join(line for line in ROBOT.splitlines(keepends=True) if not line.startswith("T_robot_endcap"))
    (standing / "endcaps.toml").write_text(text)
    assert weighed(standing) == 2 and (standing / "endcaps.toml").read_text() == text
    error = capsys.readouterr().err
    assert "T_robot_endcap of endcap_0, endcap_1, endcap_2, endcap_3" in error and len(error.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "option"),
    [(["--endcap", "endcap_1"], "endcap"), (["--tilt", "5"], "tilt"), (["--gravity", "9.8"], "gr")],
)
def test_options_of_one_endcap_do_not_weigh_a_whole_robot(standing, capsys, words, option):
    """--endcap was ignored: the gains of all endcaps changed."""
    assert weighed(standing, *words) == 2 and (standing / "endcaps.toml").read_text() == ROBOT
    error = capsys.readouterr().err
    assert f"--{option}" in error and "has no effect with --postures" in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("x.mcap,0,0,1.2", "vertical of length 1"), ("x.mcap,0,0.8,0", "length 1"), ("x.mcap,0", "length 1"),
        ("x.mcap,0,up,1", "vertical of length 1"),
    ],
)  # fmt: skip
def test_a_table_of_postures_that_cannot_be_read_is_named_by_its_line(standing, capsys, row, said):
    with (standing / "postures.csv").open("a") as stream:
        stream.write(row + "\n")
    assert weighed(standing) == 2 and (standing / "endcaps.toml").read_text() == ROBOT
    error = capsys.readouterr().err
    assert "line 6" in error and said in error
    (standing / "postures.csv").write_text("a,b\n1,2\n")
    assert weighed(standing) == 2 and "columns recording, up_x" in capsys.readouterr().err


def test_a_dwell_test_stores_its_terms_and_draws_them(monkeypatch, tmp_path, capsys):
    path, picture = tmp_path / "endcaps.toml", tmp_path / "dwell.png"
    path.write_text('# mine\n[[endcap]]\nname = "a"\nsource = "0"\n')

    def readings(endcap, source, model):
        for time_s, force_n, load_n in zip(*creep(), strict=True):
            force_n += plate_n * (load_n < 7) * (time_s > 6)
            yield SimpleNamespace(
                valid=True, reason="camera or lens have moved",
                estimate=Wrench(time_s, np.array([0, 0, -force_n]), np.zeros(3), "endcap", flags=flags),
            )  # fmt: skip

    plate_n, flags = 0.0, frozenset()
    monkeypatch.setattr(dwell, "film_readings", readings)
    words = ["--config", str(path), "--source", "dwell.mcap", "--picture", str(picture)]
    assert dwell.main([*words, "--dry-run"]) == 0 and "relaxation" not in path.read_text()
    assert dwell.main(words) == 0
    config = load_config(path)
    terms = config.endcaps[0].relaxation_terms
    assert [term.tau_s for term in terms] == pytest.approx([0.1, 1.0], rel=0.15) and picture.stat().st_size > 5000
    out, err = capsys.readouterr()
    assert path.read_text().startswith("# mine") and "0.179" in out and "warning" not in err
    plate_n = 0.5
    assert dwell.main([*words, "--dry-run"]) == 0 and "was all of it taken off" in capsys.readouterr().err
    plate_n, flags = 0.0, frozenset({"moved"})
    assert dwell.main([*words, "--dry-run"]) == 0
    assert "readings are flagged (moved), lastly because: camera or lens have moved" in capsys.readouterr().err
    carried = replace(config, endcaps=(replace(config.endcaps[0], gain=0.7, gain_sd=0.01),))
    again = parsed(about(carried, []), tmp_path / "run.mcap").config.endcaps[0]
    assert again.relaxation == config.endcaps[0].relaxation and again.gain == 0.7


def test_a_camera_s_device_is_no_film():
    with pytest.raises(FileError, match="give a recording, a video or a folder of pictures"):
        next(film_readings(EndcapConfig("a", "0"), "/dev/null", None))


def test_a_folder_whose_name_begins_like_an_address_is_a_film(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "http_presses"
    folder.mkdir()
    for number, jpeg in enumerate(film([0, 1.0])):
        (folder / f"{number}.jpg").write_bytes(jpeg)
    assert len(list(film_readings(EndcapConfig("a", "0"), folder.name, stand_in()))) == 2


@pytest.mark.parametrize("error", [CutError("cut at byte 9"), DamagedError("damaged at byte 9")])
def test_of_a_cut_recording_what_stands_before_is_weighed(monkeypatch, caplog, tmp_path, error):
    class Pipeline:
        def __init__(self, *_, **__):
            self.update = int

    def frames(*_):
        yield from (SimpleNamespace(frame=number, zero=None) for number in (1, 2))
        raise error

    (tmp_path / "a.mcap").touch()
    monkeypatch.setattr("sensing.live.readable_frames.recorded_frames", frames)
    for name, other in (("EndcapPipeline", Pipeline), ("require_design", print)):
        monkeypatch.setattr(f"sensing.weighing.film.{name}", other)
    assert list(film_readings(EndcapConfig("a", "0"), str(tmp_path / "a.mcap"), None)) == [1, 2]
    assert str(error) in caplog.text


@pytest.mark.parametrize(
    ("name", "said"), [("d.xyz", "must end in .png"), ("none/d.png", "No such file"), ("d", "must")]
)
def test_a_picture_that_cannot_be_written_is_refused_before_the_recording_is_read(tmp_path, capsys, name, said):
    path = tmp_path / "endcaps.toml"
    path.write_text('[[endcap]]\nname = "a"\nsource = "0"\n')
    words = ["--config", str(path), "--source", "none.mcap", "--picture", str(tmp_path / name)]
    assert dwell.main(words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1 and [p.name for p in tmp_path.iterdir()] == ["endcaps.toml"]


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".pdf", ".SVG"])
def test_a_drawing_that_fails_leaves_the_older_picture(tmp_path, monkeypatch, suffix):
    picture = tmp_path / f"d{suffix}"
    picture.write_text("older")
    time_s, force_n, _ = creep()
    result = SimpleNamespace(level_n=15.0, corrected_n=force_n)
    dwell._require_picture(picture)
    dwell._draw(picture, time_s, force_n, result)
    good = picture.read_bytes()
    assert len(good) > 5000
    monkeypatch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(FileError, match="No space left"):
        dwell._draw(picture, time_s, force_n, result)
    assert picture.read_bytes() == good and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    ("here", "said"),
    [
        ({"diameter_mm": 130.0, "wall_mm": 8.0}, "endcap_0 was recorded from D200_T10, this endcap is D130_T8: give a"),
        ({"diameter_mm": 200.0, "wall_mm": 10.0}, "no picture of endcap_0"),
    ],
)
def test_a_recording_of_another_design_is_refused(tmp_path, here, said):
    held = EndcapConfig("endcap_0", "test", diameter_mm=200.0, wall_mm=10.0)
    recorder = Recorder(tmp_path / "a.mcap", LiveConfig((held,)), {"endcap_0": 0}, lambda _: None)
    recorder.start()
    recorder.close(60)
    with pytest.raises(FileError, match=said):
        next(film_readings(replace(held, **here), str(tmp_path / "a.mcap"), stand_in()))


@pytest.mark.parametrize("command", ["weigh", "dwell"])
def test_a_camera_file_of_another_size_than_a_film_is_one_line(tmp_path, monkeypatch, capsys, command):
    monkeypatch.setattr(f"sensing.{command}.configured_models", lambda *_, **__: lambda _: stand_in())
    monkeypatch.setattr(f"sensing.{command}.warm_up", lambda _: None)
    monkeypatch.setattr("sensing.weigh.weights_digest", lambda _: "0")
    nominal_mount(EndcapParams(130, 8), 1280, 960).save(tmp_path / "c.json")
    (tmp_path / "p.jpg").write_bytes(film([0])[0])
    (tmp_path / "e.toml").write_text("[[endcap]]\nname = 'a'\nsource = '0'\ncamera = 'c.json'\n")
    film_of = str(tmp_path / "p.jpg")
    poses = [f"--pose=tilt=0,grams={weight},source={film_of}" for weight in (600, 1800)]
    words = poses if command == "weigh" else ["--source", film_of]
    run = weigh.main if command == "weigh" else dwell.main
    assert run(["--config", str(tmp_path / "e.toml"), *words]) == 2
    error = capsys.readouterr().err
    assert "a camera of 1280x960 px, the pictures have 640x480" in error and error.count("\n") == 1


def test_a_gain_that_could_not_be_stored_is_not_asked_for(tmp_path, monkeypatch, capsys):
    def full(path):
        raise FileError(f"{path}: No space left on device")

    monkeypatch.setattr("sensing.weigh.require_place", full)
    monkeypatch.setattr("sensing.weigh.warm_up", lambda _: pytest.fail("went on"))
    (tmp_path / "e.toml").write_text('[[endcap]]\nname = "a"\nsource = "0"\n')
    assert weigh.main(["--config", str(tmp_path / "e.toml")], pytest.fail) == 2
    assert "No space left" in capsys.readouterr().err


def test_the_password_of_a_camera_is_not_shown_while_it_is_weighed(tmp_path, monkeypatch, capsys):
    def stopped(*_, **__):
        raise EOFError

    monkeypatch.setattr("sensing.weigh.warm_up", lambda _: None)
    monkeypatch.setattr("sensing.weigh.open_endcaps", stopped)
    (tmp_path / "e.toml").write_text('[[endcap]]\nname = "a"\nsource = "http://bob:secret@10.0.0.7/"\n')
    assert weigh.main(["--config", str(tmp_path / "e.toml")]) == 130
    out, err = capsys.readouterr()
    assert "http://***@10.0.0.7/" in out and "secret" not in out + err
