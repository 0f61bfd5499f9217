"""Opens the outputs of the command line, in order; they are closed in reverse."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cad import plugins
from cad.errors import ParameterError
from sensing.live.outputs.lines import Lines
from sensing.live.run import LiveRun

if TYPE_CHECKING:
    from sensing.live.outputs.mcap.recording import Recording
    from sensing.live.web.page import PageServer


def add_outputs(run: LiveRun, options: argparse.Namespace, outputs: ExitStack, lines: Lines) -> None:
    """Start the outputs that the options name.

    Args:
        run: what is put out.
        options: of the command.
        outputs: closes them.
        lines: where the page's address is written.

    Raises:
        EndcapError: an output that cannot begin.
    """
    from sensing.live.core.seen import Pictures
    from sensing.live.outputs.mcap.recording import Recording
    from sensing.live.web.access import qr_code

    recording = Recording(run, Path.cwd(), Pictures(options.record_pictures))
    run.notes.append(lambda: recording.note)
    run.losses.append(lambda: recording.loss)
    if options.json:
        _add_json_lines(run, outputs)
    if options.ros:
        _add_ros(run, outputs)
    if options.rerun:
        _add_rerun(run, outputs)
    for words in options.output or ():
        _add_plugin(run, words, outputs)
    page = None if options.no_page else _add_page(run, recording, options, outputs)
    outputs.callback(recording.stop)  # the file is closed first
    if options.record is not None:  # after all others: where one of them cannot begin, no file is left
        recording.start(None if options.record == Path() else options.record)
    if page is not None:
        page.start()
        lines.write(f"page: {page.url}\n")
        if page.token and lines.isatty():
            lines.write(qr_code(page.url))


def _add_json_lines(run: LiveRun, outputs: ExitStack) -> None:
    from sensing.live.outputs.json_lines import JsonLines

    numbers = JsonLines(sys.stdout, run.engine.health)
    numbers.start()
    run.engine.add_sink(numbers, "--json")
    outputs.callback(lambda: numbers.close(run.patience_s))
    run.stop_when(lambda: bool(numbers.failed))
    run.losses.append(lambda: numbers.loss)


def _add_ros(run: LiveRun, outputs: ExitStack) -> None:
    from sensing.live.outputs.ros.topics import RosTopics

    topics = RosTopics([endcap.pipeline for endcap in run.engine.endcaps], health=run.engine.health)
    topics.start()
    run.engine.add_sink(topics, "--ros")
    outputs.callback(lambda: topics.close(run.patience_s))
    run.notes.append(lambda: topics.note)
    run.losses.append(lambda: topics.note if topics.loss else "")


def _add_page(run: LiveRun, recording: Recording, options: argparse.Namespace, outputs: ExitStack) -> PageServer:
    from sensing.live.web.page import PageServer

    page = PageServer(run, recording, options.host, options.port)
    outputs.callback(lambda: page.close(min(run.patience_s, 3.0)))
    run.notes.append(lambda: page.note)
    return page


def _add_plugin(run: LiveRun, words: str, outputs: ExitStack) -> None:
    """An output that a plug-in adds: ``NAME`` or ``NAME=WORDS``.

    Raises:
        ParameterError: no such plug-in, or a broken one.
    """
    name, _, given = words.partition("=")
    known = plugins.names(plugins.Kind.OUTPUT)
    if name not in known:
        raise ParameterError(
            f"--output {words}: no plug-in adds {name!r} ({', '.join(known) or 'none'} installed): install one, or see "
            "docs/plugins/output.md",
            name="output",
            value=words,
        )
    sink = plugins.make(plugins.Kind.OUTPUT, name, "put", given, run.latest.names)
    run.add_output(sink, f"--output {words}")
    if hasattr(sink, "close"):
        outputs.callback(_close_plugin, run, sink)


def _close_plugin(run: LiveRun, sink: Any) -> None:
    try:
        sink.close()
    except Exception as error:  # what it had kept to the end could not be written
        run.engine.sink_failed(sink, error)


def _add_rerun(run: LiveRun, outputs: ExitStack) -> None:
    from sensing.live.outputs.rerun_view import RerunView

    view = RerunView()
    view.start()
    run.add_output(view, "--rerun")
    outputs.callback(lambda: view.close(run.patience_s))
