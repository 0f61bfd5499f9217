"""Fault injector: damaged, black, noisy, glaring, dirty, wrong-size frames of untouched endcaps through the pipeline.

python bench/bench_faults.py [--frames 10000] [--seed 1] [--out bench/faults.csv] [--resume]

Each fault lasts for one, two or ten frames between good ones: damage is made anew for every frame, light and dirt stay
where they are. Every fault has its own seed, so that ``--resume`` goes on where a table ends. A force over 0.5 N on
a frame that is neither flagged nor invalid is a miss, and the last line counts them. The pictures are those of the
simulated robot at rest (rendered once on a computer).
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from sensing.live.core.config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.live.demo.scene import SceneSource, scene_film
from sensing.records import Frame

ENDCAPS, LEAD, STEP_S = 6, 3, 1 / 30
LIMIT_N = 0.5
LENGTHS = (1, 2, 10)  # frames that a fault lasts
COLUMNS = {  # of the table: attribute of the counts
    "frames": "frames", "invalid": "invalid", "flagged": "flagged", "unflagged": "unflagged", "misses": "misses",
    "largest_unflagged_n": "largest_n", "largest_after_n": "after_n",
}  # fmt: skip
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


@dataclass
class Count:
    """What became of the frames of one kind of fault."""

    frames: int = 0
    invalid: int = 0
    flagged: int = 0
    unflagged: int = 0
    misses: int = 0
    largest_n: float = 0.0
    after_n: float = 0.0  # on the first good frame behind

    def take(self, reading: EndcapReading) -> None:
        """One frame of a fault."""
        force_n = float(np.linalg.norm(reading.wrench.force_n)) if reading.valid else 0.0
        self.frames += 1
        self.invalid += not reading.valid
        self.flagged += reading.valid and bool(reading.wrench.flags)
        if reading.valid and not reading.wrench.flags:
            self.unflagged += 1
            self.misses += force_n > LIMIT_N
            self.largest_n = max(self.largest_n, force_n)

    def behind(self, reading: EndcapReading) -> None:
        """The first good frame after a fault."""
        if reading.valid and not reading.wrench.flags:
            self.after_n = max(self.after_n, float(np.linalg.norm(reading.wrench.force_n)))


class Bench:
    """Six untouched endcaps, each with its reference."""

    def __init__(self) -> None:
        film, endcap = scene_film(), EndcapConfig("endcap_0", "scene:0")
        model = load_model("default", endcap.params)
        self.jpegs = [[bytes(film.jpeg(k, tick)) for tick in range(3)] for k in range(ENDCAPS)]
        self.pictures = [[cv2.imdecode(np.frombuffer(j, np.uint8), 1) for j in row] for row in self.jpegs]
        self.pipelines = [EndcapPipeline(endcap, model, None, k, 1) for k in range(ENDCAPS)]
        self.count = 0

    def send(self, endcap: int, data: bytes) -> EndcapReading:
        """One frame through the pipeline, its size read from the bytes as a source does."""
        from sensing.sources.files import jpeg_size

        self.count += 1
        reading = self.pipelines[endcap].update(
            Frame(self.count * STEP_S, self.count, SceneSource.__name__, jpeg=data, size=jpeg_size(data))
        )
        assert reading is not None
        return reading

    def run(self, fault: Fault, length: int, rng: Rng, count: Count) -> None:
        """One fault between good frames."""
        endcap = int(rng.integers(ENDCAPS))
        for k in range(LEAD):
            self.send(endcap, self.jpegs[endcap][k])
        seed = int(rng.integers(2**31))
        for k in range(length):  # the same draw for all frames of a fault of light or dirt: it stays where it is
            variant = int(rng.integers(3))
            stays = fault in (glare, dirt, dim, lamp_out, blurred, torn, white)
            own = np.random.default_rng(seed if stays else seed + k)
            picture = self.pictures[endcap][variant].astype(np.float32)
            count.take(self.send(endcap, fault(picture, self.jpegs[endcap][variant], own)))
        count.behind(self.send(endcap, self.jpegs[endcap][0]))


def table(counts: dict[str, Count]) -> list[dict[str, object]]:
    """Rows of the CSV."""
    return [{"fault": name.replace("_", " ")} | {key: getattr(c, field) for key, field in COLUMNS.items()}
            for name, c in counts.items()]  # fmt: skip


def read_table(path: Path) -> dict[str, Count]:
    """Counts of a table that was written before."""
    with path.open(newline="", encoding="utf-8") as stream:
        return {
            row["fault"].replace(" ", "_"): Count(
                **{field: (float if key.endswith("_n") else int)(row[key]) for key, field in COLUMNS.items()}
            )
            for row in csv.DictReader(stream)
        }


def write_table(path: Path, counts: dict[str, Count]) -> None:
    """Whole or not at all: a bench that is stopped can be resumed."""
    rows = [
        {key: f"{value:.3f}" if isinstance(value, float) else value for key, value in row.items()}
        for row in table(counts)
    ]
    with path.with_suffix(".part").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    path.with_suffix(".part").replace(path)


def turns(frames: int) -> int:
    """How many faults so many frames are."""
    done = turn = 0
    while done < frames:
        done, turn = done + LENGTHS[turn // len(FAULTS) % len(LENGTHS)], turn + 1
    return turn


def main(arguments: list[str] | None = None) -> int:
    """Run and write the table; status 1 if there are misses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=10_000, metavar="N", help="faulty frames in all (10000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of all faults (1)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="table as CSV")
    parser.add_argument("--resume", action="store_true", help="go on with the table of --out")
    options = parser.parse_args(arguments)
    counts = {fault.__name__: Count() for fault in FAULTS}
    if options.resume and options.out is not None and options.out.exists():
        counts = read_table(options.out)
    bench, done = Bench(), sum(c.frames for c in counts.values())
    for turn in range(turns(done), turns(options.frames)):
        fault, length = FAULTS[turn % len(FAULTS)], LENGTHS[turn // len(FAULTS) % len(LENGTHS)]
        misses = counts[fault.__name__].misses
        bench.run(fault, length, np.random.default_rng([options.seed, turn]), counts[fault.__name__])
        done += length
        if counts[fault.__name__].misses > misses:
            print(f"turn {turn}: {fault.__name__} for {length} frames: a miss", file=sys.stderr)
        if sys.stderr.isatty():
            print(f"\r{done}/{options.frames} frames ", end="", file=sys.stderr)
        if options.out is not None and (turn + 1) % len(FAULTS) == 0:
            write_table(options.out, counts)
    if options.out is not None:
        write_table(options.out, counts)
    for row in table(counts):
        print("  ".join(f"{value!s:>{max(len(key), 14)}}" for key, value in row.items()))
    misses = sum(c.misses for c in counts.values())
    print(f"{done} frames with faults, seed {options.seed}: {misses} with a force over {LIMIT_N} N and no flag")
    return 1 if misses else 0


if __name__ == "__main__":
    raise SystemExit(main())
