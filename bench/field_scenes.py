"""Scenes with known truth for the field benches: pictures, motions, disturbances, and how a method is judged on them.

Pictures: the photos of a folder when there is one, and rendered frames always. Each is pressed by smooth bumps near the
rim, shifts, turns and mixtures of 2 to 25 px peak (at 480 px short side), ramped up in six frames or reached in one
jump, then degraded: clean, mild, hard. Truth: the exact mean displacement of each of the 30 x 30 cells.

The warp samples by Keys' cubic convolution at places solved for in closed form (sensing.sources.warp): OpenCV's cubic
remapping shifts a ramp by up to 0.047 px, more than the error that is to be measured.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cad.params import EndcapParams
from sensing.decode import decode_bgr
from sensing.records import Frame, Image
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import Paint, RenderSettings
from sensing.sources.degrade import LEVELS, degrade, random_degradation
from sensing.sources.files import PICTURES, read_picture
from sensing.sources.warp import Bump, Displacement, cell_truth, warp_image
from sensing.tracking.methods import DotField, FieldMethod

PHOTOS = Path(__file__).resolve().parent.parent.parent / "shared" / "reference" / "photos"
RAMP = (1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0)
JUMP = (0.0, 1.0, 1.0, 0.0, -1.0, 0.0)  # a one-frame jump to the peak, back, and to the other side
SWAP_PX = 20.0  # at 480: a live dot further from its truth than this is another dot
FAILED_PX = 1.0  # of the 200 x 200 crop


@dataclass(frozen=True)
class Scene:
    """One frame with its truth."""

    frame: Frame
    displacement: Displacement
    truth: np.ndarray


def random_pattern(kind: int, rng: np.random.Generator, size: tuple[int, int]) -> Displacement:
    """Bump near the rim (kinds 0 and 1), shift (2), turn (3) or a mixture (4); peak 2 to 25 px at 480."""
    scale = min(size) / 480.0
    peak, centre = rng.uniform(2, 25) * scale, (size[0] / 2 - 0.5, size[1] / 2 - 0.5)
    turn = rng.uniform(0, 2 * np.pi)
    along = (float(np.cos(turn)), float(np.sin(turn)))

    def bump(push: float) -> Bump:
        azimuth, radius, aim = rng.uniform(0, 2 * np.pi), rng.uniform(120, 260) * scale, rng.uniform(0, 2 * np.pi)
        place = (centre[0] + radius * np.cos(azimuth), centre[1] + radius * np.sin(azimuth))
        return Bump(place, (push * np.cos(aim), push * np.sin(aim)), rng.uniform(22, 42) * scale)

    spin = peak / (240 * scale) * rng.choice([-1, 1])
    if kind <= 1:
        return Displacement(pivot_px=centre, bumps=(bump(peak),))
    if kind == 2:
        return Displacement((peak * along[0], peak * along[1]), pivot_px=centre)
    if kind == 3:
        return Displacement(turn_rad=spin, pivot_px=centre)
    bumps = (bump(0.4 * peak), bump(0.4 * peak))
    return Displacement((0.3 * peak * along[0], 0.3 * peak * along[1]), 0.3 * spin, centre, bumps)


def sequence(picture: Image, pattern: int, level: str, seed: int) -> Iterator[Scene]:
    """Six frames of one picture, pattern and level."""
    seed += pattern
    rng = np.random.default_rng(seed)
    size = (picture.shape[1], picture.shape[0])
    peak, damage = random_pattern(pattern % 5, rng, size), random_degradation(level, rng, size)
    for index, share in enumerate(JUMP if seed % 3 == 0 else RAMP):
        now = peak.scaled(share)
        jpeg = degrade(warp_image(picture, now), damage, rng)
        yield Scene(Frame(index / 30, index, "bench", jpeg=jpeg, size=size), now, cell_truth(now, size))


def pictures(photos: Path | None) -> dict[str, dict[str, Image]]:
    """{"photo": {name: picture}, "rendered": {...}}; no photo entry when there is no folder."""
    found: dict[str, dict[str, Image]] = {}
    if photos is not None and photos.is_dir():
        files = sorted(p for p in photos.iterdir() if p.suffix.lower() in PICTURES)
        found["photo"] = {p.stem: decode_bgr(read_picture(p)) for p in files}
    paints = {"rendered_1": Paint(), "rendered_2": Paint(digit="4", unpainted=0.1, extra=2)}
    found["rendered"] = {
        name: DomeRenderer(
            EndcapParams(diameter_mm=130.0, wall_mm=8.0), settings=RenderSettings(seed=seed, paint=paint)
        ).render().image_bgr
        for seed, (name, paint) in enumerate(paints.items(), start=1)
    }  # fmt: skip
    return found


def reference_of(image: Image, name: str) -> Frame:
    """The undeformed picture as a camera would send it."""
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
    return Frame(0.0, 0, name, jpeg=jpeg, size=(image.shape[1], image.shape[0]))


def ready(worker: FieldMethod, reference: Frame) -> FieldMethod:
    """As live has it before the first frame: what belongs to the reference is made, compiled code is loaded."""
    worker.update(reference)
    if isinstance(worker, DotField):
        _ = worker.tracker.wide
        worker.tracker.restart()
    return worker


def measure(bag: dict[str, list], worker: FieldMethod, scene: Scene) -> None:
    """Runs one frame and appends its time (CPU time of this thread) and errors to the bag's lists."""
    start = time.thread_time()
    field = worker.update(scene.frame)
    bag["ms"].append((time.thread_time() - start) * 1e3)
    size = scene.frame.size or (640, 480)
    bag["cells"].append(np.linalg.norm(field.channels - scene.truth, axis=0).ravel().astype(np.float32))
    bag["valid"].append(field.valid.ravel())
    if isinstance(worker, DotField) and worker.tracks is not None:
        tracks, scale = worker.tracks, min(size) / 480.0
        truth = np.stack(scene.displacement.at(tracks.reference_px[:, 0], tracks.reference_px[:, 1]), axis=1)
        off = np.linalg.norm(tracks.displacement_px - truth, axis=1)[~tracks.lost] / scale
        bag["dots"].append(off.astype(np.float32))
        bag["lost"].append(np.array([tracks.lost.mean()]))


