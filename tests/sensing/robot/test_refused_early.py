"""What would be refused at the end is refused at the start, before a robot is simulated for minutes."""

import pytest

from sensing.robot.node.cli import main


@pytest.mark.parametrize("name", ["there.mcap", "none/run.mcap"])
def test_where_nothing_can_be_recorded_nothing_is_simulated(name, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("sensing.robot.demo.simulated.SimulatedRobot", lambda *_, **__: pytest.fail("simulated"))
    (tmp_path / "there.mcap").write_text("mine")
    assert main(["--record", str(tmp_path / name), "--no-page"]) == 2
    error = capsys.readouterr().err
    assert name in error and error.count("\n") == 1
    assert (tmp_path / "there.mcap").read_text() == "mine"


def test_a_port_that_is_none_is_refused(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--port", "99999"])
    assert ended.value.code == 2
    assert "port 99999 outside 0..65535" in capsys.readouterr().err
