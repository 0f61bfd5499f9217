"""Start and stop a recording while it runs; names are chosen here, never by whoever asks."""

from __future__ import annotations

import datetime
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from cad.errors import EndcapError
from sensing.live.outputs.recorder import Recorder

if TYPE_CHECKING:
    from sensing.live.run import LiveRun

OTHERS_S = 0.5  # of the time that is left after a signal: for other outputs and the cameras; the file has the rest


class Recording:
    """The recording of a run, if there is one.

    Args:
        run: what is recorded. folder: where files go that are not named.
    """

    def __init__(self, run: LiveRun, folder: Path) -> None:
        self._run, self._folder = run, folder
        self._recorder: Recorder | None = None
        self._ended: list[Recorder] = []  # those that are not whole
        self._said = ""
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

    def start(self, path: Path | None = None) -> None:
        """Begin a file.

        Raises:
            FileError: it exists already or cannot be made.
        """
        with self._lock:
            if self._recorder is not None and not self._recorder.failed:
                return
            self._finish()
            now = datetime.datetime.now()
            stamp = f"{now:%Y%m%d_%H%M%S}_{now.microsecond // 1000:03d}"
            engine = self._run.engine
            pipelines = {endcap.name: endcap.pipeline for endcap in engine.endcaps}
            recorder = Recorder(
                path or self._folder / f"endcap_{stamp}.mcap",
                self._run.config,
                {name: pipeline.epoch for name, pipeline in pipelines.items()},
                lambda name: pipelines[name].request_restart(),
                engine.health,
            )
            recorder.start()
            engine.add_sink(recorder)
            for pipeline in pipelines.values():
                pipeline.request_restart()
            self._recorder = recorder

    def stop(self) -> None:
        """End the file."""
        with self._lock:
            self._finish()

    def switch(self, on: bool) -> str:
        """Start or stop, whichever is asked for; what is so already stays. Returns the state in one line."""
        try:
            if on:
                self.start()
            else:
                self.stop()
        except EndcapError as error:
            self._said = str(error)
        return self.note

    def _finish(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            self._run.engine.remove_sink(recorder)
            recorder.close(max(0.0, self._run.patience_s - OTHERS_S))
            self._said = recorder.note
            if recorder.failed or recorder.dropped:
                self._ended.append(recorder)
