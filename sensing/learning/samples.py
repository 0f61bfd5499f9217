"""Training samples of wrench models: shear fields with their labels, made from a folder of labelled frames.

    samples = read_samples("exports/data")                       # tracks the dots of every frame once, then cached
    train, test = samples.split(0.2, seed=1)                     # whole paths

Fields in pixels of the 200 x 200 crop; wrenches on the endcap about the sphere's centre, N and N m
(:mod:`sensing.frames`). Every path has an identity (protocol, seed, number): paths of equal identity have the same
motion, and :func:`shared_between` finds them.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.identity import Identity, identity, require_same
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, transient
from cad.params import EndcapParams
from cad.whole_file import replace_file
from sensing.camera.chosen_module import other_module_words
from sensing.code_digest import code_digest
from sensing.frames import T_sphere_endcap, wrench_adjoint
from sensing.learning.found_camera import camera_file, camera_of_set, input_as_live
from sensing.learning.marker_fields import MarkerSensor, Scatter
from sensing.learning.symmetry import disc_cells
from sensing.records_labelled import COLUMNS, RECORDED, LabelledSet, read_shard
from sensing.tracking.methods import FieldMethod, field_method, method_code

SHAPE = (16, 16)  # cells of our model: about as many numbers as the dots give
# What decides what a sample is: dots, camera, tracker, frames of labels, and sensors that view fields without pictures.
SOURCES = ("cad", "sensing/wrench/dot_noise.py", *(
    f"sensing/{name}" for name in ("calibration", "camera", "decode.py", "frames.py", "learning", "tracking")
))  # fmt: skip
MARKERS = "markers"  # method of fields without pictures
SENSORS, VIEWS = 64, 4  # number of domain-randomised sensors of a set, and of those that view each run
# Arrays of the samples, in the order of their cache.
ROW_ARRAYS = (
    "fields", "valid", "wrenches", "path", "phase", "time_s", "contact", "tilt_deg", "azimuth_deg", "friction",
)  # fmt: skip


@dataclass(frozen=True)
class Samples:
    """N samples of one design.

    Attributes:
        fields: (N, 2, H, W) float32, px; cells that are not valid hold the method's values, too.
        valid: (N, H, W) bool, whether the field is valid.
        wrenches: (N, 6) on the endcap about the sphere's centre, N and N m.
        path: (N,) str identity of the loading path.
        phase: (N,) str, phase of the path.
        time_s: (N,) capture time within the path, s.
        contact: (N,) bool, whether anything touches.
        tilt_deg, azimuth_deg, friction: (N,) place of contact, degrees, and Coulomb's mu; NaN where unknown.
        design: design of the endcap.
        method: method of the field.
        sources: folders of the frames.
        identity: identity of the endcap; None for this toolkit's pattern and default silicone.
    """

    fields: NDArray[np.float32]
    valid: NDArray[np.bool_]
    wrenches: NDArray[np.float64]
    path: NDArray[np.str_]
    phase: NDArray[np.str_]
    time_s: NDArray[np.float64]
    contact: NDArray[np.bool_]
    tilt_deg: NDArray[np.float64]
    azimuth_deg: NDArray[np.float64]
    friction: NDArray[np.float64]
    design: EndcapParams
    method: str
    sources: tuple[str, ...]
    identity: Identity | None = None

    def __len__(self) -> int:
        return len(self.fields)

    def __post_init__(self) -> None:
        if self.identity is None:
            object.__setattr__(self, "identity", identity(self.design, DEFAULT_SILICONE))
        for name in ROW_ARRAYS:
            if len(getattr(self, name)) != len(self.fields):
                raise ParameterError(
                    f"{name} has {len(getattr(self, name))} rows, fields {len(self.fields)}: one for each", name=name
                )
        if self.wrenches.shape[1:] != (6,):
            raise ParameterError(
                f"wrenches of shape {self.wrenches.shape}: (N, 6) needed, no axis missing", name="wrenches"
            )
        if not (np.isfinite(self.fields).all() and np.isfinite(self.wrenches).all()):
            raise ParameterError(f"{self.where}: fields or wrenches that are not finite: drop them", name="fields")

    @property
    def where(self) -> str:
        """The folders in words, for messages."""
        return ", ".join(self.sources)

    @property
    def inputs(self) -> NDArray[np.float64]:
        """(N, 2 H W): u then v, row by row, zero in the corners that no dot reaches."""
        return (self.fields * disc_cells(self.fields.shape[2:])).reshape(len(self), -1).astype(float)

    def blocks(self, rows: int = 16384) -> Iterator[Samples]:
        """The samples in order, in blocks: ``inputs`` of a large set at once would fill the memory."""
        for start in range(0, len(self), rows):
            yield self.take(np.arange(start, min(start + rows, len(self))))

    @property
    def digest(self) -> str:
        """SHA-256 of fields and labels."""
        return hashlib.sha256(self.fields.tobytes() + self.wrenches.tobytes()).hexdigest()

    def take(self, rows: NDArray) -> Samples:
        """The samples that an index or a mask selects."""
        return replace(self, **{name: getattr(self, name)[rows] for name in ROW_ARRAYS})

    def split(self, share: float, seed: int, most: int = 10**9) -> tuple[Samples, Samples]:
        """(rest, about ``share`` of the paths, ``most`` at most): whole paths, at random, at least one on each side.

        Args:
            share: part of the paths, 0..1.
            seed: seed of the random choice.
            most: largest number of paths of the second part.

        Raises:
            ParameterError: fewer than two paths.
        """
        paths = np.unique(self.path)
        if len(paths) < 2:
            raise ParameterError(
                f"{self.where}: {len(paths)} loading path(s), at least 2 needed to part them: record more", name="path"
            )
        count = int(np.clip(min(round(share * len(paths)), most), 1, len(paths) - 1))
        aside = np.isin(self.path, np.random.default_rng(seed).permutation(paths)[:count])
        return self.take(~aside), self.take(aside)


def are_simulated(paths: Iterable[str]) -> bool:
    """Whether none of the loading paths of a training was recorded from a real endcap.

    Args:
        paths: their identities (:meth:`sensing.records_labelled.LabelledSet.path_name`).
    """
    return not any(path.startswith(f"{RECORDED}-") for path in paths)


def shared_between(train: Samples, test: Samples) -> list[str]:
    """Paths, contact poses and pictures that training and test share, although they must not."""
    found = [f"path {name}" for name in sorted(set(train.path) & set(test.path))]
    poses = [
        {
            (round(t, 3), round(a, 3), round(f, 6))
            for t, a, f in zip(s.tilt_deg, s.azimuth_deg, s.friction, strict=True)
            if np.isfinite([t, a, f]).all()
        }
        for s in (train, test)
    ]
    found += [f"pose tilt={t:g} azimuth={a:g} friction={f:g}" for t, a, f in sorted(poses[0] & poses[1])]
    pictures = [{field.tobytes() for field in s.fields[s.contact]} for s in (train, test)]
    return found + ["identical fields"] * len(pictures[0] & pictures[1])


def read_samples(
    folder: str | Path, method: str = "dots", shape: tuple[int, int] = SHAPE, radial: NDArray[np.float64] | None = None
) -> Samples:
    """Fields and labels of a folder of labelled frames (:mod:`sensing.records_labelled`).

    Fields are cached beside the data until these change, the camera file of a recording, or the code that makes fields,
    the toolkit's as well as a plug-in's.

    Args:
        folder: folder of the frames.
        method: method of the field. ``markers`` takes the fields of domain-randomised sensors
            (:mod:`sensing.learning.marker_fields`) instead of tracking the pictures; they represent those of ``dots``.
        shape: (H, W) of the field.
        radial: radial map of weights for tracked pictures (:attr:`sensing.wrench.model.WrenchModel.radial`).

    Raises:
        FileError: no such set, an incomplete one, or one of another dot pattern or camera than this toolkit's.
        ParameterError: unknown method.
    """
    data = LabelledSet(folder)
    design, here = data.params, identity(data.params)
    fix = f"{other_module_words(data.identity, here)}write the set again, or use the toolkit that wrote it"
    require_same(folder, "labelled frames", data.identity, here, fix)
    data.require_whole()
    seen_as = "" if radial is None or method == MARKERS else hashlib.sha256(radial.tobytes()).hexdigest()
    stamp = f"{code_digest(SOURCES)} {method}{method_code(method)} {shape} {here.digest} {seen_as} " + " ".join(
        f"{s.name}:{s.stat().st_size}:{s.stat().st_mtime_ns}"
        for s in (*data.shards, *filter(None, [camera_file(data)]))
    )
    digest = hashlib.sha256(stamp.encode()).hexdigest()
    cache = Path(folder) / f"fields_{method}_{shape[0]}x{shape[1]}.npz"
    rows = _cached(cache, digest)
    if rows is None:
        found: dict[str, list[Any]] = {name: [] for name in ROW_ARRAYS}
        seen = _marked(data, design, shape) if method == MARKERS else _tracked(data, design, method, shape, radial)
        for count, row in enumerate(seen, 1):
            for name, value in zip(ROW_ARRAYS, row, strict=True):
                found[name].append(value)
            if count % 50 == 0:
                transient(f"{data.folder}: {count} fields")
        rows = {name: np.array(values) for name, values in found.items()}
        _keep(cache, rows, digest)
    stands_for = "dots" if method == MARKERS else method
    return Samples(**rows, design=design, method=stands_for, sources=(str(folder),), identity=data.identity)


def _tracked(
    data: LabelledSet, design: EndcapParams, method: str, shape: tuple[int, int], radial: NDArray[np.float64] | None
) -> Iterator[tuple[Any, ...]]:
    """Rows in the order of :data:`ROW_ARRAYS`, from tracked pictures."""
    to_sphere = wrench_adjoint(T_sphere_endcap(design))
    worker: FieldMethod | None = None
    doubts: list[str] = []
    now, camera = None, camera_of_set(data) if method == "dots" else None
    for item in data.frames():
        run = (item.path, str(item.labels["azimuth_deg"]))
        if worker is None or run != now:  # a new run: another reference, or the contact jumps
            now = run
            if method == "dots":
                worker = input_as_live(item.reference, shape, design, camera, radial, doubts)
            else:
                worker = field_method(method, item.reference, shape, design)
        field = worker.update(item.frame)
        fields = np.where(np.isfinite(field.channels), field.channels, 0.0).astype(np.float32)
        yield fields, field.valid, *_label_row(data, item.labels, to_sphere)
    if doubts:
        LOG.warning(f"{data.folder}: the camera does not fit {len(doubts)} reference(s), fields are off: {doubts[0]}")


def _marked(data: LabelledSet, design: EndcapParams, shape: tuple[int, int]) -> Iterator[tuple[Any, ...]]:
    """Rows from the labels: every run as :data:`VIEWS` of :data:`SENSORS` domain-randomised sensors view it."""
    to_sphere = wrench_adjoint(T_sphere_endcap(design))
    rng = np.random.default_rng(int(data.manifest["request"]["seed"]))
    sensors = [MarkerSensor(design, shape, Scatter(), rng) for _ in range(SENSORS)]
    shown = shown_column(data)
    for file in data.shards:
        arrays = read_shard(file, {*COLUMNS, shown})
        if arrays["dots_mm"].shape[1:] != sensors[0].rest_mm.shape:
            raise ParameterError(f"{data.folder}: says nothing of its dots (a recording?): give --method dots")
        runs = arrays["path"] + 1j * arrays["azimuth_deg"]
        for run in np.unique(runs):
            rows = np.flatnonzero(runs == run)
            for number in rng.choice(SENSORS, VIEWS, replace=False):
                fields = sensors[number].fields(arrays[shown][rows])
                for field, row in zip(fields, rows, strict=True):
                    labels = {name: arrays[name][row] for name in COLUMNS}
                    yield field, sensors[number].valid, *_label_row(data, labels, to_sphere)


def shown_column(data: LabelledSet) -> str:
    """Column of a dot's motion as a window shows it: of its outline, or of its centre in sets without outlines."""
    return "outline_mm" if "outline_mm" in data.manifest.get("columns", ()) else "dots_mm"


def _label_row(data: LabelledSet, labels: dict[str, Any], to_sphere: NDArray[np.float64]) -> tuple[Any, ...]:
    return (
        to_sphere @ np.concatenate([labels["force_n"], labels["torque_nm"]]),
        data.path_name(int(labels["path"])),
        data.phases[int(labels["phase"])],
        float(labels["time_s"]),
        bool(labels["contact"]),
        float(labels["tilt_deg"]),
        float(labels["azimuth_deg"]),
        float(labels["friction"]),
    )


def _cached(path: Path, digest: str) -> dict[str, Any] | None:
    try:
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in ROW_ARRAYS} if str(archive["digest"]) == digest else None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
        return None  # absent or damaged: made again


def _keep(path: Path, rows: dict[str, Any], digest: str) -> None:
    np.savez(buffer := io.BytesIO(), **rows, digest=np.array(digest))
    replace_file(path, buffer.getvalue(), "free some space")
