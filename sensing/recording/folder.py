"""A growing folder of own labelled frames, in the format of :mod:`sensing.records_labelled` (N, N m, s).

What a recording cannot know (depth, friction, the dots' true places) is NaN or empty. Shards appear whole or not at
all.
"""

from __future__ import annotations

import io
import json
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.identity import Identity, identity, require_same
from cad.materials import DEFAULT_SILICONE
from cad.params import EndcapParams
from cad.whole_file import hold_lock, replace_file
from sensing.frames import FtMount
from sensing.records import Frame
from sensing.records_labelled import COLUMNS, RECORDED, read_shard, shard_files
from sensing.set_manifest import FORMAT, identity_of, read_manifest, shard_path
from sensing.tracking.zero import Zero

SHARD_FRAMES = 200
TOUCH_N, REST_N = 0.5, 0.3  # E: contact begins and ends at these true forces
JPEG_QUALITY = 95
UNKNOWN: dict[str, Any] = {
    "T_world_endcap": np.full((4, 4), np.nan), "shift_mm": np.full(2, np.nan), "dots_mm": np.zeros((0, 3), np.float32),
    "dots_px": np.zeros((0, 2), np.float32), "dots_visible": np.zeros(0, bool), "phase": 0, "level": 0, "scene": -1,
    "endcap": -1, "reference": 0,
}  # fmt: skip


