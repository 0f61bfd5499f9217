"""The outputs that the options ask for, started in order and closed in reverse."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from sensing.live.run import LiveRun


def add_outputs(run: LiveRun, options: argparse.Namespace, outputs: ExitStack, stream: TextIO) -> None:
    """Start what is asked for; each is closed with ``outputs``.

    Raises:
        EndcapError: an output that cannot begin.
    """
    from sensing.live.outputs.recording import Recording

    recording = Recording(run, Path.cwd())
    outputs.callback(recording.stop)
    run.notes.append(lambda: recording.note)
    if options.record is not None:
        recording.start(None if options.record == Path() else options.record)
    if options.json:
        from sensing.live.outputs.json_lines import JsonLines

        lines = JsonLines(sys.stdout)
        lines.start()
        run.engine.add_sink(lines)
        outputs.callback(lines.close)
        run.stop_when(lambda: bool(lines.failed))
    if options.ros:
        from sensing.live.outputs.ros_topics import RosTopics

        topics = RosTopics(run.latest.names)
        topics.start()
        run.engine.add_sink(topics)
        outputs.callback(topics.close)
        run.notes.append(lambda: topics.note)
    if options.rerun:
        _add_rerun(run, outputs)
    if not options.no_page:
        from sensing.live.web.page import PageServer

        page = PageServer(run, recording, options.host, options.port)
        page.start()
        outputs.callback(page.close)
        run.notes.append(lambda: page.note)
        print(f"page: {page.url}", file=stream, flush=True)


def _add_rerun(run: LiveRun, outputs: ExitStack) -> None:
    from sensing.live.outputs.rerun_view import RerunView

    view = RerunView()
    view.start()
    run.engine.add_sink(view)
    outputs.callback(view.close)
