"""What a viewer can do and read on the page of a running program: sizes, keys, plots, notes, downloads, replays."""

import re
import urllib.request

import pytest
from live_program import program
from live_stage import FREE, PLOTS, TOUCHED, page_of
from live_stand_in import PATIENCE_S, stand_in
from mcap.records import Message
from page_axe import VIOLATIONS, axe

from sensing.live.mcap_records import read_records
from sensing.live.replay import read_config, verify

pytestmark = pytest.mark.long


def test_nothing_is_below_the_fold_of_a_notebook(stage):
    stage.free()
    shown = "['health_box', 'plots', 'image', 'scene', 'dome']"
    bottom = f"Math.max(...{shown}.map((id) => $(id).getBoundingClientRect().bottom))"
    with stage.tab.sized(1440, 900):
        lengthen = (
            "$('health').rows[0].cells[1].textContent = 'a long reason '.repeat(99), $('recording').hidden = false"
        )
        look = f"[{bottom}, $('plots').offsetHeight]"
        lowest, tallest = stage.tab.until("innerWidth === 1440 && live()", f"({lengthen}, {look})")
    assert 400 < lowest <= 900 and tallest > 80


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


def test_the_parts_of_a_force_are_those_of_the_planes_normal(stage):
    """Of the place's they were off by half a newton of ten under a pull, which the skin's yielding moves."""
    stage.free()
    state = "{ valid: true, contact: true, centre_mm: [0, 0, 105], normal: %s, force_n: [0, 0, -10] }"
    curve = "[{ tilt_deg: 0, force_n: [0, 100], depth_mm: [0, 10], patch_mm2: [0, 500] }]"
    look = (
        "(({ force, tangent, depth }) => [force, Math.hypot(...tangent), depth])(Dome.press({ centre_mm: 40 }, %s, %s))"
    )
    inclined = stage.tab.value(look % (state % "[0, 0.6, 0.8]", curve))
    assert inclined == pytest.approx([8.0, 6.0, 0.8])
    assert stage.tab.value(look % (state % "[null, null, null]", curve)) == pytest.approx([10.0, 0.0, 1.0])


def test_a_note_and_the_size_while_recording_and_the_file_to_download(stage):
    stage.free()
    stage.tab.value("$('pictures').value = 2")
    before = stage.tab.value("$('files').children.length")  # the program is shared: others may have recorded
    stage.click("record")
    line = r"\.mcap: \d+:\d\d, [\d.]+ MB, \d+ MB.min, \d+ (GB|MB) free \(\d+ (h|min)\), [1-9]\d* frames"
    stage.tab.until(f"live() && /{line}/.test($('record_note').textContent)")
    stage.tab.value("$('note').value = 'lifted by hand'; $('note_form').requestSubmit()")
    (path,) = stage.recordings()
    stage.click("record", "latest.recording.on && latest.recording.frames > 5")
    stage.tab.until(f"!latest.recording.on && $('files').children.length > {before}")
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
    tab.until("!latest.recording.on && latest.recording.note.includes('frames recorded')")
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
    assert stage.tab.value("about[chosen].name") == "endcap_0"
    script = "fetch(document.querySelector('link[rel=icon]').href).then((a) => a.ok && a.headers.get('content-type'))"
    assert stage.tab.promised(script).startswith("image/svg+xml")
