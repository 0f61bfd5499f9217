"""The dot tracker is compiled before the first test, which spends no test's patience on that; one browser for all."""

import sys
from pathlib import Path

import pytest

from sensing.live.core.warm_up import warm_up

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "scripts"))
from live_picture import CHROMIUM, SIZE, Browser


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    warm_up(lambda _: None)


@pytest.fixture(scope="session")
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