class Recording:
    """One folder, locked against other programs until it is closed; use as a context manager.

    Args:
        folder: a new one, or one that a recording of the same endcap and mounting began.
        params: the endcap.
        mount: of the force/torque sensor.
        silicone: row of cad/materials.csv that the endcap is cast of.

    Raises:
        FileError: the folder holds something else, is being written, or cannot be written.
    """

    def __init__(self, folder: Path, params: EndcapParams, mount: FtMount, silicone: str = DEFAULT_SILICONE) -> None:
        self.folder, self.name, self.params, self._mount = folder, folder.name, params, mount
        self._rows: list[dict[str, Any]] = []
        self._pictures: list[bytes] = []
        self._reference = b""
        self._tare = np.zeros(6)
        self._touching = False
        self._start_s: float | None = None
        try:
            self._made = not folder.exists()
            self._begun = (folder / "manifest.json").exists()  # by an earlier run, whose files stay
            (folder / "shards").mkdir(parents=True, exist_ok=True)
            self._lock = hold_lock(folder / ".lock")
        except BlockingIOError:
            raise FileError(f"{folder}: another recording is writing there: choose another folder") from None
        except OSError as error:
            raise FileError(f"{folder}: cannot be written ({error.strerror}): choose another folder") from error
        try:
            known = shard_files(folder)
            self._shard = int(known[-1].stem) + 1 if known else 0
            self._earlier = known
            self.paths = max((_paths_to(path) for path in known), default=0)
            self._path = self.paths
            self._manifest(identity(params, silicone))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the folder; nothing can be added any more. An empty folder is removed."""
        with suppress(OSError):  # closed before, or a folder that holds what is the user's
            if not self._begun and not any((self.folder / "shards").iterdir()):
                (self.folder / "shards").rmdir()
                (self.folder / "manifest.json").unlink(missing_ok=True)
                (self.folder / ".lock").unlink()
                if self._made:
                    self.folder.rmdir()
        self._lock.close()

    def begin(self, zero: Zero, tare: NDArray[np.float64]) -> None:
        """Reference picture and tare of what follows; a new path begins."""
        self.flush()
        self._reference, self._tare = _jpeg(zero.image), np.asarray(tare, float)
        self._path, self._touching = self.paths, False

    def add(self, frame: Frame, reading: NDArray[np.float64]) -> float:
        """Add one frame with the sensor's reading (6,) at its capture time, N and N m; returns the force norm, N."""
        if self._start_s is None:
            self._start_s = frame.time_s
        mount = FtMount(self._mount.T_endcap_ft, self._mount.reads, self._tare)
        wrench = mount.on_endcap(reading, frame.time_s)
        force = float(np.linalg.norm(wrench.force_n))
        if self._touching and force < REST_N:
            self._touching, self._path = False, self._path + 1
        self._touching = self._touching or force >= TOUCH_N
        self.paths = max(self.paths, self._path + 1)
        known = {
            "path": self._path, "step": frame.sequence, "time_s": frame.time_s - self._start_s, "exposure_s": 0.0,
            "force_n": np.array(wrench.force_n), "torque_nm": np.array(wrench.torque_nm), "contact": self._touching,
        }  # fmt: skip
        self._rows.append({name: known.get(name, UNKNOWN.get(name, np.nan)) for name in COLUMNS})
        self._pictures.append(frame.jpeg if frame.jpeg else _jpeg(frame.image))
        if len(self._rows) >= SHARD_FRAMES:
            self.flush()
        return force

    def flush(self) -> None:
        """Write the frames that were added.

        Raises:
            FileError: no space left (shards before stay), or the folder holds these very frames.
        """
        if not self._rows:
            return
        arrays: dict[str, NDArray[Any]] = {name: np.array([row[name] for row in self._rows]) for name in COLUMNS}
        for prefix, pictures in (("jpeg", self._pictures), ("reference_jpeg", [self._reference])):
            arrays[prefix] = np.frombuffer(b"".join(pictures), np.uint8)
            arrays[f"{prefix}_end"] = np.cumsum([len(picture) for picture in pictures])
        while self._earlier:  # at the first shard only: a run that begins like an earlier one is the same
            _require_other(self._earlier[-1], arrays)
            self._earlier.pop()
        buffer = io.BytesIO()
        np.savez(buffer, **cast(dict[str, Any], arrays))
        replace_file(shard_path(self.folder, self._shard), buffer.getvalue())
        self._shard += 1
        self._rows, self._pictures = [], []

    def _manifest(self, made_of: Identity) -> None:
        params = made_of.design
        wanted = {
            "diameter_mm": params.diameter_mm, "wall_mm": params.wall_mm, "protocol": RECORDED,
            "T_endcap_ft": np.asarray(self._mount.T_endcap_ft).tolist(), "reads": self._mount.reads,
        }  # fmt: skip
        if (self.folder / "manifest.json").exists():
            manifest = read_manifest(self.folder)
            found = manifest.get("request", {})
            other = [name for name, value in wanted.items() if found.get(name) != value]
            if other:
                said = ", ".join(f"{name}={found.get(name)}" for name in other)
                raise FileError(f"{self.folder}: holds a set with {said}: choose an empty folder or the same options")
            held = identity_of(self.folder, manifest)
            require_same(self.folder, "holds a recording", held, made_of, "choose an empty folder")
            return
        record = {"format": FORMAT, "phases": ["recorded"], "columns": COLUMNS, "identity": made_of.record()}
        request = wanted | {"seed": secrets.randbits(32)}  # so that no two recordings share an identity
        text = json.dumps({**record, "request": request}, indent=1)
        replace_file(self.folder / "manifest.json", text.encode())


def _paths_to(shard: Path) -> int:
    """How many paths there are up to the last one of a shard.

    Raises:
        FileError: it cannot be read, or says of no path.
    """
    found = read_shard(shard, ("path",))["path"]
    try:
        return int(found.max()) + 1
    except (ValueError, TypeError, OverflowError) as error:
        raise FileError(f"{shard}: not a shard of a recording ({error}): move it away") from error


def _require_other(shard: Path, arrays: dict[str, NDArray[Any]]) -> None:
    """Refuse frames that a shard begins with, as of a video recorded twice: training and test would share them.

    Raises:
        FileError: it does, or it cannot be read.
    """
    names = ("force_n", "time_s", "jpeg_end")  # the sizes of two pictures of a camera differ, too
    found = read_shard(shard, names)
    count = min(len(found["time_s"]), len(arrays["time_s"]))
    if all(np.array_equal(found[name][:count], arrays[name][:count]) for name in names):
        raise FileError(
            f"{shard.parents[1]}: holds this recording, or its beginning, already ({shard.name}): training and test "
            "would share its frames; give another source, or record it whole into an empty folder"
        )


def _jpeg(image: Any) -> bytes:
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
