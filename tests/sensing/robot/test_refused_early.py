"""What would be refused at the end is refused at the start, before a robot is simulated for minutes."""

import pytest

from sensing.robot.node.cli import main
from sensing.tensegrity.robot_file import SHIPPED

SECOND = """
[[imu]]
name = "imu_second"
bar = "red"
place_m = [0.0, 0.0, 0.0]
"""


@pytest.mark.parametrize("name", ["there.mcap", "none/run.mcap"])
def test_where_nothing_can_be_recorded_nothing_is_simulated(name, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.robot.demo.simulated.SimulatedRobot", lambda *_, **__: pytest.fail("simulated"))
    (tmp_path / "there.mcap").write_text("mine")
    assert main(["--record", str(tmp_path / name), "--no-page"]) == 2
    error = capsys.readouterr().err
    assert name in error and error.count("\n") == 1
    assert (tmp_path / "there.mcap").read_text() == "mine"


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        ("stiffness_n_m = 4000.0", "stiffness_n_m = 4000.0\nmeasured = false", "no cable has measured = true"),
        ("[[imu]]", SECOND + "\n[[imu]]", "two inertial sensors"),
    ],
)
def test_a_robot_that_cannot_be_estimated_is_not_simulated(before, after, word, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.robot.demo.simulated.SimulatedRobot", lambda *_, **__: pytest.fail("simulated"))
    count = 1 if before == "[[imu]]" else -1
    text = SHIPPED.read_text(encoding="utf-8").replace(before, after, count)
    (tmp_path / "robot.toml").write_text(text, encoding="utf-8")
    assert main(["--config", str(tmp_path / "robot.toml"), "--no-page"]) == 2
    error = capsys.readouterr().err
    assert word in error and error.count("\n") == 1


def test_a_port_that_is_none_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--port", "99999"])
    assert ended.value.code == 2
    assert "port 99999 outside 0..65535" in capsys.readouterr().err
