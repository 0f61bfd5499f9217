"""The page as a user has it: a running program, drawn cameras, headless Chromium, buttons that are pressed."""

import contextlib
import importlib.resources
import os
import re
import signal
import threading
import urllib.request
from pathlib import Path

import pytest
from live_program import program
from live_stand_in import PATIENCE_S, Shown, stand_in, wait_for
from mcap.records import Message

from sensing.live.demo.scene_server import mjpeg_server
from sensing.live.mcap_records import read_records
from sensing.live.replay import read_config, verify

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


def page_of(process) -> str:
    """Address that a program has printed; the rest of its lines is read and forgotten."""
    url = re.search(r"page: (\S+)", process.stdout.readline())[1]
    threading.Thread(target=process.stdout.read, daemon=True).start()
    return url


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
        self.url = page_of(self.process)
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
        self.tab.until(FREE + " && !latest.recording.on")
        self.tab.value("close_question()")

    def recordings(self) -> list[Path]:
        return sorted(self.folder.glob("*.mcap"))


@pytest.fixture(scope="module")
def stage(tab, tmp_path_factory):
    with Stage(tmp_path_factory.mktemp("run"), tab, Shown()) as stage:
        yield stage


def test_a_recording_is_started_and_stopped_by_the_button_that_says_so(stage):
    stage.free()
    stage.tab.until("live() && $('record').textContent === 'Start recording'")
    stage.tab.until("live() && (press('record_start'), press('record_start'), true)")  # twice is no stop
    stage.tab.until("live() && latest.recording.on && $('record').textContent === 'Stop recording'")
    (path,) = stage.recordings()
    wait_for(lambda: path.stat().st_size > 500_000)
    stage.click("record", "latest.recording.on")
    stage.tab.until("live() && !latest.recording.on && $('record').textContent === 'Start recording'")
    assert "frames recorded" in stage.tab.value("latest.recording.note")
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
    assert plots == ["Fx – N", "Fy – N", "Fz – N", "|F| – N", "Tx – N m", "Ty – N m", "Tz – N m"]
    stage.shown.now = "free"
    force, plots = stage.drawn(FREE, f"[{CARD.format('n')}, {PLOTS}]")
    assert re.fullmatch(r"0\.\d N", force) and re.fullmatch(r"Fx -?0\.\d N", plots[0])


def test_nothing_is_below_the_fold_of_a_notebook(stage):
    stage.free()
    bottom = (
        "Math.max(...['health', 'plots', 'image', 'scene', 'dome'].map((id) => $(id).getBoundingClientRect().bottom))"
    )
    with stage.tab.sized(1440, 900):
        lowest, tallest = stage.tab.until("innerWidth === 1440 && live()", f"[{bottom}, $('plots').offsetHeight]")
    assert 400 < lowest <= 900 and tallest > 80


def axe() -> str:
    """axe-core (MPL-2.0): of the file named by AXE_CORE, or of the package axe-core-python."""
    if path := os.environ.get("AXE_CORE"):
        return Path(path).read_text(encoding="utf-8")
    package = pytest.importorskip("axe_core_python")
    return (importlib.resources.files(package) / "axe.min.js").read_text(encoding="utf-8")


VIOLATIONS = """axe.run(document, {resultTypes: ["violations"]}).then((found) => found.violations.flatMap((v) =>
  v.nodes.map((node) => v.id + ": " + node.html.slice(0, 120) + " " + (node.any[0] || node.none[0] || {}).message)))"""


@pytest.mark.parametrize("colours", ["dark", "light"])
def test_axe_finds_nothing_at_three_sizes(stage, colours):
    """With a question open and everything that can be folded out, free and touched, and greyed out."""
    stage.free()
    source = axe()
    assert stage.tab.value(f"{source}; typeof axe.run") == "function"
    for width, height in ((390, 844), (1024, 768), (1440, 900)):
        with stage.tab.sized(width, height, colours):
            stage.tab.until(f"innerWidth === {width} && {FREE}")
            stage.tab.value("question('Is this read?'); $('legend').open = true; $('replay').hidden = false")
            assert stage.tab.promised(VIOLATIONS) == [], (width, colours)
            stage.tab.value("close_question(); $('replay').hidden = true; $('legend').open = false")
    background = "getComputedStyle(document.body).backgroundColor"
    with stage.tab.sized(1024, 768, colours):
        assert (sum(map(int, re.findall(r"\d+", stage.tab.value(background))[:3])) > 384) is (colours == "light")


def test_plots_have_ticks_a_cursor_a_window_and_can_be_held(stage):
    stage.free()
    stage.tab.value("$('window').value = '5'; $('window').onchange()")
    stage.tab.until("Plots.rows(0).length > 5")
    key = "$('plots').dispatchEvent(new KeyboardEvent('keydown', {{key: '{}', bubbles: true}}))"
    for _ in range(10):
        stage.tab.value(key.format("ArrowLeft"))
    stage.tab.until("/^cursor 1.00 s ago$/.test($('cursor_note').textContent)")
    stage.tab.value(key.format("Escape"))
    stage.tab.until("$('cursor_note').textContent === ''")
    stage.tab.value("$('hold').click()")
    held = stage.tab.value(f"[window.drawn, {PLOTS}]")
    stage.shown.now = "pressed"
    stage.tab.until(f"{TOUCHED} && window.drawn > {held[0] + 5}")
    assert stage.tab.value(PLOTS) == held[1] and stage.tab.value("$('hold').textContent") == "Run plots"
    stage.tab.value("$('hold').click()")
    stage.tab.until(f"{TOUCHED} && {PLOTS}[3] !== {held[1][3]!r}")
    force, norm = stage.drawn(TOUCHED, f"[window.shown.endcaps[0].force_norm_n, {PLOTS}[3]]")
    assert norm == f"|F| {force:.1f} N"


