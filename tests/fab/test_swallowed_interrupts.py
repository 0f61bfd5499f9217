"""A Ctrl-C that a library swallows: each command asks for it before its files appear."""

from __future__ import annotations

import ast
import signal
from contextlib import suppress
from pathlib import Path

import pytest

from fab.command import Interrupts
from fab.exports.whole_folder import whole_folder, write_record
from fab.led_ring import __main__ as ring

ROOT = Path(__file__).parent.parent.parent
COMMANDS = [
    path for package in ("fab", "endcap") for path in sorted((ROOT / package).rglob("*.py"))
    if "import whole_folder" in path.read_text() or "whole_folder, write_record" in path.read_text()
]  # fmt: skip


def swallowed() -> None:
    with suppress(BaseException):
        signal.raise_signal(signal.SIGINT)


def test_nothing_appears_where_the_question_before_publishing_raises(tmp_path):
    interrupts = Interrupts()
    with (
        interrupts.handling(),
        pytest.raises(KeyboardInterrupt),
        whole_folder(tmp_path / "out", "list.json", interrupts.raise_swallowed) as folder,
    ):
        write_record(folder, "list.json", {})
        swallowed()
    assert list(tmp_path.iterdir()) == []


def test_the_ring_is_not_written_after_a_swallowed_interruption(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(ring, "write_record", lambda *given: (write_record(*given), swallowed()))
    assert ring.main([f"exports={tmp_path}"]) == 130
    assert "interrupted; nothing was left behind" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", COMMANDS, ids=lambda path: str(path.relative_to(ROOT)))
def test_each_command_that_writes_a_folder_asks(path):
    calls = [
        node for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "whole_folder"
    ]  # fmt: skip
    assert calls and all(len(call.args) == 3 for call in calls)
