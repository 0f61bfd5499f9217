"""What shows that a video repeats parts of its pictures, and what does not."""

import cv2
import numpy as np
import pytest
from live_stand_in import film, pipeline

from sensing.live.core.kept import Kept, kept_of
from sensing.live.core.still_watch import StillWatch
from sensing.records import DotTracks, Frame

DOTS = 80
PLACES = np.random.default_rng(3).uniform([60, 20], [580, 460], (DOTS, 2))


def reason_after(moves, likenesses=None) -> str:
    """Of frames whose dots lie so far from their places."""
    watch = StillWatch()
    for k, moved in enumerate(moves):
        tracks = DotTracks(
            k / 30, np.arange(DOTS), PLACES, PLACES + moved, np.ones(DOTS), np.zeros(DOTS, bool), (640, 480)
        )
        watch.update(tracks, 0.99 + 1e-6 * k if likenesses is None else likenesses[k])
    return watch.reason


def noise(frames: int) -> np.ndarray:
    """(frames, dots, 2) of a clean camera, px."""
    return np.random.default_rng(4).normal(0, 0.004, (frames, DOTS, 2))


def partly_repeated(frames: int, share: float) -> np.ndarray:
    """The same, where that share of the dots is as in the frame before."""
    rng, moves = np.random.default_rng(5), noise(frames)
    for k in range(1, frames):
        kept = rng.random(DOTS) < share
        moves[k, kept] = moves[k - 1, kept]
    return moves


def test_a_video_that_keeps_parts_of_its_pictures_is_named_and_stays_so_under_a_press():
    rest = partly_repeated(20, 0.45)
    press = rest[-1] + np.linspace(0, 3, 60)[:, None, None] + noise(60)
    assert "H.264" in reason_after(rest)
    assert "H.264" in reason_after(np.concatenate([rest, press]))


@pytest.mark.parametrize(
    "moves", [noise(90), np.zeros((90, DOTS, 2)), partly_repeated(90, 0.05), partly_repeated(5, 0.4)]
)
def test_noise_a_few_still_dots_or_a_few_such_frames_are_no_sign(moves):
    assert not reason_after(moves)


def test_a_camera_that_sends_each_picture_twice_is_no_sign():
    moves = np.repeat(noise(30), 2, axis=0)
    moves[1::2, ::3] += 1e-3  # the search begins elsewhere the second time, and ends a little beside
    assert not reason_after(moves, np.repeat(0.99 + 1e-6 * np.arange(30), 2))
    assert reason_after(moves)  # only the likeness shows which it is


@pytest.mark.parametrize("rows", [0, 300])
def test_readings_of_such_a_video_are_degraded_and_others_are_not(rows):
    pictures = [cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1) for jpeg in film([0.0] * 16)]
    rng, endcap = np.random.default_rng(6), pipeline()
    pictures = [np.clip(p + rng.normal(0, 1.5, p.shape), 0, 255).astype(np.uint8) for p in pictures]
    for picture in pictures[1:]:
        picture[:rows] = pictures[0][:rows]  # that part is kept
    readings = [endcap.update(Frame(k / 30, k, "test", image=p)) for k, p in enumerate(pictures)]
    assert ("compressed" in readings[-1].wrench.flags) == (rows > 0)


def test_a_video_whose_file_says_so_is_degraded_from_the_first_picture_on_also_in_its_recording():
    pictures = [cv2.imdecode(np.frombuffer(jpeg, np.uint8), 1) for jpeg in film([0.0] * 4)]
    endcap, coding = pipeline(), "hevc at 0.01 bits a pixel"
    readings = [endcap.update(Frame(k / 30, k, "test", image=p, coding=coding)) for k, p in enumerate(pictures)]
    assert all("compressed" in reading.wrench.flags and coding in reading.reason for reading in readings)
    kept = kept_of(readings[0].before.text())  # recorded before the first picture, which then has no coding
    again = pipeline(zero_frames=0)
    again.set_zero(readings[0].zero, kept)
    replayed = [again.update(Frame(k / 30, k, "test", image=p)) for k, p in enumerate(pictures)]
    assert [r.reason for r in replayed] == [r.reason for r in readings]
    assert all(np.array_equal(a.wrench.force_n, b.wrench.force_n) for a, b in zip(replayed, readings, strict=True))


def test_what_was_seen_of_a_video_stays_after_a_restart():
    assert StillWatch("seen").reason == "seen" and not kept_of(Kept().text()).compressed