def summary(bag: dict[str, np.ndarray]) -> dict[str, object]:
    """The numbers reported for one bag of concatenated lists."""
    cells, valid, ms = bag["cells"], bag["valid"], bag["ms"]
    row: dict[str, object] = {
        "frames": len(ms),
        "ms_median": round(float(np.median(ms)), 3),
        "ms_p20": round(float(np.percentile(ms, 20)), 3),
        "ms_p95": round(float(np.percentile(ms, 95)), 3),
        "mean_px": round(float(cells.mean()), 4),
        "p95_px": round(float(np.percentile(cells, 95)), 4),
        "max_px": round(float(cells.max()), 2),
        "failed_percent": round(float((cells > FAILED_PX).mean() * 100), 3),
        "failed_of_valid_percent": round(float((cells[valid] > FAILED_PX).mean() * 100) if valid.any() else 0.0, 3),
        "valid_percent": round(float(valid.mean() * 100), 2),
    }
    if "dots" in bag:
        dots = bag["dots"]
        row |= {
            "dot_mean_px": round(float(dots.mean()), 4),
            "dot_median_px": round(float(np.median(dots)), 4),
            "dot_p95_px": round(float(np.percentile(dots, 95)), 4),
            "dot_max_px": round(float(dots.max()), 2),
            "swaps": int((dots > SWAP_PX).sum()),
            "lost_percent": round(float(bag["lost"].mean() * 100), 3),
        }
    return row


def concatenated(bag: dict[str, list]) -> dict[str, np.ndarray]:
    """Lists of one bag to arrays."""
    return {key: np.concatenate(v) if key != "ms" else np.array(v) for key, v in bag.items()}


__all__ = ["LEVELS", "PHOTOS", "concatenated", "measure", "pictures", "ready", "reference_of", "sequence", "summary"]
