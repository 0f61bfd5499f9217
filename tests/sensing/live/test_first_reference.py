"""The wait for a first reference: a slow computer is waited for, a camera without frames is not."""

import time
from types import SimpleNamespace

import pytest

from sensing.live.core import first_reference
from sensing.live.core.first_reference import without_reference


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
