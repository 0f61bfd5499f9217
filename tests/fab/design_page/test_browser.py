"""The page as a user has it, at three sizes of window: knobs, region, refusal, a run with its lines, the folder's page.

Everything waits for the page's own event "shown"; nothing sleeps.
"""

from __future__ import annotations

import contextlib
import sys
import threading
from pathlib import Path

import pytest
import trimesh
from page_axe import VIOLATIONS, axe

from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.design_page.jobs import Jobs
from fab.design_page.server import DesignServer
from fab.exports.index_page import SHARED, write_index
from fab.exports.preview import PreviewPart, glb
from fab.variant import Variant

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts"))
from live_picture import CHROMIUM, Browser, RefusedError

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this computer")
SIZES = {"desk": (1400, 1000), "tablet": (820, 1180), "phone": (390, 844)}
PRINTS = "print('   0.1 s core', flush=True); print('all 3 checks passed', flush=True)"
SET = """(() => { for (const [name, value] of Object.entries(%s)) {
  const field = document.getElementById(name); field.value = value; field.dispatchEvent(new Event(%r)); } })()"""
COLOURS = """(() => { const gl = viewer.gl, w = viewer.canvas.width, h = viewer.canvas.height,
  d = new Uint8Array(4 * w * h), s = new Set();
  viewer.draw(); gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, d);
  for (let k = 0; k < d.length; k += 4) s.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]); return s.size; })()"""


@pytest.fixture(scope="module")
def exports(tmp_path_factory) -> Path:
    exports = tmp_path_factory.mktemp("exports")
    folder = exports / "D150_T9"
    folder.mkdir()
    for name in SHARED:
        (folder / name).write_bytes(b"0")
    ball = trimesh.creation.icosphere(2, 75.0)
    preview = glb(
        [PreviewPart("shell", "endcap", ball, (0.3, 0.7, 0.6)), PreviewPart("hanger", "mold", ball, (1, 0, 0))]
    )
    part = {"name": "shell", "role": "cast", "material": "silicone", "quantity": 1, "volume_mm3": {"mesh": 4e5},
            "bounding_box_mm": [[-75, -75, 4], [75, 75, 120]], "files": {}}  # fmt: skip
    manifest = {"parts": [part], "gyroid": {"period_mm": 14.0, "density": 0.1}}
    write_index(Variant(MoldLayout(EndcapParams(150.0, 9.0))), manifest, [Check("a.b", 0.0)], preview, folder)
    return exports


