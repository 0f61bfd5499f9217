"""The running program with a drawn camera, and a browser that shows its page: what the browser's tests share."""

from __future__ import annotations

import contextlib
import re
import signal
import threading
from pathlib import Path

from live_program import program
from live_stand_in import Shown

from sensing.live.demo.scene_server import mjpeg_server

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

    def __init__(self, folder: Path, tab, shown: Shown, **options) -> None:
        self.folder, self.tab, self.shown, self.options = folder, tab, shown, options
        self.outputs = contextlib.ExitStack()

    def __enter__(self):
        server = mjpeg_server(0, lambda _: self.shown.camera()())
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.outputs.callback(server.shutdown)
        self.address = f"http://127.0.0.1:{server.server_port}/0"
        self.process = self.outputs.enter_context(
            program("--url", self.address, "--port", "0", cwd=self.folder, stderr=None, **self.options)
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
        """The endcap untouched, running, no question open, its page in the browser."""
        self.shown.now = "free"
        if self.tab.value("location.href") != self.url:
            self.tab.open(self.url)
        self.tab.until(FREE + " && !latest.recording.on")
        self.tab.value("close_question()")

    def recordings(self) -> list[Path]:
        return sorted(self.folder.glob("*.mcap"))
