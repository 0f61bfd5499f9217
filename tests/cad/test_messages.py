"""Messages of the commands go through one logger to standard error; results stay on standard output."""

import io
import logging
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from cad.messages import LOG, set_level, show, transient
from endcap.command import main

ROOT = Path(__file__).resolve().parents[2]
STRAY = re.compile(r"file=sys\.stderr|sys\.stderr\.write|stderr\.print")


def test_nobody_else_prints_to_standard_error():
    paths = [path for package in ("cad", "endcap", "fab", "sensing") for path in (ROOT / package).rglob("*.py")]
    found = {str(path.relative_to(ROOT)) for path in paths if STRAY.search(path.read_text())}
    assert found == {"cad/messages.py"}
    assert STRAY.search('print("x", file=sys.stderr)')


def test_a_message_is_a_plain_line_on_standard_error(capsys):
    LOG.error("100 % of it")
    LOG.info("a step")
    LOG.debug("not shown")
    transient("on a terminal only")
    show("a result")
    said = capsys.readouterr()
    assert said.err == "100 % of it\na step\n" and said.out == "a result\n"


@pytest.mark.parametrize("encoding", ["latin-1", "ascii", "utf-8"])
def test_a_result_is_printed_in_every_encoding(encoding, monkeypatch):
    """The dash of a figure that is not known, and a file's name that is no UTF-8, ended commands with a traceback."""
    stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", stream)
    show("rate \u2013, M\udce4rz")
    assert stream.buffer.getvalue().decode(encoding).startswith("rate ")


def test_work_goes_on_where_nobody_reads_its_results(tmp_path):
    """As in ``... | head -1``: no traceback, not at the end of the process either, and files are written."""
    code = (
        "from cad.messages import show\nfor number in range(3): show(str(number))\n"
        f"open({str(tmp_path / 'done')!r}, 'w').close(); print('more')"
    )
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "wb") as gone:
        run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, stdout=gone, stderr=subprocess.PIPE, text=True)
    assert run.returncode == 0 and run.stderr == "" and (tmp_path / "done").exists()


def test_quiet_leaves_progress_out_and_keeps_errors(capsys):
    assert main(["--quiet", "molds", "130"]) == 2
    assert "a design is two numbers" in capsys.readouterr().err
    LOG.info("a step")
    assert capsys.readouterr().err == ""
    set_level(logging.INFO)
    LOG.info("a step")
    assert capsys.readouterr().err == "a step\n"


@pytest.mark.parametrize("words", [["--quiet", "nothing"], ["nothing"]])
def test_a_program_may_take_the_messages_elsewhere(words, tmp_path):
    code = (
        "import logging; from cad.messages import LOG; LOG.handlers.clear()\n"
        "logging.basicConfig(filename='log.txt'); LOG.propagate = True\n"
        f"from endcap.command import main; main({words!r})"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    assert run.stderr == "" and "'nothing' is not a command" in (tmp_path / "log.txt").read_text()