@pytest.fixture(scope="module")
def server(exports):
    jobs = Jobs(exports, lambda *_: [[sys.executable, "-c", PRINTS]])
    with DesignServer(exports, jobs, 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server
        jobs.close()
        server.shutdown()


@pytest.fixture(scope="module", params=SIZES)
def tab(request, server, tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("chromium"), SIZES[request.param])
    try:
        with browser.tab() as tab:
            tab.call("Page.enable")
            tab.open(server.url)
            tab.until("document.readyState === 'complete' && typeof page !== 'undefined'")
            tab.after("shown", "page.shown > 0")
            yield tab
    finally:
        browser.close()


def turn(tab, knobs: dict[str, str], event: str = "input") -> None:
    """Change knobs as hands do, and wait until the page shows them."""
    tab.value(SET % (str(knobs), event))
    tab.after("shown", "page.shown === page.asked")


def test_nothing_sticks_out_and_every_knob_has_a_name(tab):
    assert tab.value("document.documentElement.scrollWidth <= window.innerWidth")
    assert tab.value(
        "[...document.querySelectorAll('input, select, button')]"
        ".every((k) => k.labels?.length || k.ariaLabel || k.textContent)"
    )
    assert tab.value("performance.getEntriesByType('resource').every((r) => r.name.startsWith(location.origin))")


def violations(tab) -> list[str]:
    """What axe finds on the page that stands there."""
    tab.value(f"{axe()}; typeof axe.run")
    return tab.promised(VIOLATIONS)


def test_axe_finds_nothing(tab):
    assert violations(tab) == []


def test_a_knob_changes_numbers_section_point_and_shape(tab):
    turn(tab, {"D": "130"})
    before = tab.value("[$('facts').textContent, $('section').innerHTML, $('point').getAttribute('cx'), viewer.drawn]")
    turn(tab, {"D": "200"})
    turn(tab, {"T": "11"})
    after = tab.value("[$('facts').textContent, $('section').innerHTML, $('point').getAttribute('cx'), viewer.drawn]")
    assert all(a != b for a, b in zip(before, after, strict=True))
    assert "make molds D=200 T=11" in tab.value("$('commands').textContent")
    assert tab.value("$('refusal').textContent") == "" and tab.value("!$('make').disabled")


def test_a_slider_that_is_dragged_asks_one_question_at_a_time_and_shows_sizes_on_the_way(tab):
    """Each of its events asked at once: nothing was shown until the server had answered all, seconds behind."""
    drag = """(async () => {
      const asked = window.fetch, seen = new Set();
      let open = 0, most = 0;
      window.fetch = (address, ...more) => {
        const answer = asked(address, ...more);
        if (!address.startsWith("answer.json")) return answer;
        most = Math.max(most, ++open);
        return answer.finally(() => open--);
      };
      const look = () => seen.add($("facts").textContent);
      document.addEventListener("shown", look);
      for (let k = 0; k < 50 || (k < 3000 && seen.size < 2); k++) {
        $("D").value = Math.min(120 + k, 180);
        $("D").dispatchEvent(new Event("input"));
        await new Promise((go) => setTimeout(go, 10));
      }
      const last = $("D").value;
      const answer = () => new Promise((go) => document.addEventListener("shown", go, { once: true }));
      while (page.shown !== page.asked) await answer();
      window.fetch = asked;
      document.removeEventListener("shown", look);
      return [most, seen.size > 1, $("commands").textContent.includes(` D=${last} `)];
    })()"""
    assert tab.promised(drag) == [1, True, True]


def test_the_shape_is_drawn_in_many_colours_and_can_be_cut_and_pulled_apart(tab):
    assert tab.value("viewer.gl !== null && viewer.parts.length > 8 && viewer.gl.getError() === 0")
    whole = tab.value(COLOURS)
    assert whole > 30
    tab.value("$('cut').click()")
    tab.value(SET % ("{'pull': '100'}", "input"))
    assert tab.value("viewer.cut && viewer.pull === 1") and tab.value(COLOURS) != whole
    tab.value("$('cut').click()")
    tab.value(SET % ("{'pull': '0'}", "input"))


def test_the_shape_comes_back_when_the_browser_has_lost_its_graphics(tab):
    before = tab.value(COLOURS)
    lost = """new Promise((done) => { const loss = viewer.gl.getExtension('WEBGL_lose_context'); loss.loseContext();
      viewer.canvas.addEventListener('webglcontextlost', () => setTimeout(() => loss.restoreContext()), { once: true });
      viewer.canvas.addEventListener('webglcontextrestored', () => setTimeout(done), { once: true });
      setTimeout(done, 5000); })"""
    tab.promised(lost)
    assert tab.value("viewer.gl.isContextLost()") is False and tab.value(COLOURS) == before


def test_without_webgl_a_line_stands_where_the_shape_would_turn(tab, server):
    cut = "HTMLCanvasElement.prototype.getContext = () => null"
    script = tab.call("Page.addScriptToEvaluateOnNewDocument", source=cut)["identifier"]
    again(tab, "location.reload()")
    shown = "[$('turn'), $('pull'), $('cut'), $('group'), $('section')].map((part) => part.getClientRects().length)"
    assert tab.value(shown) == [0, 0, 0, 0, 1] and "no WebGL 2" in tab.value("$('stage').textContent")
    turn(tab, {"D": "140"})
    assert "D=140" in tab.value("$('commands').textContent") and tab.value("$('refusal').textContent") == ""
    tab.call("Page.removeScriptToEvaluateOnNewDocument", identifier=script)
    again(tab, "location.reload()")
    assert tab.value("viewer.gl !== null") and tab.value("$('turn').getClientRects().length") == 1


def test_a_size_that_cannot_be_made_shows_why_and_holds_the_button(tab):
    turn(tab, {"D_number": "130", "T_number": "20"})
    assert "nearest valid choice D=130 T=" in tab.value("$('refusal').textContent")
    assert tab.value("$('make').disabled && $('point').getAttribute('fill') === '#c0391c'")
    turn(tab, {"T_number": "8"})
    assert tab.value("!$('make').disabled && $('refusal').textContent === ''")


def test_a_click_in_the_region_sets_both_numbers(tab):
    tab.value("$('region').scrollIntoView()")
    x, y = tab.value(
        "(() => { const r = $('region').getBoundingClientRect();"
        " return [r.x + 0.55 * r.width, r.y + 0.72 * r.height]; })()"
    )
    for kind in ("mousePressed", "mouseReleased"):
        tab.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    tab.after("shown", "page.shown === page.asked && Number($('D_number').value) > 150")
    assert tab.value("$('refusal').textContent") == ""


def test_make_shows_the_lines_then_the_made_shape_and_a_link_to_the_folders_page(tab, server):
    turn(tab, {"D_number": "150", "T_number": "9"})
    before = tab.after("shown", "page.job") and tab.value("page.job.number")
    tab.value("page.real = ''; $('make').click()")
    tab.after("shown", f"page.job.number > {before} && !page.job.running")
    assert tab.value("page.job.status === 0 && page.job.label === 'D150_T9'")
    assert tab.value("$('lines').textContent") == "   0.1 s core\nall 3 checks passed"
    assert tab.value("$('status').textContent") == "D150_T9 is made."
    tab.after("shown", "page.real === 'D150_T9'")
    assert tab.value("viewer.parts.map((part) => part.name).join()") == "shell,hanger"
    link = tab.value("$('done').querySelector('a').href")
    assert link == f"{server.url}exports/D150_T9/index.html"
    tab.open(link)
    tab.until("document.readyState === 'complete' && typeof viewer !== 'undefined'")
    assert tab.value("viewer.gl !== null && viewer.parts.length === 2 && viewer.drawn > 0")
    assert tab.value("document.documentElement.scrollWidth <= window.innerWidth")
    assert "make slice D=150 T=9" in tab.value("document.body.textContent")
    assert violations(tab) == []
    tab.open(server.url)
    tab.until("document.readyState === 'complete' && typeof page !== 'undefined'")
    tab.after("shown", "page.shown > 0 && page.real === 'D150_T9'")  # the made shape again, not its outline


def again(tab, go: str) -> None:
    """Leave the page by a script and wait until it stands there anew."""
    with contextlib.suppress(RefusedError):  # the page may be gone before it answers
        tab.value(f"window.left = true; {go}")
    tab.until("!window.left && document.readyState === 'complete' && typeof page !== 'undefined'")
    tab.after("shown", "page.shown > 0")


def test_the_choice_stays_after_a_reload_and_on_the_way_back(tab, server):
    turn(tab, {"D_number": "163.7", "T_number": "9.35", "joint_clearance_number": "0.12"})
    turn(tab, {"material": "Dragon Skin 30", "printer": "mk4"}, "change")
    chosen = tab.value("$('commands').textContent")
    assert "D=163.7 T=9.35 joint_clearance=0.12 material='Dragon Skin 30' printer=mk4" in chosen
    again(tab, "location.reload()")
    assert tab.value("$('commands').textContent") == chosen
    tab.value("window.left = true")
    tab.open(f"{server.url}exports/D150_T9/index.html")
    tab.until("!window.left && document.readyState === 'complete' && typeof page === 'undefined'")
    again(tab, "history.back()")
    assert tab.value("$('commands').textContent") == chosen


def test_dots_gyroid_and_robot_are_under_a_line_that_opens_and_stay_after_a_reload(tab):
    again(tab, "sessionStorage.clear(); location.reload()")
    assert not tab.value("$('more').open") and tab.value("$('dot_mm').placeholder === '4'")
    tab.value("$('more').querySelector('summary').click()")
    turn(tab, {"dots": "1-8-12", "gyroid": "0.12"})
    turn(tab, {"robot": "blank"}, "change")
    chosen = tab.value("$('commands').textContent")
    assert "make molds D=130 T=8 dots=1-8-12 gyroid=0.12 robot=blank" in chosen
    assert tab.value("$('facts').textContent").count("dots33") == 1
    turn(tab, {"dots": "1-99"})
    assert "dots" in tab.value("$('refusal').textContent")
    again(tab, "location.reload()")
    assert tab.value("$('commands').textContent") == chosen and tab.value("$('more').open")
    assert tab.value("document.documentElement.scrollWidth <= window.innerWidth")
    again(tab, "sessionStorage.clear(); location.reload()")


def test_what_is_shown_of_the_size_before_is_pale_while_a_size_is_refused(tab):
    shown = "[$('facts'), $('commands'), $('turn'), $('section')].map((part) => getComputedStyle(part).opacity).join()"
    wall = tab.value("$('T_number').value")
    assert tab.value(shown) == "1,1,1,1"
    turn(tab, {"T_number": "2"})
    assert tab.value(shown) == "0.3,0.3,0.3,0.3"
    again(tab, "location.reload()")
    assert tab.value(shown) == "1,1,1,1" and tab.value("$('T_number').value") == wall


def test_a_program_that_has_ended_is_said_where_the_knobs_are(tab, server):
    tab.value("window.fetch = () => Promise.reject(new TypeError('nobody answers'))")
    turn(tab, {"D_number": "140"})
    assert "start make design again" in tab.value("$('refusal').textContent") and tab.value("$('make').disabled")
    again(tab, "location.reload()")
    assert tab.value("$('refusal').textContent") == ""
