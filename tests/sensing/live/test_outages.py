"""The page while its connection or its run goes away and comes back: what is kept, begun anew, and said once."""

import contextlib
import re
import resource
import signal
import socket
import threading

import pytest
from live_program import program
from live_stage import FREE, PLOTS, RUNNING, STALE, TOUCHED, Stage, page_of
from live_stand_in import PATIENCE_S, WEIGHTS_BYTES, Shown

HELD = "[$('hold').textContent, $('hold').getAttribute('aria-pressed')]"
ERRORS = "window.errors = []; window.onerror = (message) => { window.errors.push(message); }"


def test_what_is_paused_and_plotted_outlives_a_lost_connection(stage):
    stage.free()
    stage.tab.until("Plots.rows(0).length > 10")
    stage.tab.value("$('hold').click()")
    held, first = stage.tab.value(f"[{PLOTS}, Plots.rows(0)[0].t]")
    try:
        stage.tab.value("window.old = socket, socket.close()")
        stage.tab.until(f"socket !== window.old && {FREE}")
        drawn = stage.tab.value("window.drawn")
        stage.tab.until(f"window.drawn > {drawn + 5}")
        assert stage.tab.value(HELD) == ["Run plots", "true"]
        assert stage.tab.value(f"[{PLOTS}, Plots.rows(0)[0].t]") == [held, first]
    finally:
        stage.tab.value("$('hold').click()")
    assert stage.tab.value(HELD) == ["Pause plots", "false"]


def test_a_pause_of_the_plots_stays_where_the_frames_begin_again_as_in_a_loop(stage):
    stage.free()
    stage.tab.until("Plots.rows(0).length > 10")
    stage.tab.value("$('hold').click()")
    try:
        held = stage.tab.value(PLOTS)
        stage.shown.now = "pressed"
        back = "Plots.remember({ time_s: 1, endcaps: [{ ...latest.endcaps[0], time_s: 0.5 }] })"
        drawn = stage.tab.until(f"{TOUCHED} && ({back}, true)", "window.drawn")
        stage.tab.until(f"{TOUCHED} && window.drawn > {drawn + 5}")
        assert stage.tab.value(PLOTS) == held and stage.tab.value(HELD) == ["Run plots", "true"]
    finally:
        stage.tab.value("$('hold').click()")


def test_a_text_and_a_focus_are_not_lost_to_a_moment_without_an_answer(stage):
    """A note that could not be sent was gone; a question was asked where a reader's focus was not."""
    stage.free()
    stage.tab.value("$('note').value = 'lifted', answeredAt = -Infinity, $('note_form').requestSubmit()")
    assert stage.tab.value("$('note').value") == "lifted"
    focus = "document.activeElement.id"
    key = "document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', bubbles: true }))"
    asked = f"($('zero').focus(), question('Sure?'), window.at = [{focus}], {key}, window.at.push({focus}), true)"
    stage.tab.until(f"{FREE} && !$('zero').disabled && {asked}")
    assert stage.tab.value("window.at") == ["cancel", "zero"]
    stage.tab.value("$('note').value = ''")


def test_silence_is_announced_once_and_its_age_counts_beside_it(stage):
    stage.free()
    stage.tab.value(
        "window.said = []; new MutationObserver(() => window.said.push($('lost_said').textContent))"
        ".observe($('lost_said'), { childList: true, characterData: true, subtree: true })"
    )
    stage.process.send_signal(signal.SIGSTOP)
    try:
        stage.tab.until(f"{STALE} && /for [3-9] s/.test($('lost').innerText)")
        assert stage.tab.value("window.said") == ["No answer from sensing.live"]
        assert stage.tab.value("$('lost_said').getAttribute('role')") == "alert"
        assert re.fullmatch(r"No answer from sensing.live for \d+ s: .*", stage.tab.value("$('lost').innerText"))
    finally:
        stage.process.send_signal(signal.SIGCONT)


@pytest.mark.parametrize("button", ["record", "zero"])
def test_a_button_that_was_switched_off_has_its_focus_back(stage, button):
    stage.free()
    at = "(document.activeElement || document.body).id"
    stage.tab.until(f"{FREE} && !$('{button}').disabled && ($('{button}').focus(), {at} === '{button}')")
    stage.process.send_signal(signal.SIGSTOP)
    try:
        stage.tab.until(f"{STALE} && {at} === ''")
    finally:
        stage.process.send_signal(signal.SIGCONT)
    stage.tab.until(f"{RUNNING} && !{STALE} && {at} === '{button}'", patience_s=30)


def test_an_outage_and_a_question_are_seen_wherever_a_phone_is_scrolled_to(stage):
    stage.free()
    seen = "(({{ top, bottom }}) => top >= 0 && bottom <= innerHeight && bottom > top)($('{}').getBoundingClientRect())"
    with stage.tab.sized(390, 844):
        end = "(scrollTo(0, document.body.scrollHeight), scrollY > 1000)"
        stage.tab.until(f"innerWidth === 390 && {FREE} && {end} && (question('Sure?'), true)")
        assert stage.tab.value(seen.format("ask"))
        stage.tab.value("close_question()")
        stage.process.send_signal(signal.SIGSTOP)
        try:
            stage.tab.until(f"{STALE} && {end}")
            assert stage.tab.value(seen.format("lost"))
        finally:
            stage.process.send_signal(signal.SIGCONT)
            stage.tab.value("scrollTo(0, 0)")


