"""What the Rerun viewer is given: every picture as a file that it can read, forces and torques, capture times."""

import sys
import types

import cv2
import numpy as np
import pytest
from live_stand_in import PATIENCE_S, film, frames, pipeline

from sensing.live.core.reading import EndcapReading
from sensing.live.outputs.rerun_view import RerunView
from sensing.records import Frame


@pytest.fixture
def viewer(monkeypatch):
    """A stand-in of the package: what was logged, and when."""
    said = types.SimpleNamespace(logged=[], now=None)
    module = types.ModuleType("rerun")
    module.init = lambda *_, **__: None
    module.set_time = lambda _, *, timestamp: setattr(said, "now", timestamp)
    module.log = lambda path, value: said.logged.append((path, said.now, value))
    module.Scalars = float
    module.EncodedImage = lambda *, contents, media_type: (media_type, contents)
    monkeypatch.setitem(sys.modules, "rerun", module)
    return said


def given_to(viewer, readings: list[EndcapReading]) -> dict[str, list]:
    view = RerunView()
    view.start()
    for reading in readings:
        view.put(reading)
    view.close(PATIENCE_S)
    assert not view.failed
    return {path: [(when, what) for each, when, what in viewer.logged if each == path] for path, *_ in viewer.logged}


def test_raw_pictures_are_shown_too_and_what_is_no_picture_is_not(viewer):
    jpegs = film([0, 0, 1.0])
    pipe, found = pipeline(), [frame for frame in frames(jpegs)]
    raw = cv2.imdecode(np.frombuffer(jpegs[1], np.uint8), cv2.IMREAD_GRAYSCALE)
    found[1] = Frame(found[1].time_s, 1, "test", image=raw)
    found.append(Frame(found[2].time_s + 1 / 30, 3, "test", jpeg=b"cut", fault="a cut picture"))
    logged = given_to(viewer, [pipe.update(frame) for frame in found])
    pictures = logged["endcap_0/image"]
    assert [kind for _, (kind, _) in pictures] == ["image/jpeg", "image/png", "image/jpeg"]
    assert np.array_equal(cv2.imdecode(np.frombuffer(pictures[1][1][1], np.uint8), cv2.IMREAD_UNCHANGED), raw)
    assert len(logged["endcap_0/force_n/z"]) == 4 and np.isnan(logged["endcap_0/force_n/z"][3][1])


def test_a_file_read_at_once_is_shown_at_its_own_pace(viewer):
    pipe = pipeline()
    logged = given_to(viewer, [pipe.update(frame, 50.0) for frame in frames(film([0, 0, 1.0]))])
    times = [when for when, _ in logged["endcap_0/force_n/z"]]
    assert np.diff(times) == pytest.approx([1 / 30] * 2, abs=1e-6)
