"""What a restart keeps of the frames before: own weight, a camera that has moved, a touch, silicone that relaxes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, stand_in
from turned_endcap import RATE_HZ, SIDEWAYS_G, Turned

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.kept import Kept, kept_of
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.seen import Pictures
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.replay import read_config, recorded_frames, verify
from sensing.live.timeline import Timeline
from sensing.wrench.relaxation import Overstress

OFF_G = 0.4  # the drawn dome is not the design to the pixel
SHIFT_PX = (1.0, 0.3)
RELAXATION = ((0.05, 0.1, 0.01), (0.04, 1.0, 0.01))  # strength, tau in s, sd


@pytest.fixture
def turned() -> Turned:
    return Turned()


def test_own_weight_is_still_taken_out_after_a_restart_during_a_touch(turned):
    turned.give(turned.sag, 10)
    before = turned.give(turned.sag + turned.touch, 10)[-1]
    assert before.own_weight_g == pytest.approx(SIDEWAYS_G, abs=OFF_G)
    turned.pipe.request_restart()
    after = turned.give(turned.sag + turned.touch, 10)[-1]
    assert after.epoch == before.epoch + 1 and after.own_weight_g.tolist() == before.own_weight_g.tolist()
    assert after.estimate.force_n == pytest.approx(before.estimate.force_n, abs=0.05)


def test_a_camera_that_has_moved_is_still_named_after_a_restart_during_a_touch(turned):
    shift = np.tile(SHIFT_PX, (len(turned.places), 1))
    assert "moved" in turned.give(shift, 10)[-1].wrench.flags
    turned.pipe.request_restart()
    assert all("moved" in reading.wrench.flags for reading in turned.give(shift + turned.touch, 10))
    turned.give(np.zeros_like(shift), 10)  # it was put back
    assert "moved" not in turned.give(turned.touch, 10)[-1].wrench.flags


def test_a_pause_of_a_minute_is_named_and_forgets_no_turn(turned):
    turned.give(turned.sag, 10)
    turned.count += round(75 * RATE_HZ)
    reading = turned.give(turned.sag + turned.touch, 1)[-1]
    assert "no frame for 75 s" in turned.pipe.note
    assert reading.own_weight_g == pytest.approx(SIDEWAYS_G, abs=OFF_G)


def test_a_restart_ends_no_contact(turned):
    """Of a force between those at which contact ends and begins: a recording that began there let go of it."""
    threshold = turned.pipe._measurement._detector.threshold
    whole_n = np.linalg.norm(turned.give(turned.touch, 10)[-1].wrench.force_n)
    light = turned.touch * (threshold.on_n + threshold.off_n) / 2 / whole_n
    held = turned.give(light, 20)[-1]
    assert held.contact.touching and held.contact.force_n < threshold.on_n
    turned.pipe.request_restart()
    after = turned.give(light, 5)
    assert after[0].epoch != held.epoch and all(reading.contact.touching for reading in after)
    assert not turned.give(np.zeros_like(light), 10)[-1].contact.touching


def relaxing(turned: Turned) -> Turned:
    """The same endcap with silicone that relaxes."""
    turned.pipe.endcap = replace(turned.pipe.endcap, relaxation=RELAXATION)
    turned.pipe.set_zero(turned.pipe.zero)
    return turned


@pytest.mark.parametrize("set_back_s", [0.0, 5.0])
def test_overstress_goes_on_after_a_restart(set_back_s):
    """It began relaxed, and read a step of 5 to 9 % of the force where nothing had moved."""
    forces = []
    for restarts in (False, True):
        turned = relaxing(Turned())
        turned.give(0 * turned.touch, 5)
        turned.give(turned.touch, 3)
        if restarts and not set_back_s:
            turned.pipe.request_restart()
        turned.count -= round(set_back_s * RATE_HZ) if restarts else 0
        forces.append([reading.estimate.force_n for reading in turned.give(turned.touch, 30)])
        assert ("was set back" in turned.pipe.note) is (restarts and set_back_s > 0)
    whole_n = np.linalg.norm(forces[0][-1])
    if set_back_s:  # the time between two frames is lost with the clock
        assert np.abs(forces[1][0] - forces[0][0]).max() < 0.02 * whole_n
    else:
        assert np.array_equal(*forces)
    assert np.linalg.norm(forces[0][0]) > 1.03 * whole_n


def test_a_recording_that_begins_while_the_silicone_relaxes_is_computed_again_to_the_bit(tmp_path):
    turned = relaxing(Turned())
    turned.give(turned.touch, 5)
    path = record_touch(turned, tmp_path, EndcapConfig("endcap_0", "test", relaxation=RELAXATION))
    check = verify(path, read_config(path), lambda _: stand_in())
    assert (check.frames, check.different, check.end) == (80, 0, None)
    assert next(iter(recorded_frames(path, "endcap_0"))).kept.overstress is not None


def test_a_new_reference_begins_with_nothing(turned):
    turned.give(turned.sag, 10)
    turned.pipe.set_zero(turned.pipe.zero)
    assert turned.give(turned.touch, 1)[0].before == Kept()


@pytest.fixture
def recorded(turned, tmp_path) -> Path:
    """A recording that begins during a touch, of an endcap that lies on its side and is then stood up."""
    turned.give(turned.sag, 10)
    turned.give(turned.sag + turned.touch, 5)
    return record_touch(turned, tmp_path, EndcapConfig("endcap_0", "test"))


def record_touch(turned: Turned, folder: Path, endcap: EndcapConfig) -> Path:
    path = folder / "run.mcap"
    recorder = Recorder(
        path, LiveConfig((endcap,)), {"endcap_0": turned.pipe.epoch}, lambda _: None, pictures=Pictures.NONE
    )
    recorder.start()
    turned.pipe.request_restart()
    for moved in (turned.sag + turned.touch, turned.sag, 0 * turned.sag, turned.touch):
        for reading in turned.give(moved, 20):
            recorder.put(reading)
    recorder.close(PATIENCE_S)
    assert not recorder.failed and recorder.frames == 80
    return path


def test_a_recording_that_begins_during_a_touch_is_computed_again_to_the_bit(recorded):
    check = verify(recorded, read_config(recorded), lambda _: stand_in())
    assert (check.frames, check.different, check.end) == (80, 0, None)
    first = next(iter(recorded_frames(recorded, "endcap_0")))
    assert first.zero is not None and first.kept.own_weight_g == pytest.approx(SIDEWAYS_G, abs=OFF_G)


@pytest.mark.parametrize("share", [0.1, 0.95])
def test_a_replay_that_begins_during_a_touch_has_the_turn_of_that_moment(recorded, share):
    timeline = Timeline(recorded)
    start = timeline.start("endcap_0", share * timeline.span_s)
    first = next(iter(recorded_frames(recorded, "endcap_0", start)))
    wanted = SIDEWAYS_G if share < 0.5 else (0.0, 0.0, 0.0)
    assert first.kept.own_weight_g == pytest.approx(wanted, abs=OFF_G)
    pipe = EndcapPipeline(EndcapConfig("endcap_0", "test"), stand_in(), None, 0, zero_frames=0)
    pipe.set_zero(first.zero, first.kept)
    assert pipe.update(first.frame).own_weight_g == pytest.approx(wanted, abs=OFF_G)


def test_what_is_kept_is_read_as_it_was_written():
    overstress = Overstress(((0.1, 1 / 3, 0.0, 1e-17, -2.0, 5.0),), 100.1, (1.0, 2.0, 3.0, 0.1, 0.2, 1 / 7))
    kept = Kept((0.1, -1 / 3, 2.0), "camera or lens have moved", "taken under load", True, overstress)
    assert kept_of(kept.text()) == kept
    assert kept_of(kept.on_another_clock.text()).overstress == Overstress(overstress.by_term)
    assert kept_of(kept.of_events.text()) == kept.of_events
    before = '{"own_weight_g": [0.5, 0, 1], "moved": ""}'  # of a recording made before loads were looked for
    assert kept_of(before) == Kept((0.5, 0.0, 1.0))


NO_OVERSTRESS = '{"own_weight_g": [0, 0, 0], "moved": "", "overstress": %s}'


@pytest.mark.parametrize("text", [
    "{", "[]", '{"own_weight_g": [1, 2], "moved": ""}', '{"own_weight_g": [9, 0, NaN]}', NO_OVERSTRESS % "[1]",
    NO_OVERSTRESS % '{"by_term": [[1, 2, 3]], "time_s": null, "long_term": []}',
    NO_OVERSTRESS % '{"by_term": [[1, 2, 3, 4, 5, Infinity]], "time_s": null, "long_term": []}',
    NO_OVERSTRESS % '{"by_term": [[1, 2, 3, 4, 5, 6]], "time_s": 1.0, "long_term": [1]}',
])  # fmt: skip
def test_other_text_is_refused(text):
    with pytest.raises((ValueError, KeyError, TypeError)):
        kept_of(text)