def test_the_last_picture_of_a_camera_that_is_gone_has_its_age(stage):
    stage.free()
    gone = "{ ...latest.endcaps[0], status: 'unplugged', valid: false, age_ms: 12300 }"
    look = f"(picture(latest.selected, {gone}), $('image_note').textContent)"
    note = stage.tab.until(f"{FREE} && latest.selected", look)
    assert re.fullmatch(r"\d+ of \d+ dots; no newer picture for 12 s", note)


def test_a_picture_that_is_replaced_gives_its_memory_back(stage):
    """A browser's collector sees a few bytes of each: a page held 70 MB more of them than it needs.

    Two pictures that a slow computer decodes at once both replaced the one before, and the first was never closed.
    """
    stage.free()
    slow = """window.made = []; window.real ??= createImageBitmap; window.createImageBitmap = async (data) => {
      const decoded = await window.real(data);
      window.made.push(decoded);
      await new Promise((go) => setTimeout(go, 500));
      return decoded;
    }"""
    try:
        stage.tab.value(slow)
        stage.tab.until("made.length > 12 && made.slice(0, 6).every((old) => old.width === 0)")
    finally:
        stage.tab.value("window.createImageBitmap = window.real")
    stage.tab.until("made.slice(0, -1).every((old) => old.width === 0) && bitmap && bitmap.width > 0")
    stage.tab.value("window.old = bitmap, choose(chosen)")
    stage.tab.until("window.old.width === 0")


def test_a_connection_that_leads_nowhere_is_replaced(stage):
    """As after a robot's computer was switched off and on: nothing closes the old connection, and no answer comes."""
    stage.free()
    with relay(int(stage.url.rsplit(":", 1)[1].strip("/"))) as (port, freeze):
        stage.tab.open(f"http://127.0.0.1:{port}/")
        stage.tab.until(FREE)
        stage.tab.value("window.old = socket")
        freeze()
        stage.tab.until(STALE)
        assert stage.tab.value("window.old.readyState") == 1
        stage.tab.until(f"socket !== window.old && {FREE} && !{STALE}", patience_s=60)
    stage.tab.open(stage.url)


def test_another_run_at_the_same_address_is_shown_from_its_begin(tab, tmp_path):
    with Stage(tmp_path, tab, Shown()) as stage:
        tab.until(FREE)
        tab.value(f"{ERRORS}; $('hold').click()")
        stage.process.kill()
        stage.process.wait(PATIENCE_S)
        tab.until(STALE)
        words = ["--url", stage.address] * 3 + ["--port", stage.url.rsplit(":", 1)[1].strip("/")]
        with program(*words, cwd=tmp_path, stderr=None) as process:
            assert page_of(process) == stage.url
            tab.until("live() && latest.endcaps.length === 3 && $('endcaps').children.length === 3 && window.shown")
            assert tab.value(HELD) == ["Pause plots", "false"] and tab.value("window.errors") == []


def test_a_recording_that_the_disk_stops_is_said_as_a_fault_and_the_next_one_can_begin(tab, tmp_path):
    most = WEIGHTS_BYTES + 1_200_000
    room = {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))}
    said = "$('record_said')"
    with Stage(tmp_path, tab, Shown(), **room) as stage:
        stage.free()
        for count in (1, 2):
            stage.click("record", "!latest.recording.on")
            tab.until(
                f"live() && latest.recording.on && {said}.textContent === '' && !{said}.classList.contains('bad')"
            )
            note = tab.until(f"live() && latest.recording.failed && {said}.textContent", f"{said}.textContent")
            assert "recording stopped (File too large); " in note
            assert tab.value(f"[{said}.classList.contains('bad'), {said}.role]") == [True, "status"]
            assert tab.value("$('record').textContent") == "Start recording" and len(stage.recordings()) == count


@contextlib.contextmanager
def relay(port: int):
    """(port of a relay to another one, what makes the connections so far lead nowhere without closing them)."""
    frozen, open_ones = set(), set()
    with contextlib.ExitStack() as closing:
        listening = closing.enter_context(socket.create_server(("127.0.0.1", 0)))

        def copy(source, target, pair):
            with contextlib.suppress(OSError):
                while data := source.recv(1 << 16):
                    if pair not in frozen:
                        target.sendall(data)
                if pair not in frozen:
                    target.shutdown(socket.SHUT_WR)

        def serve():
            with contextlib.suppress(OSError):
                while True:
                    near = closing.enter_context(listening.accept()[0])
                    far = closing.enter_context(socket.create_connection(("127.0.0.1", port)))
                    pair = (near, far)
                    open_ones.add(pair)
                    for ends in (pair, pair[::-1]):
                        threading.Thread(target=copy, args=(*ends, pair), daemon=True).start()

        threading.Thread(target=serve, daemon=True).start()
        yield listening.getsockname()[1], lambda: frozen.update(open_ones)
