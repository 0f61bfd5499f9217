"""The robot's page as a user has it, at three sizes of window: what it shows, keys, labels, axe's findings."""

from __future__ import annotations

import re
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from long_cases import others_long
from page_axe import VIOLATIONS, axe
from standing_robot import feed, standing_samples

from sensing.robot.estimate import Hold
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node.page import RobotPage
from sensing.robot.node.record import Report
from sensing.tensegrity.robot_file import load_robot

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts"))
from live_picture import CHROMIUM, Browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this computer")
ROBOT = load_robot()
SIZES = {"desk": (1440, 900), "tablet": (1024, 768), "phone": (390, 844)}
KEEP_ERRORS = """window.said = [];
window.addEventListener("error", (e) => said.push(e.message || e.target.src));
window.addEventListener("unhandledrejection", (e) => said.push(String(e.reason)));
console.error = console.warn = (...words) => said.push(words.join(" "));"""
OVERLAPS = """labels.flatMap((a, k) => labels.slice(k + 1).filter((b) =>
  a.x0 < b.x1 && b.x0 < a.x1 && a.y0 < b.y1 && b.y0 < a.y1).map((b) => a.text + " on " + b.text))"""
OUTSIDE = "labels.filter((a) => a.x0 < 0 || a.x1 > $('scene').clientWidth).map((a) => a.text)"


@pytest.fixture(scope="module")
def page():
    """A robot that stands, estimated and true, which has come half a metre; nothing is known of one endcap."""
    poses, samples = standing_samples(ROBOT, 1.5)
    estimator, shown = RobotEstimator(ROBOT), RobotPage(ROBOT, 0)
    feed(estimator, samples)
    estimate, unknown = estimator.state(), Hold(*[np.nan] * 4)
    endcaps = (*estimate.endcaps[:5], replace(estimate.endcaps[5], hold=unknown))
    estimate = replace(estimate, endcaps=endcaps)
    for k in range(6):
        back = np.array([0.1 * (5 - k), 0.0, 0.0])
        at = replace(estimate, time_s=estimate.time_s + k, centre_of_mass_m=estimate.centre_of_mass_m - back)
        shown.report(Report(at, poses, 0.1 * k))
    shown.start()
    yield shown
    shown.close()


@pytest.fixture(scope="module", params=others_long(SIZES))
def tab(request, page, tmp_path_factory):
    browser = Browser(tmp_path_factory.mktemp("chromium"), SIZES[request.param])
    try:
        with browser.tab() as tab:
            tab.call("Page.enable")
            tab.call("Page.addScriptToEvaluateOnNewDocument", source=KEEP_ERRORS)
            tab.open(page.url)
            tab.until("typeof state !== 'undefined' && state !== null && labels.length > 0")
            yield tab
    finally:
        browser.close()


def test_it_shows_what_was_estimated_and_nothing_sticks_out(tab, page):
    rows = tab.value("[...$('rows').rows].map((r) => [...r.cells].slice(0, 2).map((c) => c.textContent))")
    states = ["holds", "free", "holds", "free", "holds", "unknown"]
    assert rows == [[f"endcap_{k}", state] for k, state in enumerate(states)]
    assert re.fullmatch(r"\d\.\d s, path 0\.50 m, off by .*", tab.value("$('status').textContent"))
    assert tab.value("document.documentElement.scrollWidth <= window.innerWidth")
    width = "(e) => e.getBoundingClientRect().right <= e.closest('section').getBoundingClientRect().right"
    assert tab.value(f"[...document.querySelectorAll('#legend span, td, canvas')].every({width})")
    colours = """(() => { const c = $("scene"), d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data,
      s = new Set(); for (let k = 0; k < d.length; k += 4) if (d[k + 3]) s.add(d[k] << 16 | d[k + 1] << 8 | d[k + 2]);
      return s.size; })()"""
    assert tab.value(colours) > 30


def test_no_label_covers_another_from_any_side(tab):
    for _ in range(16):
        tab.value("view.turn += Math.PI / 8, draw()")
        assert tab.value("labels.length") == 6 and tab.value(OVERLAPS) == [] and tab.value(OUTSIDE) == []


def test_keys_turn_zoom_and_reset(tab):
    key = "$('scene').dispatchEvent(new KeyboardEvent('keydown', {{key: '{}', bubbles: true}}))"
    tab.value(key.format("0"))
    before = tab.value("({...view})")
    for pressed in ("ArrowLeft", "ArrowUp", "+"):
        tab.value(key.format(pressed))
    turned = tab.value("({...view})")
    assert all(turned[name] != before[name] for name in ("turn", "tilt", "zoom"))
    tab.value(key.format("0"))
    assert tab.value("({...view})") == before


def test_a_run_that_hangs_is_said_and_who_answers_next_is_asked_about_its_robot(tab, page, monkeypatch):
    """The page waited for an answer before it said that none came: a run that hung looked live."""
    answering, shown = threading.Event(), page.state

    def hangs():
        answering.wait(60)
        raise RuntimeError("ends")

    monkeypatch.setattr(page, "state", hangs)
    try:
        lost = "document.body.classList.contains('lost')"
        tab.until(f"{lost} && /^no answer for [2-9] s/.test($('status').textContent)")
        tab.value("window.before = about")
    finally:
        monkeypatch.setattr(page, "state", shown)
        answering.set()
    tab.until(f"!{lost} && about && about !== window.before && $('status').textContent.includes('path')")


@pytest.mark.parametrize("colours", ["dark", "light"])
def test_axe_finds_nothing(tab, colours):
    source, (width, height) = axe(), tab.value("[innerWidth, innerHeight]")
    with tab.sized(width, height, colours):
        assert tab.value(f"{source}; typeof axe.run") == "function"
        tab.value("draw()")
        assert tab.promised(VIOLATIONS) == []


def test_it_says_no_error_and_asks_nobody_else(tab):
    assert tab.value("said") == []
    assert tab.value("performance.getEntriesByType('resource').every((r) => r.name.startsWith(location.origin))")
