"""The live pipeline on the simulated robot: speed, delay, wrench error and contact set, by method and model.

    python bench/bench_live.py [--weights-paper wrench_regression_model.pth] [--seconds 20]

Writes bench/live.csv and bench/live.png. Frames are those of the robot scene, in memory; all rows see the same ones, in
one process (but for the row of six processes). Time on a frame (mean and 99 %) is CPU time of the process, which other
work on the machine changes little. Delays are wall time from capture to wrench in the real loop, cameras out of step as
free-running ones are; they mean something only on a machine with nothing else to do: ``idle_share`` tells how often a
thread that sleeps for 5 ms was woken within 1 ms of its time.
"""

from __future__ import annotations

import argparse
import csv
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from multiprocessing import get_context
from pathlib import Path

import cv2
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from bench_live_soak import Viewer

from cad.errors import FileError
from cad.params import EndcapParams
from sensing.live.config import CapConfig, LiveConfig
from sensing.live.engine import LiveCap
from sensing.live.feed import CameraFeed
from sensing.live.model import LiveModel, load_model
from sensing.live.page import PageServer
from sensing.live.pipeline import ZERO_FRAMES, CapPipeline
from sensing.live.recording import Recording
from sensing.live.run import LiveRun
from sensing.live.scene import SIZE, SceneSource, scene_film
from sensing.records import Frame
from sensing.zero import take_zero

HERE = Path(__file__).resolve().parent
CAPS = 6
RATE_HZ = 30.0
PLANS = (  # caps, workers, rate, page
    (1, 1, 30.0, False), (6, 1, 30.0, False), (6, 2, 30.0, False), (6, 6, 30.0, False), (6, 1, 30.0, True),
    (6, 1, 60.0, True),
)  # fmt: skip
COLUMNS = (
    "model", "method", "caps", "workers", "outputs", "rate_hz", "frames", "work_ms", "work_p99_ms", "frames_s_core",
    "core_share", "p50_ms", "p99_ms", "idle_share", "dropped", "force_error_n", "torque_error_nm", "contact_right",
)  # fmt: skip


def frames_of(cap: int, ticks: int) -> list[Frame]:
    """Frames of one round of the scene."""
    film = scene_film()
    return [
        Frame(1 + tick / RATE_HZ, tick, f"scene:{cap}", jpeg=film.jpeg(cap, tick), size=SIZE) for tick in range(ticks)
    ]


def pipelines(model: LiveModel, caps: int) -> list[CapPipeline]:
    """Zeroed on the first frames of the scene, in which nothing touches."""
    found = []
    for cap in range(caps):
        zero = take_zero(frames_of(cap, ZERO_FRAMES))
        found.append(CapPipeline(CapConfig(f"endcap_{cap}", f"scene:{cap}"), model, zero, cap))
    return found


def errors(model: LiveModel, ticks: int, step: int) -> dict[str, float]:
    """Root mean square of force and torque error over all caps that carry load, and share of right contact sets.

    The contact set is right when all six caps are: judged at every tick but those of the first and last sixth of a
    ramp, where the load is below the threshold of any detector.
    """
    film = scene_film()
    pipes = pipelines(model, CAPS)
    pictures = [frames_of(cap, ticks) for cap in range(CAPS)]
    force, torque, right, judged, spent_ms = [], [], 0, 0, []
    for tick in range(0, ticks, step):
        readings = []
        for cap, pipe in enumerate(pipes):
            begin = time.process_time()
            readings.append(pipe.update(pictures[cap][tick]))
            spent_ms.append(1e3 * (time.process_time() - begin))
        touching = film.touching(tick)
        for cap, reading in enumerate(readings):
            truth = film.truth(cap, tick)
            if touching[cap]:
                force.append(reading.estimate.force_n - truth[:3])
                torque.append(reading.estimate.torque_nm - truth[3:])
        moment = film.moments[tick % film.ticks]
        if moment.stand < 0 or moment.step > 5:
            judged += 1
            right += all(r.contact.touching == t for r, t in zip(readings, touching, strict=True))
    rms = [float(np.sqrt(np.mean(np.sum(np.square(part), axis=1)))) for part in (force, torque)]
    return {
        "frames": len(spent_ms), "work_ms": float(np.mean(spent_ms)), "work_p99_ms": float(np.percentile(spent_ms, 99)),
        "frames_s_core": 1e3 / float(np.mean(spent_ms)),
        "force_error_n": rms[0], "torque_error_nm": rms[1], "contact_right": right / judged,
    }  # fmt: skip


class IdleProbe:
    """Share of wake-ups that came within a millisecond of their time."""

    def __init__(self) -> None:
        self._stop, self.on_time, self.count = threading.Event(), 0, 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            due = time.monotonic() + 0.005
            time.sleep(0.005)
            self.count += 1
            self.on_time += time.monotonic() - due < 1e-3

    def share(self) -> float:
        """Share so far."""
        self._stop.set()
        self._thread.join()
        return self.on_time / max(self.count, 1)


