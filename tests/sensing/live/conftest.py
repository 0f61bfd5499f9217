"""The dot tracker is compiled before the first test, whose patience it would use up; every file has its own browser."""

import sys
from pathlib import Path

import known_cameras
import pytest
from live_stage import Stage
from live_stand_in import Shown

from sensing.live.core import pipeline
from sensing.live.core.warm_up import warm_up

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts"))
from live_picture import CHROMIUM, SIZE, Browser


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    warm_up(lambda _: None)


@pytest.fixture(scope="session", autouse=True)
def looked_for_once():
    """All drawn references are the same picture: its camera is looked for once."""
    with known_cameras.known_to(pipeline):
        yield


@pytest.fixture(scope="module")  # a page that is left open draws on, and slows all tests after it
def tab(tmp_path_factory):
    """The page of a headless browser; a test that changes its size or colours sets them back."""
    if CHROMIUM is None:
        pytest.skip("no Chromium on this computer")
    browser = Browser(tmp_path_factory.mktemp("chromium"), SIZE)
    try:
        with browser.tab() as tab:
            yield tab
    finally:
        browser.close()


@pytest.fixture(scope="module")
def stage(tab, tmp_path_factory):
    """One running program for all tests of a file; each begins with ``stage.free()``."""
    with Stage(tmp_path_factory.mktemp("run"), tab, Shown()) as stage:
        yield stage
