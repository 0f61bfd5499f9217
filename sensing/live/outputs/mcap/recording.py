"""Starts and stops recordings during a run and reports their state; file names are chosen here, never by a viewer."""

from __future__ import annotations

import contextlib
import datetime
import shutil
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cad.errors import EndcapError, ParameterError
from sensing.live.core.seen import Pictures
from sensing.live.core.sink import reason_of
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.ros.frames import CamerasInUse

if TYPE_CHECKING:
    from sensing.live.run import LiveRun

MB, LOOK_S = 1e6, 0.5  # sizes are looked up anew this often
OTHERS_S = 0.5  # of the time that is left after a signal: for other outputs and the cameras; the file has the rest


class Recording:
    """The recording of a run, if there is one.

    Args:
        run: what is recorded.
        folder: where files go that are not named.
        pictures: which are recorded, unless others are asked for.

    Attributes:
        files: that were ended, oldest first.
    """

    def __init__(self, run: LiveRun, folder: Path, pictures: Pictures = Pictures.FULL) -> None:
        self._run, self._folder, self._pictures = run, folder, pictures
        self.files: list[Path] = []
        self._sizes: tuple[float, dict[str, Any]] = 0.0, {}
        self._recorder: Recorder | None = None
        self._ended: list[Recorder] = []  # those that are not whole
        self._said, self._failed = "", False  # of the last one, and whether it is not whole or could not begin
        self._lock = threading.Lock()

    @property
    def on(self) -> bool:
        """Whether frames are being written."""
        recorder = self._recorder
        return recorder is not None and not recorder.failed

    @property
    def note(self) -> str:
        """State in one line; empty when nothing was ever recorded."""
        recorder = self._recorder
        return self._said if recorder is None else recorder.note

    @property
    def loss(self) -> str:
        """Which files are not whole, in one line; empty if all are."""
        recorders = [*self._ended, *([] if self._recorder is None else [self._recorder])]
        return "; ".join(each.note for each in recorders if each.failed or each.dropped)

    def state(self) -> dict[str, Any]:
        """State for the page: file, its size, and the time for which the disk lasts; sizes in MB of 10^6 bytes."""
        now_s, recorder = time.monotonic(), self._recorder
        if now_s > self._sizes[0] + LOOK_S:
            with contextlib.suppress(OSError):  # a missing disk raises when it is written to
                self._sizes = now_s, self._look(recorder, now_s)
        pictures = self._pictures if recorder is None else recorder.pictures
        return {
            "on": self.on, "note": self.note, "failed": self._failed if recorder is None else bool(recorder.failed),
            "pictures": pictures.value,
            "files": [path.name for path in self.files], **self._sizes[1],
        }  # fmt: skip

    def _look(self, recorder: Recorder | None, now_s: float) -> dict[str, Any]:
        if recorder is None:
            return {"free_mb": round(shutil.disk_usage(self._folder).free / MB)}
        seconds, size_mb = now_s - recorder.begun_s, recorder.path.stat().st_size / MB
        free_mb = shutil.disk_usage(recorder.path.parent).free / MB
        rate = 60 * size_mb / max(seconds, 1.0)
        minutes = free_mb / max(rate, 1e-3)
        return {
            "name": recorder.path.name, "seconds": round(seconds), "size_mb": round(size_mb, 1),
            "mb_per_min": round(rate), "free_mb": round(free_mb), "minutes_left": round(minutes),
            "frames": recorder.frames, "lost": recorder.dropped,
        }  # fmt: skip

    def add_note(self, text: str) -> None:
        """A line of the viewer's into the file, if one is being written."""
        if self._recorder is not None and text:
            self._recorder.add_note(text)

    def start(self, path: Path | None = None, pictures: Pictures | None = None) -> None:
        """Begin a file.

        Args:
            path: of the file; None for a name of its own.
            pictures: which are recorded; None for those of the run.

        Raises:
            FileError: it exists already or cannot be made.
            ParameterError: pictures that cannot be had, or needed.
        """
        with self._lock:
            if self._recorder is not None and not self._recorder.failed:
                return
            self._finish()
            pictures = pictures or self._pictures
            self._require(pictures)
            now = datetime.datetime.now()
            stamp = f"{now:%Y%m%d_%H%M%S}_{now.microsecond // 1000:03d}"
            engine = self._run.engine
            pipelines = {endcap.name: endcap.pipeline for endcap in engine.endcaps}
            playback = self._run.playback
            recorder = Recorder(
                path or self._folder / f"endcap_{stamp}.mcap",
                self._run.config,
                {name: pipeline.epoch for name, pipeline in pipelines.items()},
                lambda name: pipelines[name].request_restart(),
                engine.health,
                pictures=pictures,
                played=None if playback is None else playback.timeline.clock(),
                cameras=CamerasInUse(list(pipelines.values()), lambda error: None),  # the state says why there is none
            )
            recorder.start()
            engine.add_sink(recorder, str(recorder.path))
            for pipeline in pipelines.values():
                pipeline.request_restart()
            self._recorder = recorder

    def stop(self) -> None:
        """End the file."""
        with self._lock:
            self._finish()

    def switch(self, on: bool, pictures: Pictures | None = None) -> str:
        """Start or stop, unless it is already so; returns the state in one line."""
        try:
            if on:
                self.start(pictures=pictures)
            else:
                self.stop()
        except EndcapError as error:
            self._said, self._failed = str(error), True
        except Exception as error:  # a bug in an output must not pass in silence
            self._said, self._failed = f"recording: {reason_of(error)}", True
        return self.note

    def _require(self, pictures: Pictures) -> None:
        """Refuse pictures that a replay does not have, and dots of a method that follows none."""
        playback = self._run.playback
        if playback is not None and list(Pictures).index(pictures) < list(Pictures).index(playback.pictures):
            raise ParameterError(
                f"the recording that is replayed has no whole pictures: record it with --record-pictures "
                f"{playback.pictures}",
                name="record_pictures",
            )
        methods = {endcap.pipeline.model.method for endcap in self._run.engine.endcaps} - {"dots"}
        if pictures is not Pictures.FULL and methods:
            raise ParameterError(
                f"--record-pictures {pictures} keeps dots, and method {', '.join(sorted(methods))} follows none: "
                "record with full pictures",
                name="record_pictures",
            )

    def _finish(self) -> None:
        recorder, self._recorder = self._recorder, None
        self._sizes = 0.0, {}
        if recorder is not None:
            self._said, self._failed = f"{recorder.path}: is being finished", False
            self._run.engine.remove_sink(recorder)
            recorder.close(max(0.0, self._run.patience_s - OTHERS_S))
            self.files.append(recorder.path)
            self._said = recorder.note
            self._failed = bool(recorder.failed or recorder.dropped)
            if self._failed:
                self._ended.append(recorder)