def live(
    model: LiveModel, caps: int, workers: int, rate_hz: float, seconds: float, page: bool = False
) -> dict[str, float]:
    """Delay, drops and share of a core in the real loop, with a page that a viewer looks at or without."""
    made = []
    for number, pipe in enumerate(pipelines(model, caps)):
        made.append(LiveCap(CameraFeed(lambda n=number: SceneSource(n, rate_hz)), pipe))
    run = LiveRun(LiveConfig(tuple(cap.pipeline.cap for cap in made)), made, workers)
    latency: list[float] = []
    with ExitStack() as stack:
        if page:
            server = PageServer(run, Recording(run, HERE), "127.0.0.1", 0)
            server.start()
            viewer = Viewer(server.url)
            stack.callback(viewer.close)
            stack.callback(server.close)
        return _measured(run, latency, seconds)


def _measured(run: LiveRun, latency: list[float], seconds: float) -> dict[str, float]:
    made = run.engine.caps

    class Sink:
        def put(self, reading) -> None:  # type: ignore[no-untyped-def]
            latency.append(reading.latency_ms)

    run.engine.add_sink(Sink())
    with run.engine:
        time.sleep(1.0)
        latency.clear()
        before = [cap.health.dropped for cap in made]
        probe, cpu, begin = IdleProbe(), time.process_time(), time.monotonic()
        time.sleep(seconds)
        spent, wall = time.process_time() - cpu, time.monotonic() - begin
        dropped = sum(cap.health.dropped - b for cap, b in zip(made, before, strict=True))
    return {
        "frames": len(latency), "core_share": spent / wall, "p50_ms": float(np.median(latency)),
        "p99_ms": float(np.percentile(latency, 99)), "idle_share": probe.share(), "dropped": dropped,
    }  # fmt: skip


def one_process(number: int, seconds: float) -> dict[str, float]:
    """One camera in a process of its own."""
    cv2.setNumThreads(1)
    model = load_model("default", EndcapParams(130, 8))
    return live(model, 1, 1, RATE_HZ, seconds)


def six_processes(seconds: float) -> dict[str, float]:
    """Six of them at once: shares of a core add up, delays are the worst of the six."""
    with ProcessPoolExecutor(CAPS, get_context("spawn")) as pool:
        told = list(pool.map(one_process, range(CAPS), [seconds] * CAPS))
    return {
        "frames": sum(t["frames"] for t in told), "core_share": sum(t["core_share"] for t in told),
        "p50_ms": max(t["p50_ms"] for t in told), "p99_ms": max(t["p99_ms"] for t in told),
        "idle_share": min(t["idle_share"] for t in told), "dropped": sum(t["dropped"] for t in told),
    }  # fmt: skip


def main() -> int:
    """Runs everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--weights-paper", type=Path, help="the authors' checkpoint; without it their rows are left out"
    )
    parser.add_argument("--seconds", type=float, default=20.0, help="of each live run (20)")
    parser.add_argument("--step", type=int, default=2, help="ticks between judged frames (2)")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    sys.setswitchinterval(0.001)
    params, film = EndcapParams(130, 8), scene_film()
    asked: list[tuple[str, Path | None, str]] = []
    try:
        load_model("default", params)
        asked += [("default", None, m) for m in ("dots", "lk", "dis", "gelslim")]
    except FileError as error:
        print(f"rows of the default model are left out: {error}", file=sys.stderr)
    if options.weights_paper is not None:
        asked += [("paper", options.weights_paper, m) for m in ("gelslim", "dots")]
    rows = []
    for name, weights, method in asked:
        model = load_model(name, params, weights, method)
        about = {"model": name, "method": method}
        rows.append(about | {"caps": CAPS, "rate_hz": RATE_HZ} | errors(model, film.ticks, options.step))
        print(rows[-1], flush=True)
        if (name, method) in (("default", "dots"), ("paper", "gelslim")):
            for caps, workers, rate, page in PLANS if name == "default" else PLANS[:2]:
                told = live(model, caps, workers, rate, options.seconds, page)
                how = {"caps": caps, "workers": workers, "rate_hz": rate, "outputs": "page" if page else "none"}
                rows.append(about | how | told)
                print(rows[-1], flush=True)
            if name == "default":
                how = {"caps": CAPS, "workers": "6 processes", "rate_hz": RATE_HZ, "outputs": "none"}
                rows.append(about | how | six_processes(options.seconds))
                print(rows[-1], flush=True)
    with (HERE / "live.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})
    draw(rows)
    return 0


def draw(rows: list[dict]) -> None:
    """Error against time on a frame."""
    figure, axis = plt.subplots(figsize=(6, 4))
    for row in rows:
        if "force_error_n" in row:
            mark = "o" if row["model"] == "default" else "s"
            axis.plot(row["work_ms"], row["force_error_n"], mark)
            axis.annotate(f" {row['model']}, {row['method']}", (row["work_ms"], row["force_error_n"]))
    axis.set(xscale="log", xlabel="CPU time on a frame, ms", ylabel="rms force error on the robot scene, N")
    axis.set_ylim(bottom=0)
    axis.set_xticks([2, 5, 10, 20], ["2", "5", "10", "20"])
    axis.minorticks_off()
    axis.margins(x=0.3)
    axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(HERE / "live.png", dpi=110)


if __name__ == "__main__":
    sys.exit(main())
