"""Runs of the page: one at a time, by the commands of a terminal, with their lines as they are printed.

Where `make molds` does not write to a terminal, it prints one line with the seconds of each step; the page shows them.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from fab.workers import end_with_parent

ROOT = Path(__file__).resolve().parents[2]
MOST_LINES = 200
END_S = 30.0
STOPPED = 128 + signal.SIGTERM  # status of a command that was stopped, and of a run stopped between two of them

Commands = Callable[[tuple[str, ...], str, bool, Path], list[list[str]]]


def program_commands(words: tuple[str, ...], printer: str, is_whole: bool, exports: Path) -> list[list[str]]:
    """Commands of a run: molds, then slice and sheet if everything is wanted.

    Args:
        words: options of the variant.
        printer: on which it is printed.
        is_whole: whether slicer projects and build sheet are made, too.
        exports: folder that receives the folder of the variant.
    """
    options = [*words, f"printer={printer}", f"exports={exports}"]
    runs = [["-m", "fab.molds", *options]]
    if is_whole:
        runs += [["-m", "fab.slice", *options], ["-m", "fab.build_sheet", *options]]
    return [[sys.executable, *run] for run in runs]


@dataclass
class _State:
    label: str = ""
    running: bool = False
    status: int | None = None
    made: bool = False  # whether the first command, which makes the folder, has ended well
    lines: tuple[str, ...] = ()
    number: int = 0


class Jobs:
    """The current or last run, if there is one, and its lines."""

    def __init__(self, exports: Path, commands: Commands = program_commands) -> None:
        self._exports, self._commands = exports, commands
        self._changed = threading.Condition()
        self._state = _State()
        self._process: subprocess.Popen[str] | None = None
        self._is_stopped = self._is_closing = False

    def start(self, words: tuple[str, ...], printer: str, label: str, is_whole: bool) -> bool:
        """Begin a run; return False if one is in progress.

        Args:
            words: options of the variant.
            printer: on which it is printed.
            label: name of its folder.
            is_whole: whether slicer projects and build sheet follow.
        """
        with self._changed:
            if self._state.running or self._is_closing:
                return False
            self._is_stopped = False
            self._state = _State(label, True, number=self._state.number + 1)
            self._changed.notify_all()
        runs = self._commands(words, printer, is_whole, self._exports)
        threading.Thread(target=self._run, args=(runs,), daemon=True).start()
        return True

    def stop(self) -> None:
        """End the run: the command in progress leaves no files, and no other begins."""
        with self._changed:
            self._is_stopped = True
            process = self._process
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGTERM)

    def close(self) -> None:
        """End the run and wait for it."""
        with self._changed:
            self._is_closing = True
            self._changed.notify_all()
        self.stop()
        with self._changed:
            self._changed.wait_for(lambda: not self._state.running, END_S)

    def seen(self, number: int, wait_s: float = 0.0) -> dict[str, Any]:
        """State as JSON, once its number differs from the last one seen, or after a timeout.

        Args:
            number: of the last state seen.
            wait_s: timeout.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._state.number != number or self._is_closing, wait_s)
            return {
                "number": self._state.number,
                "label": self._state.label,
                "running": self._state.running,
                "status": self._state.status,
                "stopped": self._is_stopped and bool(self._state.status),
                "made": self._state.made,
                "lines": list(self._state.lines),
            }

    def _run(self, runs: Sequence[list[str]]) -> None:
        status = 0
        try:
            for run in runs:
                status = self._one(run)
                if status:
                    break
                self._state.made = True
        except OSError as error:
            status = 1
            self._say(f"{runs[0][0]}: {error.strerror or error}")
        with self._changed:
            self._state.running, self._state.status = False, status
            self._state.number += 1
            self._process = None
            self._changed.notify_all()

    def _one(self, run: list[str]) -> int:
        if self._is_stopped:
            return STOPPED
        process = subprocess.Popen(
            run, cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            errors="replace", start_new_session=True,  # Ctrl-C ends the page, which then ends the run
            preexec_fn=partial(end_with_parent, os.getpid()),
        )  # fmt: skip
        with self._changed:
            self._process = process
            is_stopped = self._is_stopped
        if is_stopped:  # stopped during the start
            process.send_signal(signal.SIGTERM)
        assert process.stdout is not None
        for line in process.stdout:
            self._say(line.rstrip())
        return process.wait()

    def _say(self, line: str) -> None:
        with self._changed:
            self._state.lines = (*self._state.lines[1 - MOST_LINES :], line)
            self._state.number += 1
            self._changed.notify_all()
