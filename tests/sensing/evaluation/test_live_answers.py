"""Frames of a set are judged by a pipeline of the set's own endcap: its size, its dots, its silicone, its camera."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import stand_in

from cad.identity import identity
from cad.params import EndcapParams
from cad.pattern import parse_rings
from sensing import evaluate
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.evaluation import intervals, live_answers
from sensing.records import Frame
from sensing.sources.drawn import Drawing, draw_dots
from sensing.wrench.model import load_wrench_model

OWN = EndcapParams(101, 10, parse_rings("1-5-9-12"), 6.0)
CAST_OF = "Dragon Skin 30"


@pytest.fixture
def data(tmp_path) -> SimpleNamespace:
    """What is read of a labelled set of an endcap with its own dots, cast of another silicone."""
    return SimpleNamespace(
        params=OWN, identity=identity(OWN, CAST_OF), silicone=CAST_OF, folder=tmp_path, require_whole=lambda: None,
        has_pictures=True,
    )  # fmt: skip


def test_the_endcap_of_the_pipeline_is_that_of_the_set(data):
    item = SimpleNamespace(reference=Frame(0.0, 0, "set", image=draw_dots(Drawing(), OWN)[0]))
    endcap = live_answers._pipeline(data, stand_in(), item, None).endcap
    assert endcap.identity.record() == data.identity.record() and endcap.params.dot_rings == OWN.dot_rings


@pytest.mark.parametrize("command", ["evaluate", "intervals"])
def test_the_camera_found_in_a_set_is_one_of_its_own_dots(data, command, monkeypatch):
    module, taken = {"evaluate": evaluate, "intervals": intervals}[command], []

    def answers(of_set, model, camera):
        if camera is not None:
            taken.append(MountedCamera.load(camera, of_set.identity))
        return SimpleNamespace(contact=np.zeros(0, bool), flagged=np.zeros(0, bool), take=lambda rows: None)

    monkeypatch.setattr(module, "camera_of_set", lambda of_set: nominal_mount(of_set.params, 640, 480))
    monkeypatch.setattr(module, "live_answers", answers)
    if command == "evaluate":
        evaluate._through_live(data, stand_in())
    else:
        intervals._judged(replace(load_wrench_model(), identity=data.identity), data)
    assert len(taken) == 1
