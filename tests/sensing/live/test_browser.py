"""The page as a user has it: a running program, drawn cameras, headless Chromium, buttons that are pressed."""

import contextlib
import re
import signal
import sys
import threading
from pathlib import Path

import pytest
from live_program import program
from live_stand_in import PATIENCE_S, Shown, stand_in, wait_for

from sensing.live.demo.scene_server import mjpeg_server
from sensing.live.replay import read_config, verify

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts"))
from live_picture import CHROMIUM, Browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this computer")
RUNNING = "live() && latest.endcaps[0].status === 'running'"
FREE = RUNNING + " && latest.endcaps[0].force_norm_n < 0.5 && !latest.endcaps[0].contact"
TOUCHED = RUNNING + " && latest.endcaps[0].contact"
CARD = "document.querySelector('.endcap .{}').textContent"
BUTTONS_OFF = "['zero','undo','zero_all','record'].every((id) => $(id).disabled)"
PLOTS = "[...$('plots').children].map((c) => c.getAttribute('aria-label'))"
ASKED = "$('ask').classList.contains('open')"
STALE = "document.body.classList.contains('stale')"
COLOURS = """(() => { const c = $("image"), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data,
  s = new Set(); for (let k = 0; k < d.length; k += 388) s.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]);
  return s.size; })()"""


class Stage:
    """One drawn camera over HTTP, the program that reads it, and a browser that shows its page."""

    def __init__(self, folder: Path, tab, shown: Shown) -> None:
        self.folder, self.tab, self.shown = folder, tab, shown
        self.outputs = contextlib.ExitStack()

    def __enter__(self):
        server = mjpeg_server(0, lambda _: self.shown.camera()())
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.outputs.callback(server.shutdown)
        address = f"http://127.0.0.1:{server.server_port}/0"
        self.process = self.outputs.enter_context(
            program("--url", address, "--port", "0", cwd=self.folder, stderr=None)
        )
        self.url = re.search(r"page: (\S+)", self.process.stdout.readline())[1]
        threading.Thread(target=self.process.stdout.read, daemon=True).start()
        self.tab.open(self.url)
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGCONT)
        self.outputs.close()

    def click(self, name: str, condition: str = "live()") -> None:
        """Press a button as soon as it can be pressed and what is shown is as a user waits for."""
        self.tab.until(f"({condition}) && !$('{name}').disabled && ($('{name}').click(), true)")

    def drawn(self, condition: str, script: str = "true"):
        """Value of a script as soon as a condition holds for the state that is drawn at that moment."""
        return self.tab.until(f"window.shown && ({condition.replace('latest', 'window.shown')})", script)

    def free(self) -> None:
        """The endcap untouched, running, no question open."""
        self.shown.now = "free"
        self.tab.until(FREE + " && latest.recording === false")
        self.tab.value("close_question()")

    def recordings(self) -> list[Path]:
        return sorted(self.folder.glob("*.mcap"))


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("chromium"), (1400, 1080))
    try:
        with browser.tab() as tab:
            yield tab
    finally:
        browser.close()


@pytest.fixture(scope="module")
def stage(tab, tmp_path_factory):
    with Stage(tmp_path_factory.mktemp("run"), tab, Shown()) as stage:
        yield stage


def test_a_recording_is_started_and_stopped_by_the_button_that_says_so(stage):
    stage.free()
    stage.tab.until("live() && $('record').textContent === 'Start recording'")
    stage.tab.until("live() && (press('record_start'), press('record_start'), true)")  # twice is no stop
    stage.tab.until("live() && latest.recording && $('record').textContent === 'Stop recording'")
    (path,) = stage.recordings()
    wait_for(lambda: path.stat().st_size > 500_000)
    stage.click("record", "latest.recording")
    stage.tab.until("live() && !latest.recording && $('record').textContent === 'Start recording'")
    assert "frames recorded" in stage.tab.value("latest.note")
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames > 5 and check.different == 0 and check.end is None
    path.unlink()


def test_a_zero_under_load_asks_first_and_can_be_undone(stage):
    stage.free()
    before = stage.tab.value("latest.endcaps[0].zeroed")
    stage.shown.now = "pressed"
    force_n = stage.tab.until(TOUCHED, "latest.endcaps[0].force_norm_n")
    stage.tab.until(f"{TOUCHED} && ($('zero').click(), {ASKED})")
    assert "is touched" in stage.tab.value("$('question').textContent")
    stage.click("cancel")
    drawn = stage.tab.value("window.drawn")
    stage.tab.until(f"window.drawn > {drawn + 20}")  # more frames than a reference needs
    assert not stage.tab.value(ASKED)
    assert stage.tab.until(TOUCHED, "latest.endcaps[0].zeroed") == before
    stage.tab.until(f"{TOUCHED} && ($('zero').click(), {ASKED}) && ($('confirm').click(), !{ASKED})")
    stage.tab.until(f"{FREE} && latest.endcaps[0].zeroed !== '{before}'")
    stage.click("undo")
    undone = f"{TOUCHED} && latest.endcaps[0].zeroed === '{before}'"
    assert stage.tab.until(undone, "latest.endcaps[0].force_norm_n") == pytest.approx(force_n, rel=0.2)