def test_the_dome_shows_depth_patch_and_normal_of_a_press_and_turns_by_keys(stage):
    stage.free()
    stage.tab.until("$('dome_note').textContent === 'free'")
    stage.shown.now = "pressed"
    note = stage.tab.until(f"{TOUCHED} && / mm deep/.test($('dome_note').textContent)", "$('dome_note').textContent")
    assert re.search(r"\d+\.\d mm deep, patch \d+ mm²; normal \d+\.\d N, along \d+\.\d N", note)
    key = "$('{}').dispatchEvent(new KeyboardEvent('keydown', {{key: '{}'}}))"
    for name in ("Scene", "Dome"):
        before = stage.tab.value(f"({{...{name}.view}})")
        for pressed in ("ArrowLeft", "ArrowUp", "+"):
            stage.tab.value(key.format(name.lower(), pressed))
        turned = stage.tab.value(f"({{...{name}.view}})")
        assert all(turned[each] != before[each] for each in ("turn", "tilt", "zoom"))
        stage.tab.value(key.format(name.lower(), "0"))
        assert stage.tab.value(f"({{...{name}.view}})") == before


def test_a_note_and_the_size_while_recording_and_the_file_to_download(stage):
    stage.free()
    stage.tab.value("$('pictures').value = 2")
    stage.click("record")
    line = r"\.mcap: \d+:\d\d, [\d.]+ MB, \d+ MB/min, \d+ (GB|MB) free \(\d+ (h|min)\), [1-9]\d* frames"
    stage.tab.until(f"live() && /{line}/.test($('record_note').textContent)")
    stage.tab.value("$('note').value = 'lifted by hand'; $('note_form').requestSubmit()")
    (path,) = stage.recordings()
    stage.click("record", "latest.recording.on && latest.recording.frames > 5")
    stage.tab.until("!latest.recording.on && $('files').children.length > 0")
    link, name = stage.tab.value("(() => { const a = [...$('files').children].pop(); return [a.href, a.download]; })()")
    with urllib.request.urlopen(link, timeout=PATIENCE_S) as answer:
        content = answer.read()
    assert name == path.name and content == path.read_bytes()
    notes = [m.data for m in read_records(path) if isinstance(m, Message) and b"lifted by hand" in m.data]
    assert len(notes) == 1
    check = verify(path, read_config(path), lambda _: stand_in())
    assert check.frames > 5 and check.different == 0
    path.unlink()


def test_a_replay_is_sent_to_a_moment_paused_and_played_over_and_over(stage, tab):
    stage.free()
    tab.value("$('pictures').value = 2")
    stage.click("record")
    stage.click("record", "latest.recording.on && latest.recording.frames > 30")
    tab.until("!latest.recording.on")
    (path,) = stage.recordings()
    words = ("--replay", path.name, "--port", "0", "--at-end", "stay", "--speed", "4")
    try:
        with program(*words, cwd=stage.folder, stderr=None) as process:
            tab.open(page_of(process))
            tab.until("live() && latest.replay && latest.replay.paused && $('play').textContent === 'Play'")
            end, whole = tab.value("[latest.replay.position_s, $('whole').textContent]")
            assert end > 0.8 and whole.startswith("from its begin") and tab.value("$('zero').disabled")
            tab.value("$('seek').value = 0.4; $('seek').oninput()")
            tab.until("live() && !latest.replay.whole && latest.replay.position_s === 0.4 && +$('seek').value === 0.4")
            assert "not to the bit" in tab.value("$('whole').textContent")
            assert tab.value("$('moment').textContent").startswith("0.4 of")
            tab.value("$('play').click()")
            tab.until(f"live() && latest.replay.paused && latest.replay.position_s >= {end} - 0.1")
            tab.value("$('loop').click(); $('play').click()")
            tab.value("window.last = 0; window.rounds = 0")
            at = "latest.replay.position_s"
            tab.until(
                f"({at} < window.last && (window.rounds += 1), window.last = {at},"
                " window.rounds > 1 && latest.replay.whole && !latest.replay.paused)"
            )
            tab.value("$('play').click()")
            tab.until("live() && latest.replay.paused")
            assert process.poll() is None
    finally:
        tab.open(stage.url)
        path.unlink()


def test_the_chosen_endcap_and_the_icon_are_there_after_a_reload(stage):
    stage.free()
    stage.tab.value("document.querySelector('.endcap').click(); window.old = true")
    assert stage.tab.value("localStorage.getItem(KEPT)") == "endcap_0"
    stage.tab.call("Page.reload")
    stage.tab.until("!window.old && window.drawn > 2")
    assert stage.tab.value("names[chosen]") == "endcap_0"
    script = "fetch(document.querySelector('link[rel=icon]').href).then((a) => a.ok && a.headers.get('content-type'))"
    assert stage.tab.promised(script).startswith("image/svg+xml")


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
