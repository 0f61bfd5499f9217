"""Six simulated cameras with page, viewer and recording for a while: memory, rate, drops.

    python bench/bench_live_soak.py --seconds 3600

Writes bench/live_soak.csv, one row for each twentieth of the run. Memory is the resident set of the process (MB), rates
are readings a second of all caps together.
"""

from __future__ import annotations

import argparse
import asyncio
import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from sensing.live.open_caps import open_caps
from sensing.live.page import PageServer
from sensing.live.recording import Recording
from sensing.live.run import LiveRun, favour_the_loop
from sensing.live.scene import scene_config

HERE = Path(__file__).resolve().parent
COLUMNS = ("time_s", "memory_mb", "rate_hz", "dropped", "unusable", "p99_ms", "recorded", "cpu_share")


def memory_mb() -> float:
    """Resident set of this process."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


class Viewer:
    """A browser's share of the work, without its drawing, in a process of its own as a browser is."""

    def __init__(self, url: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--view", url.replace("http", "ws", 1) + "ws"], stdout=subprocess.PIPE, text=True
        )

    def close(self) -> int:
        """Number of states seen."""
        assert self._process.stdout is not None
        told = self._process.stdout.read()  # it ends with the page
        self._process.wait()
        return int(told or 0)


async def view(url: str) -> int:
    """Look at the page until it ends; returns the number of states seen."""
    seen = 0
    try:
        async with connect(url, max_size=None) as websocket:
            await websocket.recv()
            await websocket.send('{"do":"show","cap":0}')
            async for message in websocket:
                if isinstance(message, str):
                    seen += 1
                    await websocket.send('{"do":"show","cap":0}')
    except ConnectionClosed:
        pass
    return seen


def main() -> int:
    """Runs and writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the run (60)")
    parser.add_argument("--view", metavar="URL", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.view:
        print(asyncio.run(view(options.view)))
        return 0
    config = scene_config()
    run = LiveRun(config, open_caps(config))
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        recording = Recording(run, Path(folder))
        page = PageServer(run, recording, "127.0.0.1", 0)
        with run.engine:
            page.start()
            favour_the_loop()
            viewer = Viewer(page.url)
            time.sleep(5.0)
            begin, step = time.monotonic(), options.seconds / 20
            for number in range(20):
                frames, cpu = sum(cap.stats.frames for cap in run.engine.caps), time.process_time()
                recording.start(Path(folder) / f"{number}.mcap")
                time.sleep(max(0.0, begin + (number + 1) * step - time.monotonic()))
                recorded = recording.note.split(": ")[1]
                recording.stop()
                (Path(folder) / f"{number}.mcap").unlink()
                health = run.engine.health()
                rows.append(
                    {
                        "time_s": time.monotonic() - begin,
                        "memory_mb": memory_mb(),
                        "rate_hz": (sum(cap.stats.frames for cap in run.engine.caps) - frames) / step,
                        "dropped": sum(h.dropped for h in health),
                        "unusable": sum(h.faults for h in health),
                        "p99_ms": max(h.p99_ms for h in health),
                        "recorded": recorded.split()[0],
                        "cpu_share": (time.process_time() - cpu) / step,
                    }
                )
                print(rows[-1], flush=True)
            page.close()
            print(f"{viewer.close()} states seen by the viewer")
    with (HERE / "live_soak.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
