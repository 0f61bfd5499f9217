"""The page of a run: the robot in space, a table of its endcaps, its distance from the truth. On loopback only.

It has no controls. A thread of the run serves it, with the headers and refusals of the live page.
"""

from __future__ import annotations

import asyncio
import importlib.resources
import json
import threading
from collections import deque
from typing import Any

import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.routing import Route

from cad.params import EndcapParams
from sensing.live.web.page import listen
from sensing.live.web.process import HEADERS, LOCKED, refusal, same_origin
from sensing.robot.node.record import Report, estimate_record
from sensing.tensegrity.description import Array, TensegrityRobot
from sensing.tensegrity.samples import Sample

OWN, SHARED = "sensing.robot.node", "sensing.live.web"  # packages of the static files
# Static files: path of the request -> (package, file, media type).
STATIC = {
    "/": (OWN, "index.html", "text/html"),
    "/theme.css": (SHARED, "theme.css", "text/css"),
    "/robot.css": (OWN, "robot.css", "text/css"),
    "/robot.js": (OWN, "robot.js", "text/javascript"),
    "/draw.js": (SHARED, "draw.js", "text/javascript"),
    "/scene.js": (OWN, "scene.js", "text/javascript"),
    "/favicon.svg": (SHARED, "favicon.svg", "image/svg+xml"),
}
STEP_S = 0.2  # s, interval of the points of path and plot
MOST_POINTS = 3000  # ten minutes of them
SIGMAS = 2.0  # standard deviations of the ellipse
CORNERS = 32  # number of corners of the ellipse


class RobotPage:
    """Shows the newest report.

    Args:
        robot: robot of the reports.
        port: TCP port; None for 8008 or, where that is taken, any free one.

    Attributes:
        url: address for a browser.

    Raises:
        ParameterError: the port is taken.
    """

    def __init__(self, robot: TensegrityRobot, port: int | None = None) -> None:
        self._robot = robot
        self._report: Report | None = None
        self._socket = listen("127.0.0.1", port)
        self.url = f"http://127.0.0.1:{self._socket.getsockname()[1]}/"
        self._path: deque[list[float]] = deque(maxlen=MOST_POINTS)
        self._true_path: deque[list[float]] = deque(maxlen=MOST_POINTS)
        self._drift: deque[list[float]] = deque(maxlen=MOST_POINTS)
        self._next_s = -np.inf
        config = uvicorn.Config(
            Starlette(routes=self._routes()), log_level="critical", lifespan="off", server_header=False,
            timeout_graceful_shutdown=1, limit_concurrency=64,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def start(self) -> None:
        """Start to serve."""
        self._thread.start()

    def close(self, wait_s: float = 2.0) -> None:
        """Stop serving."""
        self._server.should_exit = True
        if self._thread.is_alive():
            self._thread.join(wait_s)
        self._socket.close()

    def sample(self, sample: Sample) -> None:
        """Do nothing: the page shows estimates only."""

    def report(self, report: Report) -> None:
        """Take the newest estimate, and extend the path that is drawn."""
        self._report, estimate = report, report.estimate
        if estimate.time_s < self._next_s:
            return
        self._next_s = estimate.time_s + STEP_S
        self._path.append(estimate.centre_of_mass_m[:2].tolist())
        true, drift = report.true_centre_m(self._robot), report.drift_m(self._robot)
        if true is not None and drift is not None:
            spread = float(np.sqrt(np.trace(estimate.centre_of_mass_covariance)))
            self._true_path.append(true[:2].tolist())
            self._drift.append([estimate.time_s, drift, spread])

    def state(self) -> dict[str, Any] | None:
        """Content of the drawing; None before the first estimate."""
        report = self._report
        if report is None:
            return None
        estimate = report.estimate
        radii = [_radius_m(endcap.diameter_mm, endcap.wall_mm) for endcap in self._robot.endcaps]
        bottoms = [each.centre_m[2] - radius for each, radius in zip(estimate.endcaps, radii, strict=True)]
        return estimate_record(estimate) | {
            "path_m": report.path_m,
            "drift_m": report.drift_m(self._robot),
            "truth": None if report.truth is None else report.truth.tolist(),
            "path": list(self._path),
            "true_path": list(self._true_path),
            "drift": list(self._drift),
            "ground_m": float(min(bottoms)),
            "ellipse": ellipse(estimate.centre_of_mass_m[:2], estimate.centre_of_mass_covariance[:2, :2]).tolist(),
        }

    def about(self) -> dict[str, Any]:
        """Constant content of the page."""
        robot = self._robot
        return {
            "bars": [{"name": bar.name, "length_m": bar.length_m} for bar in robot.bars],
            "cables": [
                {
                    "bars": [robot.bar_number(name) for name in cable.bars],
                    "points_m": np.asarray(cable.points_m).tolist(),
                }
                for cable in robot.cables
            ],
            "radius_m": [_radius_m(endcap.diameter_mm, endcap.wall_mm) for endcap in robot.endcaps],
        }

    def _serve(self) -> None:
        asyncio.run(self._server.serve(sockets=[self._socket]))

    def _routes(self) -> list[Route]:
        async def file(request: Request) -> Response:
            if said := refusal(request, "", ""):
                return HTMLResponse(LOCKED.format(said), 403, HEADERS)
            package, name, kind = STATIC[request.url.path]
            text = importlib.resources.files(package).joinpath("static", name).read_text("utf-8")
            return Response(text, media_type=kind, headers=HEADERS)

        async def answer(request: Request) -> Response:
            said = refusal(request, "", "")
            if said or not same_origin(request):
                return PlainTextResponse(said or "Asked for by another page.", 403, HEADERS)
            content = self.about() if request.url.path == "/about.json" else self.state()
            return Response(json.dumps(content, allow_nan=False), media_type="application/json", headers=HEADERS)

        files = [Route(path, file) for path in STATIC]
        return [*files, Route("/about.json", answer), Route("/state.json", answer)]


def ellipse(centre: Array, covariance: Array) -> Array:
    """(32, 2) corners of the ellipse of two standard deviations about a centre, m."""
    angle = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    width, axes = np.linalg.eigh(covariance)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(centre + SIGMAS * (circle * np.sqrt(np.maximum(width, 0))) @ axes.T)


def _radius_m(diameter_mm: float, wall_mm: float) -> float:
    return EndcapParams(diameter_mm, wall_mm).outer_radius_mm / 1000
