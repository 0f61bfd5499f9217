"""Labelled frames on disk: what the simulator writes and training reads, without importing the simulator.

    data = LabelledSet("exports/data")
    train, test = data.split(0.15, seed=1)                  # by path: neighbours in time never part
    for item in data.frames(train):
        item.frame, item.reference, item.wrench, item.contact, item.dots_px

A folder holds ``manifest.json`` (what was asked for, in how many shards), ``camera.json``
(:mod:`sensing.camera.mount`), ``dots.npz`` (positions at rest, mm, endcap frame) and ``shards/NNNNN.npz``. A shard's
columns (:data:`COLUMNS`) have one row a frame; ``jpeg`` and ``reference_jpeg`` hold all its pictures end to end,
picture i ending at ``jpeg_end[i]``. Units are in the names (N, N m, mm, px, s, degrees). Wrenches act on the endcap, at
the origin of the endcap frame.
"""

from __future__ import annotations

import operator
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError, ParameterError
from cad.identity import Identity
from cad.params import EndcapParams
from sensing.npz import read_npz
from sensing.records import Frame, Wrench
from sensing.set_manifest import identity_of, is_locked, read_manifest

COLUMNS: dict[str, str] = {
    "path": "loading path (int); frames of one path follow one another and must stay on one side of a split",
    "step": "state within the path (int)",
    "phase": "number in the manifest's phases",
    "level": "simulator level that answered (1 is the full model)",
    "scene": "robot scene, -1 without",
    "endcap": "endcap of the robot 0..5, -1 without",
    "time_s": "middle of the exposure, from the path's start",
    "exposure_s": "length of the exposure, 0 for a state at rest",
    "latency_s": "from the middle of the exposure to when the frame was published",
    "tilt_deg": "polar angle of first contact from the tip",
    "azimuth_deg": "of the contact",
    "friction": "Coulomb coefficient",
    "depth_mm": "approach of the plane from first touch; negative while apart",
    "shift_mm": "(2) tangential travel of the plane along (meridian, lateral)",
    "normal_n": "force along the plane's normal",
    "T_world_endcap": "(4, 4) endcap to world, mm; the world is the plane: z its normal, toward the endcap",
    "force_n": "(3) on the endcap",
    "torque_nm": "(3) on the endcap about its origin",
    "contact": "whether anything touches",
    "patch_mm2": "area in contact when the exposure ends, counted in mesh points (how far off: docs/simulator.md)",
    "slip_share": "share of the normal force on points that slipped since the state before, when the exposure ends",
    "residual": "force imbalance over the load, or over 1 N where that is more (0 where a level gives none)",
    "dots_mm": "(d, 3) displacement of the dots",
    "dots_px": "(d, 2) where their ink is in the picture, NaN out of view",
    "dots_visible": "(d) painted, in the picture, not hidden",
    "lamp_brightness": "factor on the lamp",
    "lamp_gradient": "relative change of brightness from the middle of the ring to its brightest side",
    "lamp_azimuth_deg": "where that side is",
    "camera_exposure": "factor on the light collected",
    "reference": "which of the shard's reference pictures has this path's lamp",
}
RECORDED = "recorded"  # protocol of sets that sensing.record wrote, with which the names of their paths begin
PICTURES = ("jpeg", "jpeg_end", "reference_jpeg", "reference_jpeg_end")


@dataclass(frozen=True)
class LabelledFrame:
    """One frame with all that is known of it.

    Attributes:
        frame: the picture; ``sequence`` counts within the path, ``time_s`` is the middle of the exposure.
        reference: the untouched endcap in the same light.
        wrench: on the endcap, endcap frame; of simulated motions the mean of beginning and end of the exposure.
        contact: whether anything touches.
        dots_mm: (d, 3) displacement of the dots, mm, in the order of ``cad.dots.dot_pattern``.
        dots_px: (d, 2) where their ink is seen, full-size pixels; NaN out of view.
        dots_visible: (d,) whether a dot is painted, in the picture and not hidden.
        path: number of the loading path.
        phase: name of the phase of that path, such as "touch".
        labels: the row of every column (:attr:`LabelledSet.columns`).
    """

    frame: Frame
    reference: Frame
    wrench: Wrench
    contact: bool
    dots_mm: NDArray[np.float32]
    dots_px: NDArray[np.float32]
    dots_visible: NDArray[np.bool_]
    path: int
    phase: str
    labels: dict[str, Any]


