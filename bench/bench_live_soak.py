"""Six simulated cameras with page, viewer and one recording for as long as asked: memory, rate, what was lost.

    python bench/bench_live_soak.py --seconds 3600

Writes bench/live_soak.csv, a row a minute. Memory is the resident set (MB) of the run and of the page's process, rates
are readings a second of all endcaps together, ``load`` is the machine's (1 minute): beside more work than it has
cores for, frames are lost to that work. Pictures are encoded anew at ``--quality``, so that an hour fits the disk. At
the end, or after Ctrl-C, the one file is read from its first byte to its last, and its pictures are counted.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.records import Channel, Message

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.live.probes import Viewer, cpu_s
from bench.one_line import in_one_line
from bench.table_file import write_table
from sensing.live.core.warm_up import warm_up
from sensing.live.demo.scene import scene_config, scene_film
from sensing.live.ending import Stop
from sensing.live.mcap_records import read_records
from sensing.live.open_endcaps import open_endcaps
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.run import LiveRun, reduce_pauses
from sensing.live.web.page import PageServer

HERE = Path(__file__).resolve().parent
SETTLE_S = 300.0  # memory is compared from here on
COLUMNS = (
    "time_s", "memory_mb", "page_memory_mb", "rate_hz", "frames", "dropped", "unusable", "recorded", "lost_to_disk",
    "file_mb", "p99_ms", "cores", "page_cores", "load",
)  # fmt: skip


def memory_mb(process: str) -> float:
    """Resident set of a process ("self" or its number)."""
    for line in Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024
    return float("nan")


def lighten(quality: int) -> None:
    """Encode the scene's pictures anew: 15 kB at 50 instead of 46."""
    pictures = scene_film().pictures
    for key, jpeg in pictures.items():
        picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_UNCHANGED)
        pictures[key] = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()


class Watch:
    """Looks at a run in steps.

    Args:
        run: begun. recording: of it. page: its page. file: that is recorded.
    """

    def __init__(self, run: LiveRun, recording: Recording, page: PageServer, file: Path) -> None:
        self._run, self._recording, self._pid, self._file = run, recording, str(page.pid), file
        self._begin = self._before = self._now()

    def row(self) -> dict[str, Any]:
        """What happened since the row before."""
        now, before, health = self._now(), self._before, self._run.engine.health()
        self._before, spent = now, now[0] - before[0]
        recorder = self._recording._recorder
        assert recorder is not None
        return {
            "time_s": now[0] - self._begin[0],
            "memory_mb": memory_mb("self"),
            "page_memory_mb": memory_mb(self._pid),
            "rate_hz": (now[3] - before[3]) / spent,
            "frames": now[3],
            "dropped": sum(h.dropped for h in health),
            "unusable": sum(h.faults for h in health),
            "recorded": recorder.frames,
            "lost_to_disk": recorder.dropped,
            "file_mb": self._file.stat().st_size / 1e6,
            "p99_ms": max(h.p99_ms for h in health),
            "cores": (now[1] - before[1]) / spent,
            "page_cores": (now[2] - before[2]) / spent,
            "load": os.getloadavg()[0],
        }

    def _now(self) -> tuple[float, float, float, int]:
        """(s, CPU time of the run, of the page's process, readings)."""
        frames = sum(endcap.stats.frames for endcap in self._run.engine.endcaps)
        return time.monotonic(), time.process_time(), cpu_s(self._pid), frames


def soak(seconds: float, step_s: float, file: Path, out: Path) -> list[dict[str, Any]]:
    """The run, a row each ``step_s``.

    Args:
        seconds: of the run. step_s: between rows. file: the recording. out: the table, written anew with each row.
    """
    config, rows = scene_config(), []
    warm_up(print)
    run = LiveRun(config, open_endcaps(config))
    recording = Recording(run, file.parent)
    page = PageServer(run, recording, "127.0.0.1", 0)
    with run.engine, ExitStack() as own:
        page.start()
        reduce_pauses()
        viewer = Viewer(page.url)
        time.sleep(5.0)
        recording.start(file)
        watch, begin_s = Watch(run, recording, page, file), time.monotonic()
        stop = own.enter_context(Stop()).asked
        for number in range(1, round(seconds / step_s) + 1):
            if stop.wait(max(0.0, begin_s + number * step_s - time.monotonic())):
                break
            rows.append(watch.row())
            print({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in rows[-1].items()}, flush=True)
            save(rows, out)
        page.close()
        print(f"{viewer.close()} states seen by the viewer")
    recording.stop()
    print(recording.note)
    return rows


def save(rows: list[dict[str, Any]], out: Path) -> None:
    """The table so far."""
    write_table(out, rows, COLUMNS, figures=5)


def main() -> int:
    """Runs, writes, and reads the recording again."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=120.0, help="length of the run (120)")
    parser.add_argument("--step", type=float, default=60.0, metavar="S", help="between rows (60)")
    parser.add_argument("--quality", type=int, default=50, metavar="Q", help="of the JPEGs; 0 as they are (50)")
    parser.add_argument("--folder", type=Path, help="where the recording lies meanwhile (the system's temporary one)")
    parser.add_argument("--out", type=Path, default=HERE / "live_soak.csv", help="(bench/live_soak.csv)")
    options = parser.parse_args()
    if options.quality:
        lighten(options.quality)
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        file = Path(folder) / "soak.mcap"
        rows = soak(options.seconds, options.step, file, options.out)
        topics: dict[int, str] = {}
        counts: Counter[str] = Counter()
        for record in read_records(file):
            if isinstance(record, Channel):
                topics[record.id] = record.topic.split("/", 2)[-1]
            elif isinstance(record, Message):
                counts[topics[record.channel_id]] += 1
    late = [row for row in rows if row["time_s"] >= SETTLE_S - 1]
    for name in ("memory_mb", "page_memory_mb") if late else ():
        values = [row[name] for row in late]
        print(f"{name} after {SETTLE_S:g} s: {min(values):.1f} to {max(values):.1f}, last {values[-1]:.1f}")
    print(f"read again: {counts['image/compressed']} pictures, {counts['wrench/wrench_pred']} wrenches")
    return 0


if __name__ == "__main__":
    sys.exit(in_one_line(main))