def test_a_black_picture_shows_a_dash_and_the_reason(stage):
    stage.free()
    stage.shown.now = "black"
    card, force, reason, lamps, state, plots = stage.drawn(
        "live() && latest.endcaps[0].status === 'blind'",
        f"[document.querySelector('.endcap').innerText, {CARD.format('n')}, {CARD.format('h')},"
        f" document.querySelectorAll('.lamp.touch').length, $('health').rows[0].innerText, {PLOTS}]",
    )
    assert force == "–" and not re.search(r"\d N\b", card)
    assert re.search(r"blind: \d+ of \d+ dots are seen", reason) and lamps == 0 and "blind" in state
    assert plots == ["Fx – N", "Fy – N", "Fz – N", "Tx – N m", "Ty – N m", "Tz – N m"]
    stage.shown.now = "free"
    force, plots = stage.drawn(FREE, f"[{CARD.format('n')}, {PLOTS}]")
    assert re.fullmatch(r"0\.\d N", force) and re.fullmatch(r"Fx -?0\.\d N", plots[0])


def test_nothing_is_below_the_fold_of_a_notebook(stage):
    stage.free()
    metrics = {"deviceScaleFactor": 1, "mobile": False}
    stage.tab.call("Emulation.setDeviceMetricsOverride", width=1440, height=900, **metrics)
    try:
        bottom = "Math.max(...['health', 'plots', 'image', 'scene'].map((id) => $(id).getBoundingClientRect().bottom))"
        lowest, tallest = stage.tab.until("innerWidth === 1440 && live()", f"[{bottom}, $('plots').offsetHeight]")
        assert 400 < lowest <= 900 and tallest > 80
    finally:
        stage.tab.call("Emulation.setDeviceMetricsOverride", width=1400, height=1080, **metrics)


def test_a_run_that_stops_is_grey_with_its_age_and_its_buttons_do_nothing_then_or_later(stage):
    stage.free()
    stage.process.send_signal(signal.SIGSTOP)
    stage.tab.value("$('record').click()")  # the page cannot know yet: the message waits for the run
    stage.tab.until(STALE)
    assert re.search(r"No answer from sensing.live for \d+ s", stage.tab.value("$('lost').textContent"))
    stage.tab.until("parseInt(/(\\d+) s ago/.exec(" + CARD.format("h") + ")[1]) >= 3")
    assert stage.tab.value(CARD.format("n")) == "–"
    assert re.match(r"0\.\d N, \d+ s ago", stage.tab.value(CARD.format("h")))
    assert stage.tab.value(BUTTONS_OFF)
    assert re.search(r"unknown; running \d+ s ago", stage.tab.value("$('health').rows[0].innerText"))
    assert "grayscale" in stage.tab.value("getComputedStyle(document.querySelector('main')).filter")
    stage.tab.value("$('record').click(); press('record_start')")
    stage.process.send_signal(signal.SIGCONT)
    settled(stage)


def test_a_button_pressed_while_disconnected_does_nothing_after_reconnecting(stage):
    stage.free()
    stage.tab.value("window.old = socket; socket.close(); press('record_start'); $('record').click()")
    stage.tab.until("socket !== window.old && socket.readyState === 1")
    settled(stage)


def settled(stage: Stage) -> None:
    """The page lives again, and nothing was begun by what was pressed before."""
    drawn = stage.tab.value("window.drawn")
    shown = "$('record').textContent"
    shown = stage.tab.until(f"{RUNNING} && window.drawn > {drawn + 10} && !{STALE} && !$('record').disabled", shown)
    assert shown == "Start recording" and stage.recordings() == []


def test_without_a_reference_the_picture_is_shown_with_its_dots_and_the_reason_then_the_server_goes(tab, tmp_path):
    with Stage(tmp_path, tab, Shown("disturbed")) as stage:
        reason, force, health = stage.drawn(
            "live() && latest.endcaps[0].status === 'waiting for a reference' && latest.selected",
            f"[{CARD.format('h')}, {CARD.format('n')}, $('health').innerText]",
        )
        assert re.search(r"waiting for a reference: \S+", reason) and force == "–" and "not yet" in health
        found = "/^\\d+ dots found, mean brightness \\d+ of 255/.test($('image_note').textContent)"
        note, dots = tab.until(found, "[$('image_note').textContent, latest.selected.dots.length]")
        assert int(note.split()[0]) > 50 and dots > 50
        tab.until(COLOURS + " > 50")
        stage.process.send_signal(signal.SIGTERM)
        stage.process.wait(PATIENCE_S)
        tab.until(STALE)
        assert tab.value(BUTTONS_OFF) and "No answer" in tab.value("$('lost').textContent")
