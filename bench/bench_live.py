"""The live pipeline on the simulated robot: speed, delay, wrench error and contact set, by method and model.

    python bench/bench_live.py [--weights-paper wrench_regression_model.pth] [--seconds 12]
    python bench/bench_live.py --recorded                        # those rows alone, anew

Writes bench/live.csv and bench/live.png. Frames are those of the robot scene, in memory; all rows see the same ones, in
one process (but for the row of six processes). Time on a frame (mean and 99 %) is CPU time of the process, which other
work on the machine changes little; from it follow the rows "computed", the delays of a loop that has a core to itself.
The other delays are wall time from capture to wrench in the real loop, cameras out of step as
free-running ones are; they mean something only on a machine with nothing else to do: ``idle_share`` is how often a
thread that sleeps for 5 ms was woken within 1 ms of its time. ``core_share`` is of the run's process with its simulated
cameras and that probe, ``loop_share`` of the threads that work on frames, ``page_share`` of the page's process.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.live.plans import COMMON, COMPUTED, ENDCAPS, MORE, RATE_HZ, RECORDED, Plan, about_run
from bench.live.probes import IdleProbe, Viewer, clocks
from bench.live.table import TABLE, draw, save
from bench.one_line import in_one_line
from bench.parts import table_of
from cad.errors import FileError
from cad.params import EndcapParams
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.core.model import LiveModel, load_model
from sensing.live.core.pipeline import ZERO_FRAMES, EndcapPipeline
from sensing.live.demo.scene import SIZE, SceneSource, scene_film
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.run import LiveRun, reduce_pauses
from sensing.live.web.page import PageServer
from sensing.records import Frame
from sensing.tracking.zero import take_zero


def frames_of(endcap: int, ticks: int) -> list[Frame]:
    """Frames of one round of the scene."""
    film = scene_film()
    return [
        Frame(1 + tick / RATE_HZ, tick, f"scene:{endcap}", jpeg=film.jpeg(endcap, tick), size=SIZE)
        for tick in range(ticks)
    ]


def pipelines(model: LiveModel, endcaps: int) -> list[EndcapPipeline]:
    """Zeroed on the first frames of the scene, in which nothing touches."""
    found = []
    for endcap in range(endcaps):
        zero = take_zero(frames_of(endcap, ZERO_FRAMES))
        found.append(EndcapPipeline(EndcapConfig(f"endcap_{endcap}", f"scene:{endcap}"), model, zero, endcap))
    return found


def errors(model: LiveModel, ticks: int, step: int) -> tuple[dict[str, float], np.ndarray]:
    """Root mean square of force and torque error over all endcaps that carry load, and share of right contact sets.

    Also the CPU time of every frame, (T, ENDCAPS) ms.

    The contact set is right when all six endcaps are: judged at every tick but those of the first and last sixth of a
    ramp, where the load is below the threshold of any detector.
    """
    film = scene_film()
    pipes = pipelines(model, ENDCAPS)
    pictures = [frames_of(endcap, ticks) for endcap in range(ENDCAPS)]
    force, torque, right, judged, spent_ms = [], [], 0, 0, []
    for tick in range(0, ticks, step):
        readings = []
        for endcap, pipe in enumerate(pipes):
            begin = time.process_time()
            readings.append(pipe.update(pictures[endcap][tick]))
            spent_ms.append(1e3 * (time.process_time() - begin))
        touching = film.touching(tick)
        for endcap, reading in enumerate(readings):
            truth = film.truth(endcap, tick)
            if touching[endcap]:
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
    }, np.reshape(spent_ms, (-1, ENDCAPS))  # fmt: skip


def computed(spent_ms: np.ndarray, endcaps: int, rate_hz: float, in_step: bool) -> dict[str, float]:
    """Delays and drops of the loop on a core of its own, from the CPU time of every frame: free of other work's share.

    Waking up is not in it. As the engine does: the newest frame of every endcap is taken, the oldest worked on first.
    """
    ticks, now, dropped, busy_ms = len(spent_ms), 0.0, 0, 0.0
    due = (np.arange(ticks)[:, None] + (0.0 if in_step else np.arange(endcaps) / ENDCAPS)) * 1e3 / rate_hz
    due = np.broadcast_to(due, (ticks, endcaps))
    latency, following = [], [0] * endcaps  # first frame not taken yet
    while waiting := [due[k, endcap] for endcap, k in enumerate(following) if k < ticks]:
        now = max(now, min(waiting))
        newest = [int(np.searchsorted(due[:, endcap], now, "right")) - 1 for endcap in range(endcaps)]
        for when, k, endcap in sorted((due[k, c], k, c) for c, k in enumerate(newest) if k >= following[c]):
            dropped, following[endcap] = dropped + k - following[endcap], k + 1
            now, busy_ms = now + spent_ms[k, endcap], busy_ms + spent_ms[k, endcap]
            latency.append(now - when)
    return {
        "frames": len(latency), "core_share": float(busy_ms / now),
        "p50_ms": float(np.median(latency)), "p99_ms": float(np.percentile(latency, 99)), "dropped": dropped,
    }  # fmt: skip


def live(model: LiveModel, plan: Plan, seconds: float) -> dict[str, float]:
    """Delay, drops and share of a core in the real loop, as the plan asks for it."""
    made = []
    for number, pipe in enumerate(pipelines(model, plan.endcaps)):
        opener = partial(SceneSource, number, plan.rate_hz, 0.0 if plan.in_step else None)
        made.append(LiveEndcap(CameraFeed(opener), pipe))
    run = LiveRun(LiveConfig(tuple(endcap.pipeline.endcap for endcap in made)), made, plan.workers)
    latency: list[float] = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()))
        recording = Recording(run, folder)
        if plan.pictures is not None:
            recording.start(folder / "run.mcap", plan.pictures)
            stack.callback(recording.stop)
        if plan.page:
            server = PageServer(run, recording, "127.0.0.1", 0)
            server.start()
            viewer = Viewer(server.url)
            stack.callback(viewer.close)
            stack.callback(server.close)
        return _measured(run, latency, seconds, server.pid if plan.page else None)


def _measured(run: LiveRun, latency: list[float], seconds: float, pid: int | None) -> dict[str, float]:
    made = run.engine.endcaps

    class Sink:
        def put(self, reading) -> None:  # type: ignore[no-untyped-def]
            latency.append(reading.latency_ms)

    run.engine.add_sink(Sink())
    with run.engine:
        reduce_pauses()
        time.sleep(2.0)
        latency.clear()
        before = [endcap.health.dropped for endcap in made]
        probe, begin = IdleProbe(), np.array(clocks(run, pid))
        time.sleep(seconds)
        wall, spent, loop, beside = np.array(clocks(run, pid)) - begin
        dropped = sum(endcap.health.dropped - b for endcap, b in zip(made, before, strict=True))
    return {
        "frames": len(latency), "core_share": spent / wall, "loop_share": loop / wall, "page_share": beside / wall,
        "p50_ms": float(np.median(latency)), "p99_ms": float(np.percentile(latency, 99)),
        "idle_share": probe.share(), "dropped": dropped,
    }  # fmt: skip


def one_process(number: int, seconds: float) -> dict[str, float]:
    """One camera in a process of its own."""
    cv2.setNumThreads(1)
    model = load_model("default", EndcapParams(130, 8))
    return live(model, Plan(1), seconds)


def six_processes(seconds: float) -> dict[str, float]:
    """Six of them at once: shares of a core add up, delays are the worst of the six."""
    with ProcessPoolExecutor(ENDCAPS, get_context("spawn")) as pool:
        reported = list(pool.map(one_process, range(ENDCAPS), [seconds] * ENDCAPS))
    return {
        "frames": sum(t["frames"] for t in reported), "core_share": sum(t["core_share"] for t in reported),
        "p50_ms": max(t["p50_ms"] for t in reported), "p99_ms": max(t["p99_ms"] for t in reported),
        "idle_share": min(t["idle_share"] for t in reported), "dropped": sum(t["dropped"] for t in reported),
    }  # fmt: skip


def main() -> int:
    """Runs everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--weights-paper", type=Path, help="the authors' checkpoint; without it their rows are left out"
    )
    parser.add_argument("--seconds", type=float, default=12.0, help="of each live run (12); 0 for none")
    parser.add_argument("--step", type=int, default=2, help="ticks between judged frames (2)")
    parser.add_argument("--recorded", action="store_true", help="only the rows with a recording; others stay")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    if options.recorded:
        measure_recorded(options.seconds)
        return 0
    rows: list[dict[str, Any]] = []
    asked, out = asked_models(options.weights_paper), table_of("live.csv", options.seconds > 0)
    for name, weights, method in asked:
        for row in measured(name, weights, method, options.step, options.seconds):
            rows.append(row)
            print(row, flush=True)
    save(rows, out)
    draw(rows, out)
    return 0


