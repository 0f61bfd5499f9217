"""A reference taken under load shows itself when the endcap is let go; presses of a plane do not look so."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from live_stand_in import LinearModel, film, frames

from bench.bench_own_weight import View
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.load_watch import FLAG, LoadWatch
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.seen import SeenFrame
from sensing.records import DotTracks, ShearField
from sensing.tracking.model_input import ModelInput
from sensing.wrench.model import load_wrench_model

DESIGN, SIZE = EndcapParams(130.0, 8.0), (640, 480)
EVERY = 11  # of the presses of the library


@pytest.fixture(scope="module")
def model():
    return load_wrench_model(DESIGN)


@pytest.fixture(scope="module")
def presses(model) -> list[ShearField]:
    """Fields of presses of a plane on the nominal sensor, over all tilts and loads of the library."""
    view = View(DESIGN, DEFAULT_SILICONE)
    seen = ModelInput(SimpleNamespace(size=SIZE, reference_px=view.rest_px), model.shape, DESIGN)
    ids, good = np.arange(len(view.rest_px)), np.ones(len(view.rest_px))
    moved = [view.rest_px + view.pixels(press) for press in view.presses()[::EVERY]]
    return [seen.field(DotTracks(0.0, ids, view.rest_px, now, good, good < 0, SIZE)) for now in moved]


def reason_of(model, field: ShearField, gain: float = 1.0) -> str:
    watch, estimate = LoadWatch(model, gain), model.estimate(field)
    watch.update(field, replace(estimate, force_n=gain * estimate.force_n), touching=False)
    return watch.reason


def test_no_press_looks_like_a_reference_under_load(model, presses):
    assert len(presses) > 90 and not any(reason_of(model, field) for field in presses)


def test_the_end_of_a_press_under_which_the_reference_was_taken_is_named_with_its_force(model, presses):
    """Their answers are off by 1 to 10 N; those that are in range looked healthy before."""
    loads = [float(np.linalg.norm(model.estimate(field).force_n)) for field in presses]
    ended = [(load, replace(field, channels=-field.channels)) for load, field in zip(loads, presses, strict=True)]
    light = [(load, field) for load, field in ended if 1.5 < load < 12]
    unflagged = [(load, field) for load, field in light if not model.estimate(field).flags]
    named = [f"press of {load:.1f} N" in reason_of(model, field) for load, field in unflagged]
    assert len(named) > 20 and np.mean(named) > 0.75
    load, field = light[0]
    assert f"press of {2 * load:.1f} N" in reason_of(model, field, gain=2.0)
    load, field = min((one for one in unflagged if reason_of(model, one[1])), key=lambda one: one[0])
    assert load < 3 and f"press of {load / 4:.1f} N" in reason_of(model, field, gain=0.25)  # its limit goes along


def test_little_motion_and_models_of_other_kinds_say_nothing(model, presses):
    faint = replace(presses[0], channels=-0.01 * presses[0].channels)
    assert reason_of(model, faint) == "" and reason_of(LinearModel(), presses[0]) == ""


def test_a_field_that_reversed_is_no_press_of_the_training_says_nothing(model, presses):
    """A ball of 15 mm pressed with 25 N and more is answered with less than its field reversed."""
    strongest = max(presses, key=lambda field: float(np.abs(field.channels).max()))
    wild = replace(strongest, channels=np.float32(4.0) * np.roll(strongest.channels, 5, axis=2))
    reversed_ = model.estimate(replace(wild, channels=-wild.channels))
    watch = LoadWatch(model)
    watch.update(wild, replace(reversed_, force_n=0.1 * reversed_.force_n), touching=False)
    assert "out_of_range" in reversed_.flags and np.linalg.norm(reversed_.force_n) > 1 and watch.reason == ""


class LetGo:
    """A pipeline whose dots stand elsewhere than at its reference."""

    def __init__(self) -> None:
        model = load_model("default", DESIGN)
        self.pipe, self.count = EndcapPipeline(EndcapConfig("endcap_0", "test"), model, zero_frames=1), 1
        self.pipe.update(frames(film([0]))[0])
        self.places = self.pipe._used.method.tracker.reference_px
        away = self.places - [330.0, 230.0]
        self.press = 4.0 * np.exp(-(away**2).sum(axis=1, keepdims=True) / (2 * 50.0**2)) * away / 50.0
        self._rng = np.random.default_rng(0)

    def give(self, moved: np.ndarray, count: int):
        for _ in range(count):
            self.count += 1
            noisy = self.places + moved + self._rng.normal(0, 0.01, moved.shape)
            rows = np.column_stack([noisy, np.full(len(moved), 0.995), np.zeros(len(moved))])
            reading = self.pipe.update(
                SeenFrame(100 + self.count / 30, self.count, "test", size=SIZE, rows=rows, likeness=0.99)
            )
        return reading


def test_live_flags_it_within_a_second_and_until_an_untouched_frame_shows_none():
    run = LetGo()
    assert FLAG not in run.give(run.press, 40).wrench.flags
    run.give(0 * run.press, 5)
    let_go = run.give(-run.press, 31)
    assert FLAG in let_go.wrench.flags and "taken under load?" in let_go.reason and let_go.valid
    assert FLAG in run.give(2 * run.press, 40).wrench.flags  # a touch hides it
    run.pipe.request_restart()
    assert FLAG in run.give(2 * run.press, 40).wrench.flags
    assert FLAG not in run.give(0 * run.press, 40).wrench.flags
