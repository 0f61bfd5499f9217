"""What shows that a camera mixes its pictures, and what does not."""

from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from live_stand_in import PATIENCE_S, film, pipeline, stand_in

from sensing.live.core.config import LiveConfig
from sensing.live.core.kept import Kept, kept_of
from sensing.live.core.mixed_watch import FEWEST, FLAG, FRAMES, LEAST_PX, MOST, MixedWatch, memory_of_noise
from sensing.live.core.picture_watch import PictureWatch
from sensing.live.core.seen import Pictures
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.replay import read_config, verify
from sensing.records import DotTracks, Frame

DOTS, NOISE_PX = 80, 0.004
PLACES = np.random.default_rng(3).uniform([60, 20], [580, 460], (DOTS, 2))
ENOUGH = FRAMES * MOST


def white(count: int, dots: int = DOTS, seed: int = 4) -> np.ndarray:
    """(count, dots, 2) of a camera whose pictures stand alone, px."""
    return np.random.default_rng(seed).normal(0, NOISE_PX, (count, dots, 2))


def held(part: float, count: int = ENOUGH, seed: int = 4) -> np.ndarray:
    """The same where each picture holds a part of the one before, long since it began."""
    moves = white(count + 50, seed=seed)
    for k in range(1, len(moves)):
        moves[k] = part * moves[k - 1] + (1 - part) * moves[k]
    return moves[50:]


def blended(count: int = ENOUGH) -> np.ndarray:
    moves = white(count + 1)
    return (moves[1:] + moves[:-1]) / 2


def smooth(amplitude_px: float, hertz: float, count: int = ENOUGH) -> np.ndarray:
    """A part of the skin that moves, as under a light touch."""
    bump = np.exp(-((PLACES - [300, 200]) ** 2).sum(axis=1) / (2 * 90**2))[:, None] * [1.0, 0.4]
    return amplitude_px * np.sin(2 * np.pi * hertz * np.arange(count) / 30)[:, None, None] * bump


def tracks_at(number: int, moved: np.ndarray, lost: np.ndarray | None = None) -> DotTracks:
    """Of a frame whose dots lie so far from their places."""
    dots = len(moved)
    lost = np.zeros(dots, bool) if lost is None else lost
    places = PLACES[:dots]
    return DotTracks(number / 30, np.arange(dots), places, places + moved, np.ones(dots), lost, (640, 480))


def reason_after(moves, likenesses=None, lost=None, watch=None) -> str:
    watch = watch or MixedWatch()
    for k, moved in enumerate(moves):
        likeness = 0.99 + 1e-6 * k if likenesses is None else likenesses[k]
        watch.update(tracks_at(k, moved, None if lost is None else lost[k]), likeness)
    return watch.reason


@pytest.mark.parametrize("moves", [held(0.4), held(0.5), held(0.75), blended()], ids=["0.4", "0.5", "0.75", "pairs"])
def test_pictures_that_hold_a_part_of_those_before_are_named(moves):
    assert "noise reduction over time" in reason_after(moves[: FRAMES * FEWEST])
    assert not reason_after(moves[: FRAMES * FEWEST - 1])


@pytest.mark.parametrize("seed", range(4))
def test_pictures_that_stand_alone_are_not(seed):
    assert not reason_after(white(ENOUGH, seed=seed))


@pytest.mark.parametrize("part", [0.25, 0.5, 0.75])
def test_the_measure_is_that_of_the_closed_form(part):
    """Such noise has the covariance C_ij = part^|i-j|; what a projection R leaves of it has R C R, and r(L) is the sum
    of its L-th diagonal over that of its main one."""
    steps = np.arange(FRAMES)
    fit = np.linalg.qr(np.vander(np.linspace(-1, 1, FRAMES), 6))[0]
    left = np.eye(FRAMES) - fit @ fit.T

    def expected(covariance: np.ndarray, lag: int) -> float:
        seen = left @ covariance @ left
        return float(np.trace(seen, offset=lag) / np.trace(seen))

    coloured = part ** np.abs(steps[:, None] - steps)
    one, two = (expected(coloured, lag) - expected(np.eye(FRAMES), lag) for lag in (1, 2))
    found = [memory_of_noise(PLACES + held(part, FRAMES, seed), PLACES, LEAST_PX) for seed in range(20)]
    assert np.mean(found) == pytest.approx(one - 2 * max(0.0, two), abs=0.03)


@pytest.mark.parametrize("moves", [
    white(ENOUGH) + smooth(0.1, 0.5), white(ENOUGH) + smooth(0.3, 5.0), smooth(0.1, 0.5), np.zeros((ENOUGH, DOTS, 2)),
    held(0.75) / 10, white(ENOUGH) + 0.001 * np.arange(ENOUGH)[:, None, None],
    white(ENOUGH) + 0.05 * np.sin(2 * np.pi * np.arange(ENOUGH) / 6)[:, None, None] * (PLACES - [320, 240]) / 240,
], ids=["touched", "vibrating", "touched, no noise", "still", "hardly any noise", "drifting", "zoomed"])  # fmt: skip
def test_what_moves_and_what_has_no_noise_is_no_sign(moves):
    assert not reason_after(moves)


