"""The simulated robot's cameras as MJPEG over HTTP on loopback, to try ``--url`` without a camera.

python -m sensing.live.demo.scene_server --port 8081 &
python -m sensing.live --url http://127.0.0.1:8081/0 --url http://127.0.0.1:8081/2
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.messages import LOG, show
from sensing.arguments import port
from sensing.live.demo.scene import ENDCAPS, SceneSource
from sensing.sources.newest import FrameSource

BOUNDARY = "endcap-frame"
Open = Callable[[int], FrameSource]


def mjpeg_server(port: int, open_source: Open = SceneSource) -> ThreadingHTTPServer:
    """A server of ``/0`` to ``/5`` on loopback; run its ``serve_forever``.

    Args:
        port: to listen on, 0 for any free one.
        open_source: makes the frames of an endcap from its number.

    Raises:
        ParameterError: the port is taken.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            number = self.path.strip("/")
            if not (number.isascii() and number.isdigit() and len(number) < 3 and int(number) < ENDCAPS):
                self.send_error(404, f"give /0 to /{ENDCAPS - 1}")
                return
            self.send_response(200)
            self.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={BOUNDARY}")
            self.end_headers()
            try:
                for frame in open_source(int(number)):
                    head = (
                        f"--{BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(frame.jpeg or b'')}\r\n\r\n"
                    )
                    self.wfile.write(head.encode() + (frame.jpeg or b"") + b"\r\n")
            except OSError:
                return  # the reader has gone

        def log_message(self, format: str, *args: object) -> None:
            """Log nothing."""

    Handler.do_GET.__doc__ = "One camera for as long as it is read."
    try:
        return ThreadingHTTPServer(("127.0.0.1", port), Handler)
    except (OSError, OverflowError) as error:
        raise ParameterError(f"--port {port}: {error}: choose another", name="port", value=port) from None


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve until Ctrl-C; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.live.demo.scene_server"), description="Simulated cameras."
    )
    parser.add_argument("--port", type=port, default=8081, metavar="N", help="(8081)")
    options = parser.parse_args(arguments)
    try:
        server = mjpeg_server(options.port)
        show(f"http://127.0.0.1:{server.server_port}/0 to /{ENDCAPS - 1}")
        server.serve_forever()
    except EndcapError as error:
        LOG.error(f"sensing.live.demo.scene_server: {error}")
        return 2
    except KeyboardInterrupt:
        pass
    return 0


if __name__ == "__main__":
    sys.exit(main())