def asked_models(weights_paper: Path | None) -> list[tuple[str, Path | None, str]]:
    """(name, weights, tracking method) of the models that can be loaded."""
    asked: list[tuple[str, Path | None, str]] = []
    try:
        load_model("default", EndcapParams(130, 8))
        asked += [("default", None, m) for m in ("dots", "lk", "dis", "gelslim")]
    except FileError as error:
        print(f"rows of the default model are left out: {error}", file=sys.stderr)
    if weights_paper is not None:
        load_model("paper", EndcapParams(130, 8), weights_paper)  # a wrong file ends the bench now, not after its hours
        asked += [("paper", weights_paper, m) for m in ("gelslim", "dots")]
    return asked


def measured(name: str, weights: Path | None, method: str, step: int, seconds: float) -> Iterator[dict[str, Any]]:
    """Rows of one model: its errors, what its times on a frame let six endcaps reach, and live runs."""
    model = load_model(name, EndcapParams(130, 8), weights, method)
    about = {"model": name, "method": method}
    reported, spent_ms = errors(model, scene_film().ticks, step)
    yield about | {"endcaps": ENDCAPS, "rate_hz": RATE_HZ} | reported
    for plan in COMPUTED:
        row = about | about_run(plan) | {"workers": "computed", "outputs": ""}
        yield row | computed(spent_ms, plan.endcaps, plan.rate_hz, plan.in_step)
    if not seconds:
        return
    ours = (name, method) == ("default", "dots")
    for plan in COMMON + (MORE if ours else ()):
        yield about | about_run(plan) | live(model, plan, seconds)
    if ours:
        how = {"endcaps": ENDCAPS, "workers": "6 processes", "rate_hz": RATE_HZ, "outputs": "none"}
        yield about | how | six_processes(seconds)


def measure_recorded(seconds: float) -> None:
    """Rows with a recording, in the place of those that the table had; one without is printed, of the same minutes."""
    model, about = load_model("default", EndcapParams(130, 8)), {"model": "default", "method": "dots"}
    live(model, Plan(), 1.0)  # what is loaded once is no row's
    print("without a recording, for comparison:", live(model, Plan(rate_hz=60, page=True), seconds), flush=True)
    made = []
    for plan in RECORDED:
        made.append(about | about_run(plan) | live(model, plan, seconds))
        print(made[-1], flush=True)
    with TABLE.open(newline="") as file:
        kept = [row for row in csv.DictReader(file) if "recording" not in row["outputs"]]
    place = 1 + max(number for number, row in enumerate(kept) if row["outputs"] == "page")
    save(kept[:place] + made + kept[place:])


if __name__ == "__main__":
    sys.exit(in_one_line(main))