def test_a_drift_of_each_dot_by_itself_is_no_sign():
    """As of a lamp that warms: slow, and other in each dot."""
    slopes = np.random.default_rng(8).normal(0, 2e-4, (DOTS, 2))
    assert not reason_after(white(ENOUGH) + slopes * np.arange(ENOUGH)[:, None, None])


@pytest.mark.parametrize("period", [2, 3, 4, 7])
def test_a_film_that_is_shown_over_and_over_is_no_sign(period):
    """The simulated robot at rest shows a few pictures in turn: all its endcaps were flagged."""
    assert not reason_after(
        np.tile(white(period), (ENOUGH // period, 1, 1)) + 0.3 * white(ENOUGH // period * period, seed=5)
    )


def test_a_few_dots_that_flicker_are_no_sign():
    moves = white(ENOUGH)
    moves[:, :8] += 0.05 * np.sign(np.sin(np.arange(ENOUGH) / 3))[:, None, None]
    assert not reason_after(moves)


def test_a_camera_that_sends_each_picture_twice_is_no_sign():
    moves = np.repeat(white(ENOUGH), 2, axis=0)
    assert not reason_after(moves, np.repeat(0.99 + 1e-6 * np.arange(ENOUGH), 2))
    assert reason_after(moves)  # only the likeness shows which it is


def test_lost_dots_and_few_dots_are_left_out():
    lost = np.zeros((ENOUGH, DOTS), bool)
    lost[::10, :40] = True
    moves = held(0.5)
    wild = moves + 5.0 * lost[..., None]
    assert reason_after(wild, lost=lost)
    assert not reason_after(held(0.75)[:, :20])


def test_what_was_seen_stays_and_is_kept_over_a_restart():
    watch = MixedWatch()
    assert reason_after(held(0.5), watch=watch) == reason_after(white(ENOUGH), watch=watch)
    kept = kept_of(Kept(mixed=watch.reason).text())
    assert kept.mixed == watch.reason == PictureWatch(mixed=kept.mixed).reasons[FLAG]
    assert not kept_of('{"own_weight_g": [0, 0, 0], "moved": ""}').mixed


def test_a_video_that_says_it_keeps_parts_of_its_pictures_gets_one_flag():
    watch = PictureWatch()
    watch.take("h264 at 0.1 bits a pixel")
    for k, moved in enumerate(held(0.75)):
        watch.update(tracks_at(k, moved), 0.99 + 1e-6 * k)
    assert watch.compressed and not watch.mixed


def mixing_camera(part: float, count: int) -> Iterator[Frame]:
    """Frames of a dome with noise, each with that part of the one before."""
    still = cv2.imdecode(np.frombuffer(film([0.0])[0], np.uint8), 1).astype(np.float32)
    rng, picture = np.random.default_rng(6), still
    canvas = rng.normal(0, 2.0, (480 + 64, 640 + 64, 3)).astype(np.float32)
    for k in range(count):
        y, x = rng.integers(0, 65, 2)
        picture = part * picture + (1 - part) * (still + canvas[y : y + 480, x : x + 640])
        yield Frame(k / 30, k, "test", image=np.clip(np.rint(picture), 0, 255).astype(np.uint8))


@pytest.mark.parametrize("part", [0.0, 0.5])
def test_readings_of_such_a_camera_are_degraded_and_others_are_not(part):
    endcap = pipeline()
    readings = [endcap.update(frame) for frame in mixing_camera(part, FRAMES * FEWEST + 1)]
    assert (FLAG in readings[-1].wrench.flags) == (part > 0)


def test_a_recording_without_pictures_shows_the_same_when_it_is_computed_again(tmp_path):
    endcap, path = pipeline(), tmp_path / "run.mcap"
    shown = mixing_camera(0.5, FRAMES * FEWEST + 5)
    endcap.update(next(shown))
    recorder = Recorder(
        path, LiveConfig((endcap.endcap,)), {"endcap_0": endcap.epoch}, lambda _: None, pictures=Pictures.NONE
    )
    recorder.start()
    endcap.request_restart()
    readings = [endcap.update(frame) for frame in shown]
    for reading in readings:
        recorder.put(reading)
    recorder.close(PATIENCE_S)
    check = verify(path, read_config(path), lambda _: stand_in())
    assert (check.frames, check.different, check.end) == (len(readings), 0, None)
    assert FLAG in readings[-1].wrench.flags and FLAG not in readings[0].wrench.flags
