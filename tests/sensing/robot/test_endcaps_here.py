"""Endcaps of this computer beside the robot: when they are ready, and what happens to readings that nobody takes."""

from dataclasses import replace

import numpy as np
import pytest
from live_program import camera
from live_stand_in import a_reading, stand_in

from cad.errors import ParameterError
from sensing.robot.node import endcaps_here
from sensing.tensegrity.robot_file import load_robot

ROBOT, NAMES = load_robot(), ("endcap_0", "endcap_3")


@pytest.fixture
def here_of(tmp_path, monkeypatch):
    """Endcaps of this computer by their names, started without a thread: a test puts the readings."""
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *_: stand_in())

    def opened(names):
        file = tmp_path / "endcaps.toml"
        with camera() as address:
            base = address[:-1]  # a camera for each
            file.write_text("".join(f'[[endcap]]\nname = "{name}"\nsource = "{base}{name[-1]}"\n' for name in names))
            here = endcaps_here.EndcapsHere(file, ROBOT)
            monkeypatch.setattr(here._engine, "start", lambda: None)
            here.start()
        return here

    return opened


def test_readings_that_nobody_takes_in_time_give_way_to_newer_ones(here_of):
    """After a pause the estimator needs what is newest: it takes nothing back beyond its history."""
    here, (_, reading) = here_of(NAMES), a_reading()
    for number in range(endcaps_here.ROOM + 3):
        here.put(replace(reading, endcap=NAMES[0], captured_s=float(number)))
    assert [sample.time_s for sample in here.samples()] == [float(3 + k) for k in range(endcaps_here.ROOM)]


def test_readings_that_can_no_longer_be_taken_are_named_once(here_of, capsys, monkeypatch):
    monkeypatch.setattr(endcaps_here, "NEWS_S", 0.0)
    here = here_of(NAMES)
    here._engine.sink_failed(here, RuntimeError("a fault"))
    assert not here.ready() and not here.ready()
    said = capsys.readouterr().err
    assert said.count("no more readings") == 1 and "a fault" in said


@pytest.mark.parametrize("patient", [True, False])
def test_it_begins_when_every_endcap_here_has_given_a_wrench_or_too_long_none(patient, here_of, monkeypatch, capsys):
    monkeypatch.setattr(endcaps_here, "FIRST_S", 1e4 if patient else 0.0)
    here, (_, reading) = here_of(NAMES), a_reading()
    lost = replace(reading, endcap=NAMES[0], wrench=replace(reading.wrench, force_n=np.full(3, np.nan)))
    here.put(lost)
    assert here.ready() is not patient
    assert ("no wrench of endcap_0, endcap_3" in capsys.readouterr().err) is not patient
    here.put(replace(reading, endcap=NAMES[0]))
    assert here.ready() is not patient
    here.put(replace(reading, endcap=NAMES[1]))
    assert here.ready() and [sample.endcap for sample in here.samples()] == [NAMES[0], *NAMES]


def test_endcaps_of_another_size_than_the_robots_are_refused(tmp_path):
    file = tmp_path / "endcaps.toml"
    file.write_text('[[endcap]]\nname = "endcap_0"\nsource = "0"\ndiameter_mm = 180.0\nwall_mm = 10.0\n')
    with pytest.raises(ParameterError, match=r"endcap_0 has diameter_mm = 180 .* description 130"):
        endcaps_here.EndcapsHere(file, ROBOT)
