"""A picture of the page with two knobs, taken by headless Chromium: docs/design_page.png.

python scripts/design_picture.py [--out docs/design_page.png]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import threading
from pathlib import Path

from live_picture import CHROMIUM, Browser, keep

from cad.typed_folder import EXPORTS
from fab.design_page.jobs import Jobs
from fab.design_page.server import DesignServer

SIZE = (1400, 900)
KNOBS = {"D": "147", "T": "8.5", "printer": "mk4", "pull": "30"}
SET = """(() => { for (const [name, value] of Object.entries(%s)) {
  const field = document.getElementById(name);
  field.value = value; field.dispatchEvent(new Event('input')); field.dispatchEvent(new Event('change')); }
  document.getElementById('cut').click(); })()"""


def main() -> int:
    """Serve the page, turn its knobs, take the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/design_page.png"))
    options = parser.parse_args()
    if CHROMIUM is None:
        print("no Chromium on this computer: install the package chromium", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        exports = Path(EXPORTS)  # the usual one, which the page's commands need not name; nothing is made
        jobs = Jobs(exports)
        with DesignServer(exports, jobs, 0) as server:
            threading.Thread(target=server.serve_forever, daemon=True).start()
            png = _picture(server.url, Path(folder))
            jobs.close()
            server.shutdown()
    keep(png, options.out)
    return 0


def _picture(url: str, folder: Path) -> bytes:
    browser = Browser(folder / "chromium", SIZE)
    try:
        with browser.tab() as tab:
            tab.call("Page.enable")
            tab.open(url)
            tab.until("document.readyState === 'complete' && typeof page !== 'undefined'")
            tab.after("shown", "page.shown > 0")
            tab.value(SET % json.dumps(KNOBS))
            tab.after("shown", "page.shown === page.asked")
            return tab.picture()
    finally:
        browser.close()


if __name__ == "__main__":
    sys.exit(main())
