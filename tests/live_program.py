"""``sensing.live`` or ``sensing.robot`` as a process of its own, with the stand-in model, and a simulated camera."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

from live_stand_in import endless, film

from sensing.live.demo.scene_server import mjpeg_server

HERE = Path(__file__).resolve().parent
COMMAND = """
import sys
from sensing.live.ending import end_at_once, leave
end_at_once()
import sensing.live.open_endcaps as endcaps
import known_cameras
from live_stand_in import stand_in
from sensing.live.core import pipeline
pipeline.rest_camera = known_cameras.rest_camera
endcaps.load_model = lambda *_: stand_in()
import sensing.live.run
from live_stand_in import PATIENCE_S
sensing.live.run.END_S = PATIENCE_S  # on a loaded computer two seconds are too short for a file
from {cli} import main
leave(main(sys.argv[1:]))
"""
LIVE, ROBOT = "sensing.live.cli", "sensing.robot.node.cli"


@contextlib.contextmanager
def program(*arguments: str, cli: str = LIVE, **options) -> Iterator[subprocess.Popen]:
    """The command of a module; killed at the end if it still runs."""
    environment = {**os.environ, "PYTHONPATH": f"{HERE}{os.pathsep}{HERE.parent}"}
    settings = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "env": environment} | options
    process = subprocess.Popen([sys.executable, "-c", COMMAND.format(cli=cli), *arguments], **settings)
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


@contextlib.contextmanager
def camera(pushes: list[float] | None = None, rate_hz: float = 30.0) -> Iterator[str]:
    """Address of a camera on loopback."""
    pictures = film(pushes or [0] * 30 + [1.0] * 6)
    server = mjpeg_server(0, lambda _: endless(pictures, rate_hz)())
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/0"
    finally:
        server.shutdown()
