"""A picture of the page of the running simulated robot, taken by headless Chromium: docs/live.png.

python scripts/live_picture.py [--out docs/live.png] [-- options of sensing.live]
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import itertools
import json
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image
from websockets.sync.client import ClientConnection, connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SIZE = (1400, 760)
PATIENCE_S = 180.0  # for what must come
STANDING = (
    "window.drawn > 20 && document.querySelectorAll('.lamp.touch').length === 3"
    " && document.getElementById('robot').textContent.includes('weight')"
)
COLOURS = 256  # of the picture's palette: half the size


class RefusedError(RuntimeError):
    """The browser has no answer to a method."""


class Tab:
    """The page of a browser, over its debugging protocol."""

    def __init__(self, connection: ClientConnection, size: tuple[int, int]) -> None:
        self._connection, self._numbers, self._size = connection, itertools.count(1), size
        self._measure(*size)

    def _measure(self, width: int, height: int) -> None:
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)

    @contextlib.contextmanager
    def sized(self, width: int, height: int, colours: str = "dark") -> Iterator[None]:
        """Within, the page has another size, and its reader prefers ``dark`` or ``light`` colours.

        Args:
            width, height: in px. colours: preference.
        """
        try:
            self._measure(width, height)
            features = [{"name": "prefers-color-scheme", "value": colours}]
            self.call("Emulation.setEmulatedMedia", features=features)
            yield
        finally:
            self._measure(*self._size)
            self.call("Emulation.setEmulatedMedia", features=[])

    def call(self, method: str, **options: object) -> dict[str, Any]:
        """The browser's answer to one method.

        Raises:
            RefusedError: the browser has none: the page was left meanwhile.
        """
        number = next(self._numbers)
        self._connection.send(json.dumps({"id": number, "method": method, "params": options}))
        while True:
            answer = json.loads(self._connection.recv(PATIENCE_S + 10))
            if answer.get("id") == number:
                if "error" in answer:
                    raise RefusedError(f"{method}: {answer['error'].get('message')}")
                return answer["result"]

    def open(self, url: str) -> None:
        """Go to an address."""
        self.call("Page.navigate", url=url)

    def value(self, script: str) -> Any:
        """What a script gives."""
        return self.call("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def promised(self, script: str) -> Any:
        """What the promise of a script gives."""
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["result"]
        return answer["result"].get("value")

    def after(self, event: str, script: str, patience_s: float = PATIENCE_S) -> Any:
        """What a script gives once it is true, looked at whenever the page sends its document an event; no polling."""
        wait = (
            f"new Promise((done, late) => {{ const look = () => {{ const value = ({script}); if (value) {{ "
            f"document.removeEventListener('{event}', look); done(value); }} }}; "
            f"document.addEventListener('{event}', look); setTimeout(() => late('never came to: ' + "
            f"{json.dumps(script)}), {1000 * patience_s:g}); look(); }})"
        )
        return self.promised(wait)

    def until(self, condition: str, script: str = "true", patience_s: float = PATIENCE_S) -> Any:
        """Wait until a script gives a true value; returns what another one gives at that same moment."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            with contextlib.suppress(RefusedError):  # asked while one page went and the next came
                if found := self.value(f"({condition}) ? [{script}] : null"):
                    return found[0]
            time.sleep(0.05)
        raise AssertionError(f"the page never came to: {condition}")

    def picture(self) -> bytes:
        """PNG of what is seen."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])


class Browser:
    """Headless Chromium."""

    def __init__(self, folder: Path, size: tuple[int, int]) -> None:
        self.process = subprocess.Popen(
            [
                CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
                "--disable-background-networking", "--remote-debugging-port=0", f"--user-data-dir={folder}",
                f"--window-size={size[0]},{size[1]}", "about:blank",
            ],
            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        self.size = size
        for line in self.process.stderr:
            if found := re.search(r"ws://127\.0\.0\.1:(\d+)/", line):
                self.port = int(found[1])
                break
        threading.Thread(target=self.process.stderr.read, daemon=True).start()

    @contextlib.contextmanager
    def tab(self) -> Iterator[Tab]:
        """Its page."""
        pages = json.loads(urllib.request.urlopen(f"http://127.0.0.1:{self.port}/json").read())
        page = next(p for p in pages if p["type"] == "page")
        with connect(page["webSocketDebuggerUrl"], max_size=None) as connection:
            yield Tab(connection, self.size)

    def look(self, url: str, until: str, script: str, settle_s: float = 0) -> tuple[Any, bytes]:
        """(value of a script when ``until`` is true, PNG ``settle_s`` later) of a page."""
        with self.tab() as tab:
            tab.open(url)
            found = tab.until(until, script)
            time.sleep(settle_s)
            return found, tab.picture()

    def close(self) -> None:
        """End the browser."""
        self.process.terminate()
        self.process.wait(PATIENCE_S)


def keep(png: bytes, path: Path) -> None:
    """Write a picture in few colours, and say how large it is."""
    Image.open(io.BytesIO(png)).convert("RGB").quantize(COLOURS).save(path, optimize=True)
    print(f"{path}: {path.stat().st_size} bytes")


def main() -> int:
    """Start the live command, wait until three endcaps touch, take the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/live.png"))
    parser.add_argument("rest", nargs="*", help="options of sensing.live, after --")
    options = parser.parse_args()
    if CHROMIUM is None:
        print("no Chromium on this computer: install the package chromium", file=sys.stderr)
        return 2
    live = subprocess.Popen(
        [sys.executable, "-m", "sensing.live", "--port", "0", *options.rest], stdout=subprocess.PIPE, text=True
    )
    assert live.stdout is not None
    url = next((m[1] for line in live.stdout if (m := re.search(r"page: (\S+)", line))), None)
    if url is None:
        return live.wait()
    threading.Thread(target=live.stdout.read, daemon=True).start()
    with tempfile.TemporaryDirectory() as folder:
        browser = Browser(Path(folder), SIZE)
        try:
            time.sleep(4)
            _, png = browser.look(url, STANDING, "0", settle_s=1.5)
        finally:
            browser.close()
            live.send_signal(signal.SIGINT)
            live.wait(20)
    keep(png, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
