"""What the live benches look with: a viewer of the page in a process of its own, a probe of idle time, clocks."""

from __future__ import annotations

import asyncio
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from sensing.live.run import LiveRun


class Viewer:
    """A browser's share of the work, without its drawing, in a process of its own as a browser is."""

    def __init__(self, url: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, url.replace("http", "ws", 1) + "ws"], stdout=subprocess.PIPE, text=True
        )

    def close(self) -> int:
        """Number of states seen."""
        assert self._process.stdout is not None
        reported = self._process.stdout.read()  # it ends with the page
        self._process.wait()
        return int(reported or 0)


async def view(url: str) -> int:
    """Look at the page until it ends; returns the number of states seen."""
    seen = 0
    try:
        async with connect(url, max_size=None) as websocket:
            await websocket.recv()
            await websocket.send('{"do":"show","endcap":0}')
            async for message in websocket:
                if isinstance(message, str):
                    seen += 1
                    await websocket.send('{"do":"show","endcap":0}')
    except ConnectionClosed:
        pass
    return seen


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


def clocks(run: LiveRun, pid: int | None) -> tuple[float, float, float, float]:
    """Wall time, and CPU time of this process, of the loop's threads in it and of the page's process, s."""
    threads = run.engine.threads
    loop = sum(cpu_s(f"self/task/{thread.native_id}") for thread in threads)
    return time.monotonic(), time.process_time(), loop, 0.0 if pid is None else cpu_s(str(pid))


def cpu_s(task: str) -> float:
    """CPU time of a process or thread so far."""
    fields = Path(f"/proc/{task}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    print(asyncio.run(view(sys.argv[1])))
