"""Six simulated cameras with page, viewer and recording for a while: memory, rate, drops.

    python bench/bench_live_soak.py --seconds 3600

Writes bench/live_soak.csv, one row for each twentieth of the run. Memory is the resident set of the process (MB), rates
are readings a second of all endcaps together.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from live_probes import Viewer

from sensing.live.demo.scene import scene_config
from sensing.live.open_endcaps import open_endcaps
from sensing.live.outputs.recording import Recording
from sensing.live.run import LiveRun, reduce_pauses
from sensing.live.web.page import PageServer

HERE = Path(__file__).resolve().parent
PARTS = 20
COLUMNS = ("time_s", "memory_mb", "rate_hz", "dropped", "unusable", "p99_ms", "recorded", "cpu_share")


def memory_mb() -> float:
    """Resident set of this process."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


def main() -> int:
    """Runs and writes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0, help="length of the run (60)")
    options = parser.parse_args()
    config, rows = scene_config(), []
    run = LiveRun(config, open_endcaps(config))
    with tempfile.TemporaryDirectory() as folder:
        recording = Recording(run, Path(folder))
        page = PageServer(run, recording, "127.0.0.1", 0)
        with run.engine:
            page.start()
            reduce_pauses()
            viewer = Viewer(page.url)
            time.sleep(5.0)
            begin, step = time.monotonic(), options.seconds / PARTS
            for number in range(PARTS):
                file = Path(folder) / f"{number}.mcap"
                rows.append({"time_s": (number + 1) * step} | part(run, recording, file, begin + (number + 1) * step))
                print(rows[-1], flush=True)
            page.close()
            print(f"{viewer.close()} states seen by the viewer")
    with (HERE / "live_soak.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})
    return 0


def part(run: LiveRun, recording: Recording, file: Path, until_s: float) -> dict[str, Any]:
    """A part of the run, with a recording of its own that is thrown away."""
    frames, cpu, begin = (
        sum(endcap.stats.frames for endcap in run.engine.endcaps),
        time.process_time(),
        time.monotonic(),
    )
    recording.start(file)
    time.sleep(max(0.0, until_s - time.monotonic()))
    recorded = recording.note.split(": ")[1]
    recording.stop()
    file.unlink()
    health, spent = run.engine.health(), time.monotonic() - begin
    return {
        "memory_mb": memory_mb(),
        "rate_hz": (sum(endcap.stats.frames for endcap in run.engine.endcaps) - frames) / spent,
        "dropped": sum(h.dropped for h in health),
        "unusable": sum(h.faults for h in health),
        "p99_ms": max(h.p99_ms for h in health),
        "recorded": recorded.split()[0],
        "cpu_share": (time.process_time() - cpu) / spent,
    }


if __name__ == "__main__":
    sys.exit(main())
