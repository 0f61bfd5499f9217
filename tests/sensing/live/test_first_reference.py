"""The wait for a first reference: for a slow computer, not for a camera without frames; no dark picture serves."""

import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from live_stand_in import film, pipeline

from sensing.live.core import first_reference
from sensing.live.core.dark_pictures import AGAIN, DarkPictures
from sensing.live.core.first_reference import without_reference
from sensing.live.core.state import Event
from sensing.records import Frame
from sensing.tracking.zero import ZeroError


def endcap(zero_after_s: float, computes: bool = True, message: str = "leave it untouched"):
    """A stand-in whose reference is there after so many seconds."""
    begin_s = time.monotonic()

    class Pipeline:
        taker = SimpleNamespace(computing=computes)

        @property
        def zero(self):
            return "a reference" if time.monotonic() - begin_s > zero_after_s else None

    return SimpleNamespace(pipeline=Pipeline(), health=SimpleNamespace(message=message))


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    monkeypatch.setattr(first_reference, "ZERO_S", 0.2)
    monkeypatch.setattr(first_reference, "MOST_S", 1.0)


def test_a_reference_that_is_being_computed_is_waited_for():
    """A busy computer took over 20 s for one, and setup gave up with the words "leave it untouched"."""
    assert without_reference(endcap(0.5)) == ""


def test_a_camera_that_gives_no_frame_or_only_refused_ones_is_given_up():
    assert without_reference(endcap(9.0, computes=False)) == "not zeroed in 0 s: leave it untouched"
    assert without_reference(endcap(9.0, computes=False, message="")) == "not zeroed in 0 s: no frame came"


def test_a_computation_that_does_not_end_is_named():
    assert "not zeroed in 1 s: the computer is too busy" in without_reference(endcap(9.0))


def test_a_first_picture_in_which_darkness_hides_dots_is_no_reference_and_the_next_is():
    """Of a video whose camera settles its exposure all later forces were off, by 20 N under 19 N."""
    bright = [cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1) for jpeg in film([0.0] * 4)]
    dark = (bright[0] * 0.15).astype(np.uint8)
    dark[:, :320] = dark[240, 320]  # half of the dots are drowned
    endcap = pipeline()
    assert endcap.update(Frame(0.0, 0, "test", image=dark)) is None
    assert endcap.update(Frame(1 / 30, 1, "test", image=dark)) is None
    assert endcap.outcome[0] is Event.REFUSED and "gray value" in endcap.outcome[1]
    reading = endcap.update(Frame(2 / 30, 2, "test", image=bright[1]))
    assert reading.valid and not reading.wrench.flags & {"dark", "dots_missing"}
    confirmed = pipeline()
    confirmed.request_zero(confirmed=True)
    assert confirmed.update(Frame(0.0, 0, "test", image=dark)).valid


def test_of_pictures_that_stay_dark_one_in_thirty_is_looked_at_and_every_brighter_one():
    refused = SimpleNamespace(flags=frozenset({"dark", "camera_misfit"}), reason="too dark")
    image, brighter, dark = np.full((48, 64), 20, np.uint8), np.full((48, 64), 23, np.uint8), DarkPictures()
    dark.require_brighter(image)
    with pytest.raises(ZeroError):
        dark.require_light(refused, image)
    for _ in range(AGAIN - 1):
        with pytest.raises(ZeroError, match="too dark"):
            dark.require_brighter(image)
    dark.require_brighter(image)
    dark.require_brighter(brighter)
    dark.require_light(SimpleNamespace(flags=frozenset({"dark"}), reason=""), brighter)  # all dots are there
    dark.require_brighter(image)
