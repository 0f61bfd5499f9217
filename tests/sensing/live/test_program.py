"""Faults as the running program reports them: JSON lines, diagnostics of its recording, its page, its summary."""

import contextlib
import json
import re
import signal
import threading
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from live_program import program
from live_stand_in import PATIENCE_S, Shown, wait_for
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from websockets.sync.client import connect

from sensing.live.demo.scene_server import mjpeg_server

NOTHING = [None] * 3
LONG = 20  # frames of a phase, at least


@dataclass
class Day:
    """What one run said, phase by phase.

    Attributes:
        phases: JSON lines by what the camera showed. states: of the page, before and after the zero under load.
        said: lines on standard error. path: the recording. status: of the program's end.
    """

    path: Path
    phases: dict[str, list[dict]] = field(default_factory=dict)
    states: list[dict] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    status: int = -1


@contextlib.contextmanager
def running(shown: Shown, *arguments: str):
    """(process, its JSON lines so far, its other lines so far) of a program that reads a drawn camera."""
    server = mjpeg_server(0, lambda _: shown.camera()())
    threading.Thread(target=server.serve_forever, daemon=True).start()
    lines, said = [], []
    with program("--url", f"http://127.0.0.1:{server.server_port}/0", "--json", *arguments) as process:
        reading = [
            threading.Thread(target=lambda: lines.extend(map(json.loads, process.stdout)), daemon=True),
            threading.Thread(target=lambda: said.extend(process.stderr), daemon=True),
        ]
        for thread in reading:
            thread.start()
        yield process, lines, said
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.wait(PATIENCE_S)
        for thread in reading:
            thread.join(PATIENCE_S)
    server.shutdown()


def phase(lines: list[dict], shown: Shown, picture: str, state: str, path: Path) -> list[dict]:
    """Show a picture; all lines from the first in this state on, until the diagnostics of the recording hold it.

    Lines of a camera that was starved of processor time (``silent``) are left out.
    """
    shown.now = picture
    begin, size = len(lines), path.stat().st_size if path.exists() else 0
    wait_for(lambda: any(line["state"] == state for line in lines[begin:]))
    first = next(k for k in range(begin, len(lines)) if lines[k]["state"] == state)
    wait_for(lambda: len(lines) > first + LONG and diagnosed(path, size, state), 0.2)
    return [line for line in lines[first:-1] if line["state"] != "silent"]


def diagnosed(path: Path, since: int, state: str) -> bool:
    """Whether a recording, which is not compressed, names a state in the diagnostics behind a byte."""
    with path.open("rb") as stream:
        stream.seek(since)
        return re.search(rb"state\0.{0,8}" + state.encode() + rb"\0", stream.read(), re.S) is not None


def talk(url: str, *words: str) -> dict:
    """Press buttons on the state that is shown; the state after them."""
    state: dict = {}
    with connect(url.replace("http", "ws", 1) + "ws") as viewer:
        viewer.recv()
        for word in ("show", *words, "show", "show"):
            viewer.send(json.dumps({"do": word, "endcap": 0, "seen": state.get("seen", 0)}))
            while not isinstance(answer := viewer.recv(PATIENCE_S), str):
                pass
            state = json.loads(answer)
    return state


@pytest.fixture(scope="module")
def day(tmp_path_factory) -> Day:
    found, shown = Day(tmp_path_factory.mktemp("day") / "day.mcap"), Shown()
    with running(shown, "--port", "0", "--record", str(found.path)) as (process, lines, said):
        found.phases["free"] = phase(lines, shown, "free", "running", found.path)
        found.phases["black"] = phase(lines, shown, "black", "blind", found.path)
        found.phases["light again"] = phase(lines, shown, "free", "running", found.path)
        found.phases["broken"] = phase(lines, shown, "broken", "damaged pictures", found.path)
        found.phases["whole again"] = phase(lines, shown, "free", "running", found.path)
        shown.now = "pressed"
        wait_for(lambda: lines[-1]["contact"])
        url = next(m[1] for line in said if (m := re.search(r"page: (\S+)", line)))
        wait_for(lambda: (before := talk(url))["endcaps"][0]["contact"] and not found.states.append(before))
        wait_for(lambda: (after := talk(url, "zero"))["endcaps"][0]["confirmable"] and not found.states.append(after))
        found.phases["pressed"] = phase(lines, shown, "pressed", "running", found.path)
        found.states.append(talk(url))
        shown.now = "free"
        wait_for(lambda: lines[-1]["contact"] is False and lines[-1]["force_norm_n"] < 0.5)
        process.send_signal(signal.SIGTERM)
        found.status = process.wait(PATIENCE_S)
    found.said = said
    return found


def test_a_black_picture_is_null_with_its_state_and_nothing_else(day):
    for line in day.phases["black"]:
        assert line["force_n"] == line["torque_nm"] == line["centre_mm"] == NOTHING and line["force_norm_n"] is None
        assert line["valid"] is False and line["contact"] is None and line["state"] == "blind"
        assert "blind" in line["flags"] and re.search(r"dots are seen", line["reason"])
    assert all(line["valid"] and line["force_norm_n"] < 0.5 for line in day.phases["light again"])


def test_a_damaged_jpeg_is_no_number_and_is_counted(day):
    damaged = day.phases["broken"]
    assert all(line["flags"] == ["damaged"] and line["force_n"] == NOTHING for line in damaged)
    assert {line["state"] for line in damaged} == {"damaged pictures"}
    (unusable,) = (int(m[1]) for line in day.said if (m := re.search(r"endcap_0: \d+ frames, .* (\d+) unusable", line)))
    without = [line for lines in day.phases.values() for line in lines if not line["valid"]]
    assert unusable >= len(without) > 30
    assert day.status == 0 and not any(line.startswith(("Corrupt", "Traceback")) for line in day.said), day.said


def test_a_zero_under_load_is_refused_and_the_load_stays_in_sight(day):
    before, _, after = (state["endcaps"][0] for state in day.states)
    assert before["contact"] and not before["confirmable"]
    assert after["confirmable"] and "not zeroed: touched with" in after["message"]
    assert after["zeroed"] == before["zeroed"] != "" and not after["undoable"]
    assert all(line["force_norm_n"] > 5 and line["contact"] for line in day.phases["pressed"])


def test_diagnostics_have_the_level_of_what_was_seen(day):
    with day.path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        found = [message.status[0] for *_, message in reader.iter_decoded_messages(["/diagnostics"])]
    levels = {}
    for status in found:
        level = status.level[0] if isinstance(status.level, bytes) else status.level
        values = {pair.key: pair.value for pair in status.values}
        levels.setdefault(values["state"], set()).add((level, values["valid"]))
        assert status.name == "endcap_0" and status.message.startswith(values["state"])
    assert levels["running"] == {(0, "true")}
    assert levels["blind"] == levels["damaged pictures"] == {(2, "false")}
    messages = " ".join(status.message for status in found)
    assert "blind: " in messages and "dots are seen" in messages


def test_black_from_the_start_says_why_there_is_no_number_and_begins_when_there_is_light():
    shown = Shown("black")
    with running(shown, "--no-page") as (_, lines, _said):
        wait_for(lambda: any(line["state"] == "waiting for a reference" for line in lines))
        assert not any(line["valid"] for line in lines) and all(line["force_n"] == NOTHING for line in lines)
        first = next(line for line in lines if line["state"] == "waiting for a reference")
        assert "dots" in first["reason"]
        shown.now = "free"
        wait_for(lambda: lines[-1]["valid"])
        assert lines[-1]["state"] == "running" and lines[-1]["force_norm_n"] < 0.5
