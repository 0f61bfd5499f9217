"""Command `python -m fab.design_page`: local server of the page with sliders for D and T."""

from __future__ import annotations

import sys
import threading
import webbrowser
from collections.abc import Sequence
from pathlib import Path

from cad.errors import ParameterError
from cad.messages import show
from cad.plain_numbers import brief
from cad.typed_folder import EXPORTS
from fab.command import Command, Interrupts

HELP = """\
options, as NAME=VALUE:
  port=8010        port on 127.0.0.1 (default: 8010, or any free one where that is taken)
  exports=DIR      folder that receives D130_T8/ (default: exports/)
  open=yes         no: print the address only, open no browser

The page shows shape, section, mass, cost and printing time of every size at once; its button runs the very command
(`make molds`), and links to the folder's page. It is served to this computer only and needs no network. Ctrl-C ends it,
and with it a run that is going on.
exit status: 0 ended by Ctrl-C or SIGTERM; 2 bad input or no place to write
"""
COMMAND = Command(
    "make design",
    "[port=N] [exports=DIR] [open=no]",
    "A page with sliders for D and T: preview, cost, and the files.",
    HELP,
    {"port": "", "exports": EXPORTS, "open": "yes"},
)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    return COMMAND.run(argv, _act)


def _act(options: dict[str, str], interrupts: Interrupts) -> int:
    port = options["port"]
    if port and not (port.isascii() and port.isdecimal() and len(port) <= 5 and int(port) < 65536):
        raise ParameterError(f"port={brief(port)} is no port: give a number from 0 to 65535", name="port", value=port)
    if options["open"] not in ("yes", "no"):
        raise ParameterError(f"open={options['open']} is neither yes nor no", name="open")
    from fab.design_page.jobs import Jobs
    from fab.design_page.server import DesignServer
    from fab.molds import require_writable

    exports = Path(options["exports"])
    require_writable(exports)
    jobs = Jobs(exports.resolve())
    with DesignServer(exports, jobs, int(port) if port else None) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        show(f"page: {server.url}  (Ctrl-C ends it)")
        if options["open"] == "yes":
            threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
        try:
            threading.Event().wait()
        except KeyboardInterrupt:
            pass
        finally:
            jobs.close()
            server.shutdown()
    interrupts.signal = None
    return 0


if __name__ == "__main__":
    sys.exit(main())
