"""Requests for references that come while another is being made or taken: each is judged as it was asked for."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, LinearModel, wait_for

from sensing.live.core import reference
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.reference import PressedError, ReferenceTaker
from sensing.records import Frame

FRAME, LAST = Frame(0.0, 0, "a", jpeg=b"x"), SimpleNamespace(image=np.zeros((2, 2)))
PRESS_N = 9.0


class Method:
    """Stands for the field method that a reference is compared with."""


@pytest.fixture(autouse=True)
def pressed(monkeypatch):
    """Every reference looks pressed."""
    monkeypatch.setattr(reference, "ModelInput", Method)
    monkeypatch.setattr(reference, "take_zero", lambda frames, *_: SimpleNamespace(image=LAST.image, frames=frames))
    monkeypatch.setattr(reference, "press_n", lambda *_: PRESS_N)


def taker(build=lambda zero: Method(), kind: type[ReferenceTaker] = ReferenceTaker) -> ReferenceTaker:
    return kind("a", EndcapConfig("a", "0").params, 2, build, LinearModel(), 1.0)


def offer_both(asked: ReferenceTaker) -> None:
    for _ in range(2):
        asked.offer(FRAME, LAST)


@pytest.mark.parametrize("confirmed", [False, True])
def test_a_press_is_taken_only_where_it_is_confirmed(confirmed):
    asked = taker()
    asked.ask(confirmed)
    offer_both(asked)
    wait_for(lambda: asked._made is not None)
    if confirmed:
        assert asked.take() is not None and not asked.pressed
    else:
        with pytest.raises(PressedError):
            asked.take()
        assert asked.pressed


@pytest.mark.parametrize(("gain", "refused"), [(1.0, False), (4.0, True)])
def test_a_press_is_judged_in_the_newtons_of_the_endcaps_own_silicone(gain, refused):
    asked = ReferenceTaker(
        "a", EndcapConfig("a", "0").params, 2, lambda zero: Method(), LinearModel(), 2 * PRESS_N, gain
    )
    asked.ask()
    offer_both(asked)
    wait_for(lambda: asked._made is not None)
    if refused:
        with pytest.raises(PressedError, match=f"a press of {gain * PRESS_N:.1f} N"):
            asked.take()
    else:
        assert asked.take() is not None


def test_confirming_accepts_no_reference_that_was_being_made_before():
    begun, go_on = threading.Event(), threading.Event()

    def build(_zero):
        begun.set()
        assert go_on.wait(PATIENCE_S)
        return Method()

    asked = taker(build)
    asked.ask()
    offer_both(asked)
    assert begun.wait(PATIENCE_S)
    asked.ask(confirmed=True)
    go_on.set()
    asked._thread.join(PATIENCE_S)
    assert asked.take() is None and asked.collecting
    offer_both(asked)
    wait_for(lambda: asked._made is not None)
    assert asked.take() is not None


def test_a_reference_that_comes_while_one_is_looked_for_is_not_lost():
    class Interrupted(ReferenceTaker):
        """Its reference is made between a look at the last one and the moment it is put aside."""

        made, meanwhile = None, None

        @property
        def _made(self):
            value, meanwhile, self.meanwhile = self.made, self.meanwhile, None
            if meanwhile is not None:
                meanwhile()
            return value

        @_made.setter
        def _made(self, value):
            self.made = value

    def make():
        asked.offer(FRAME, LAST)
        asked._thread.join(0.2)  # without an end where it waits for its turn

    asked = taker(kind=Interrupted)
    asked.ask(confirmed=True)
    asked.offer(FRAME, LAST)
    asked.meanwhile = make
    assert asked.take() is None
    asked._thread.join(PATIENCE_S)
    assert asked.take() is not None


@pytest.mark.parametrize(("step_s", "gap_s", "taken"), [(1 / 30, 4.0, range(4, 9)), (2.0, 4.0, range(5))])
def test_a_reference_holds_no_picture_from_before_a_camera_was_unplugged(step_s, gap_s, taken):
    """It was the mean of two places of the camera, which reads as a load for ever; a slow camera has no such gap."""
    asked = ReferenceTaker("a", EndcapConfig("a", "0").params, 5, lambda zero: Method(), LinearModel(), 1.0)
    asked.ask(confirmed=True)
    for k in range(9):
        asked.offer(Frame(k * step_s + gap_s * (k >= 4), k, "a", jpeg=b"x"), None)
    wait_for(lambda: asked._made is not None)
    assert [frame.sequence for frame in asked.take().zero.frames] == list(taken)


def test_a_refusal_asks_again_only_where_nobody_has_asked_since():
    asked = taker()
    asked.ask()
    offer_both(asked)
    wait_for(lambda: asked._made is not None)
    with pytest.raises(PressedError):
        asked.take()
    asked.ask(confirmed=True)
    asked.ask_again()
    offer_both(asked)
    wait_for(lambda: asked._made is not None)
    assert asked.take() is not None
