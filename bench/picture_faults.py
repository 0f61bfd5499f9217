"""Damage to a camera's picture, one function a fault: what the camera sends instead (:mod:`bench_faults` counts)."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

Rng = np.random.Generator
Fault = Callable[[np.ndarray, bytes, Rng], bytes]  # (picture, its JPEG) -> what the camera sends


def _jpeg(picture: np.ndarray, rng: Rng) -> bytes:
    """With the sensor's noise, as a camera would send it."""
    noisy = picture + rng.normal(0.0, 1.5, picture.shape)
    options = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(85, 96))]
    return cv2.imencode(".jpg", np.clip(noisy, 0, 255).astype(np.uint8), options)[1].tobytes()


def flipped_bits(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """One to three bits."""
    data = bytearray(jpeg)
    for place in rng.integers(2, len(data) - 2, rng.integers(1, 4)):
        data[place] ^= 1 << int(rng.integers(8))
    return bytes(data)


def flipped_bytes(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """One to twenty bytes."""
    data = bytearray(jpeg)
    for place in rng.integers(2, len(data) - 2, rng.integers(1, 21)):
        data[place] ^= int(rng.integers(1, 256))
    return bytes(data)


def lost_packet(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """A piece of the stream is missing."""
    begin, length = int(rng.integers(600, len(jpeg) - 100)), int(rng.choice([64, 512, 1024, 3072]))
    return jpeg[:begin] + jpeg[begin + length :]


def doubled_packet(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """A piece of the stream came twice."""
    begin, length = int(rng.integers(600, len(jpeg) - 100)), int(rng.choice([64, 512, 1024, 3072]))
    return jpeg[: begin + length] + jpeg[begin:]


def cut_short(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Cut, with or without an end marker."""
    return jpeg[: int(rng.integers(2, len(jpeg)))] + (b"\xff\xd9" if rng.random() < 0.5 else b"")


def torn(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Rows from some row on slid sideways."""
    row, by = int(rng.integers(40, 440)), int(rng.integers(2, 60)) * int(rng.choice([-1, 1]))
    slid = picture.copy()
    slid[row:] = np.roll(slid[row:], by, axis=1)
    return _jpeg(slid, rng)


def no_picture(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """A message, an empty JPEG, or a PNG."""
    return [b"<html>busy</html>", b"\xff\xd8\xff\xd9", cv2.imencode(".png", picture.astype(np.uint8))[1].tobytes()][
        rng.integers(3)
    ]


def black(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Lens covered, or lamp off."""
    return _jpeg(picture * rng.choice([0.0, 0.005, 0.02]), rng)


def dim(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Little light, much noise."""
    return _jpeg(picture * rng.uniform(0.03, 0.5) + rng.normal(0, rng.uniform(0, 4), picture.shape), rng)


def white(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Far too much light."""
    return _jpeg(np.clip(picture * rng.uniform(2.0, 20.0) + rng.uniform(0, 200), 0, 255), rng)


def noisy(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Sensor noise of 5 to 120 gray levels."""
    return _jpeg(picture + rng.normal(0, rng.uniform(5, 120), picture.shape), rng)


def only_noise(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Nothing but noise."""
    return _jpeg(rng.integers(0, 256, picture.shape).astype(float), rng)


def salt(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Black and white pixels."""
    speckled = picture.copy()
    hit = rng.random(picture.shape[:2]) < rng.uniform(0.001, 0.2)
    speckled[hit] = rng.integers(0, 2, (int(hit.sum()), 1)) * 255
    return _jpeg(speckled, rng)


def glare(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """One to three glints."""
    y, x = np.mgrid[0:480, 0:640].astype(np.float32)
    bright = picture.copy()
    for _ in range(int(rng.integers(1, 4))):
        radius = rng.uniform(4, 130)
        away = np.hypot(x - rng.uniform(60, 580), (y - rng.uniform(0, 480)) * rng.uniform(0.5, 2))
        glow = 0.5 * rng.uniform(30, 400) * (1 - np.tanh((away - radius) / (rng.uniform(0.05, 0.5) * radius + 1)))
        bright = bright + glow[:, :, None]
    return _jpeg(bright, rng)


def dirt(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Specks on lens or skin."""
    light = np.ones((480, 640), np.float32)
    size = rng.uniform(1, 20)
    for _ in range(int(rng.integers(1, 30))):
        speck = np.zeros((480, 640), np.float32)
        centre = int(rng.uniform(60, 580)), int(rng.uniform(0, 480))
        axes = int(size * rng.uniform(0.5, 1.5)) + 1, int(size * rng.uniform(0.5, 1.5)) + 1
        cv2.ellipse(speck, centre, axes, rng.uniform(0, 180), 0, 360, 1.0, -1)
        light *= 1 - rng.uniform(0.2, 1) * cv2.GaussianBlur(speck, (0, 0), rng.uniform(0.7, 4))
    return _jpeg(picture * light[:, :, None], rng)


def blurred(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Out of focus."""
    return _jpeg(cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.5, 12)), rng)


def lamp_out(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Some of the ring's light is missing from one side."""
    y, x = np.mgrid[0:480, 0:640].astype(np.float32)
    turn = rng.uniform(0, 2 * np.pi)
    along = ((x - 320) * np.cos(turn) + (y - 240) * np.sin(turn)) / 400
    return _jpeg(picture * np.clip(1 - rng.uniform(0.2, 1.2) * np.clip(along + 0.5, 0, 1), 0, 1)[:, :, None], rng)


def wrong_size(picture: np.ndarray, jpeg: bytes, rng: Rng) -> bytes:
    """Another mode of the camera."""
    sizes = [(320, 240), (800, 600), (640, 360), (480, 640), (1280, 720), (648, 480)]
    return _jpeg(cv2.resize(picture, sizes[rng.integers(len(sizes))]), rng)


FAULTS: tuple[Fault, ...] = (
    flipped_bits, flipped_bytes, lost_packet, doubled_packet, cut_short, torn, no_picture, black, dim, white, noisy,
    only_noise, salt, glare, dirt, blurred, lamp_out, wrong_size,
)  # fmt: skip
STAYS = (glare, dirt, dim, lamp_out, blurred, torn, white)  # light and dirt: the same for all frames of a fault
