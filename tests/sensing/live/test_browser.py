"""States and faults of the page as a user has it: a running program, headless Chromium, buttons that are pressed."""

import re
import signal

import pytest
from live_stage import ASKED, BUTTONS_OFF, CARD, COLOURS, FREE, PLOTS, RUNNING, STALE, TOUCHED, Stage
from live_stand_in import PATIENCE_S, WEIGHTS_BYTES, Shown, stand_in, wait_for

from sensing.live.replay import read_config, verify


def test_a_recording_is_started_and_stopped_by_the_button_that_says_so(stage):
    stage.free()
    stage.tab.until("live() && $('record').textContent === 'Start recording'")
    stage.tab.until("live() && (press('record_start'), press('record_start'), true)")  # twice is no stop
    stage.tab.until("live() && latest.recording.on && $('record').textContent === 'Stop recording'")
    (path,) = stage.recordings()
    wait_for(lambda: path.stat().st_size > WEIGHTS_BYTES + 200_000)
    stage.click("record", "latest.recording.on")
    stage.tab.until("live() && !latest.recording.on && $('record').textContent === 'Start recording'")
    stage.tab.until("latest.recording.note.includes('frames recorded')")
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
    doubtful = FREE.replace("'running'", "'degraded'")  # dots of a pressed dome are not where the design has them
    stage.tab.until(f"{doubtful} && latest.endcaps[0].zeroed !== '{before}'")
    stage.click("undo")
    undone = f"{TOUCHED} && latest.endcaps[0].zeroed === '{before}'"
    assert stage.tab.until(undone, "latest.endcaps[0].force_norm_n") == pytest.approx(force_n, rel=0.2)


def test_the_age_of_a_reference_is_by_the_clock_of_the_run(stage):
    """A tablet whose clock is wrong showed a reference of hours ago, or of tomorrow."""
    stage.free()
    of_tablet = "const now = Date.now; Date.now = () => 0; try { return %s; } finally { Date.now = now; }"
    age = "Health.zeroed({ zeroed: new Date(1000 * latest.now_s - 300000).toISOString() }, latest.now_s)"
    assert stage.tab.value(f"(() => {{ {of_tablet % age} }})()").endswith("(5 min ago)")


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
    assert re.fullmatch(r"0\.\d N", force) and re.fullmatch(r"Fx (?!-0\.0)-?0\.\d N", plots[0])


def test_a_run_that_stops_is_grey_with_its_age_and_its_buttons_do_nothing_then_or_later(stage):
    stage.free()
    stage.process.send_signal(signal.SIGSTOP)
    stage.tab.value("$('record').click()")  # the page cannot know yet: the message waits for the run
    assert stage.tab.until(STALE, "socket.readyState") == 1  # it is the silence that shows, not a closed connection
    assert re.search(r"No answer from sensing.live for \d+ s", stage.tab.value("$('lost').innerText"))
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