class LabelledSet:
    """A folder of labelled frames; shards that are not there yet are no error.

    Raises:
        FileError: no manifest, or one of another format.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)
        self.manifest = read_manifest(self.folder)
        self.phases: tuple[str, ...] = tuple(self.manifest["phases"])
        self.shards = shard_files(self.folder)
        self._kept: tuple[int, dict[str, NDArray]] | None = None

    @property
    def params(self) -> EndcapParams:
        """The design that was simulated.

        Raises:
            FileError: a manifest that does not say it.
        """
        return self.identity.design

    @property
    def identity(self) -> Identity:
        """Design, dot pattern, camera, silicone and mesh of the endcap in it.

        Raises:
            FileError: a manifest that does not say it.
        """
        return identity_of(self.folder, self.manifest)

    @property
    def silicone(self) -> str | None:
        """Row of cad/materials.csv that the endcap is cast of; None in sets that do not record it.

        Raises:
            FileError: a manifest that does not say the design.
        """
        cast_of = self.identity.aspects.get("silicone") or {}
        return cast_of.get("name")

    def path_name(self, number: int) -> str:
        """Identity of a loading path: sets with equal ones have seen the same motion."""
        request = self.manifest["request"]
        return f"{request['protocol']}-{request['seed']}-{number}"

    def require_whole(self) -> None:
        """Refuse a set that is still being written, or that lacks shards.

        Raises:
            FileError: such a set, or one without any shard.
        """
        if not self.shards:
            raise FileError(f"{self.folder}: a set without shards: let the command that writes it run first")
        wanted = int(self.manifest.get("shards", 0))
        if is_locked(self.folder) or len(self.shards) < wanted:
            said = f"{len(self.shards)} of {wanted} shards" if wanted else f"{len(self.shards)} shards so far"
            raise FileError(
                f"{self.folder}: not whole ({said}), still being written or interrupted: let the command that writes "
                "it run to its end, or give it again to complete the set"
            )

    @cached_property
    def columns(self) -> dict[str, str]:
        """What each column holds, by name: :data:`COLUMNS`, and those that this set has besides."""
        own = self.manifest.get("columns")
        return COLUMNS | (own if isinstance(own, dict) else {})

    @property
    def has_pictures(self) -> bool:
        """False for a set that was written with ``--render off``."""
        return self.manifest.get("request", {}).get("render") != "off"

    def __len__(self) -> int:
        """Number of frames that are there."""
        return int(self._ends[-1]) if self.shards else 0

    def __getitem__(self, index: int) -> LabelledFrame:
        """One frame, in the order of :meth:`frames`; a negative index counts from the end.

        Raises:
            IndexError: no such frame.
            FileError: a corrupt shard, or a set without pictures.
        """
        row = operator.index(index)
        row = row + len(self) if row < 0 else row
        if not 0 <= row < len(self):
            raise IndexError(f"index={index} outside the {len(self)} frames of {self.folder}")
        shard = int(np.searchsorted(self._ends, row, side="right"))
        if self._kept is None or self._kept[0] != shard:  # neighbours lie in one shard: it is unpacked once
            self._kept = shard, read_shard(self.shards[shard])
        return self._frame_of(self.shards[shard], self._kept[1], row - (int(self._ends[shard - 1]) if shard else 0))

    @cached_property
    def _ends(self) -> NDArray[np.int64]:
        """Number of frames up to the end of each shard."""
        return np.cumsum([len(read_shard(path, ("path",))["path"]) for path in self.shards])

    def column(self, name: str) -> NDArray:
        """One column over all shards, in the order of :meth:`frames`.

        Raises:
            ParameterError: unknown column.
            FileError: a corrupt shard.
        """
        if name not in self.columns:
            raise ParameterError(f"column={name!r} is none of {', '.join(self.columns)}", name="column", value=name)
        parts = [read_shard(path, (name,))[name] for path in self.shards]
        return np.concatenate(parts) if parts else np.zeros(0)

    def split(self, share: float, seed: int) -> tuple[frozenset[int], frozenset[int]]:
        """Path numbers for (training, test): whole paths, drawn at random, about ``share`` of them for the test.

        Frames of one robot scene (``path // 6``) stay together. Each side gets one at least, but for a share of 0 or 1.

        Raises:
            ParameterError: a share outside 0..1, or a single path or scene to part.
        """
        if not 0 <= share <= 1:
            raise ParameterError(f"share={share:g} outside 0..1: give the test's part", name="share", value=share)
        scene, path = self.column("scene"), self.column("path")
        group = np.where(scene >= 0, scene, path)
        groups = np.random.default_rng(seed).permutation(np.unique(group))
        count = round(share * len(groups))
        if 0 < share < 1:
            if len(groups) < 2:
                raise ParameterError(
                    f"{self.folder}: {len(groups)} path or scene, at least 2 needed to part them: make more frames",
                    name="path",
                )
            count = min(max(count, 1), len(groups) - 1)
        test = np.isin(group, groups[:count])
        return frozenset(map(int, path[~test])), frozenset(map(int, path[test]))

    def frames(self, paths: Collection[int] | None = None) -> Iterator[LabelledFrame]:
        """Frames in the order they were written, of all paths or of those named.

        Raises:
            FileError: a corrupt shard (those before it have been given), or a set without pictures.
        """
        for file in self.shards:
            arrays = read_shard(file)
            for row in range(len(arrays["path"])):
                if paths is None or int(arrays["path"][row]) in paths:
                    yield self._frame_of(file, arrays, row)

    def _frame_of(self, file: Path, arrays: dict[str, NDArray], row: int) -> LabelledFrame:
        """A row of a shard."""
        if "jpeg" not in arrays:
            raise FileError(f"{file}: holds no pictures (written with --render off): use column() for its labels")
        try:
            labels = {name: arrays[name][row] for name in self.columns}
            picture = _picture(arrays["jpeg"], arrays["jpeg_end"], row)
            reference = _picture(arrays["reference_jpeg"], arrays["reference_jpeg_end"], int(labels["reference"]))
            return self._frame(file, labels, picture, reference)
        except (KeyError, IndexError, TypeError) as error:  # a column that lacks, or is shorter than others
            raise _not_whole(file, f"row {row}: {error}") from error

    def _frame(self, file: Path, labels: dict[str, Any], picture: bytes, reference: bytes) -> LabelledFrame:
        time_s, source = float(labels["time_s"]), f"{file} path {labels['path']}"
        return LabelledFrame(
            frame=Frame(time_s, int(labels["step"]), source, jpeg=picture, exposure=float(labels["camera_exposure"])),
            reference=Frame(0.0, 0, f"{source} reference", jpeg=reference),
            wrench=Wrench(time_s, labels["force_n"], labels["torque_nm"]),
            contact=bool(labels["contact"]),
            dots_mm=labels["dots_mm"],
            dots_px=labels["dots_px"],
            dots_visible=labels["dots_visible"],
            path=int(labels["path"]),
            phase=self.phases[int(labels["phase"])],
            labels=labels,
        )


def shard_files(folder: Path) -> list[Path]:
    """Shards of a set in order; a file whose name holds more than a number is none."""
    found = (folder / "shards").glob("[0-9]*.npz")
    return sorted((path for path in found if path.stem.isascii() and path.stem.isdigit()), key=lambda p: int(p.stem))


def read_shard(path: Path, names: Collection[str] | None = None) -> dict[str, NDArray]:
    """Arrays of a shard, all or those named.

    Raises:
        FileError: missing or corrupt.
    """
    try:
        return read_npz(path, names)
    except (OSError, ValueError, KeyError) as error:
        raise _not_whole(path, error) from error


def _not_whole(path: Path, said: object) -> FileError:
    return FileError(f"{path}: not a whole shard ({said}): delete it and run the command that wrote the set again")


def _picture(data: NDArray[np.uint8], ends: NDArray[np.int64], number: int) -> bytes:
    """One of the pictures that lie end to end."""
    return data[ends[number - 1] if number else 0 : ends[number]].tobytes()
