"""A running page with what is behind it, and how a test speaks to it."""

import asyncio
import json
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

import numpy as np
from live_stand_in import PATIENCE_S, endless, film, pipeline, wait_for
from websockets.asyncio.client import connect

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed
from sensing.live.outputs.mcap.recording import Recording
from sensing.live.run import LiveRun
from sensing.live.web.page import PageServer


class Site:
    """A running page with what is behind it."""

    def __init__(self, folder: Path, host: str = "127.0.0.1") -> None:
        pose = np.eye(4)
        endcaps = []
        for k in range(3):
            pose[:3, 3] = 250 * np.cos(2.1 * k), 250 * np.sin(2.1 * k), 0
            endcaps.append(EndcapConfig(f"endcap_{k}", "test", T_robot_endcap=pose))
        pictures = film([0] * 4 + [0.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5])
        live = [LiveEndcap(CameraFeed(endless(pictures, 20)), pipeline(f"endcap_{k}", k)) for k in range(3)]
        self.run = LiveRun(LiveConfig(tuple(endcaps), weight_n=30.0), live)
        self.recording = Recording(self.run, folder)
        self.server = PageServer(self.run, self.recording, host, 0)
        self.url = self.server.url
        self.folder = folder

    def __enter__(self):
        self.run.engine.__enter__()
        self.server.start()
        wait_for(lambda: len(self.run.latest.all()) == 3)
        return self

    def __exit__(self, *_):
        self.server.close()
        self.recording.stop()
        self.run.engine.close()


def fetch(url: str, **headers: str) -> tuple[int, bytes]:
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=PATIENCE_S) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def press_button(word: str, endcap: int = 0) -> str:
    """A viewer's message for a button, pressed on the state of this moment."""
    return json.dumps({"do": word, "endcap": endcap, "seen": int(1e3 * time.monotonic())})


def talk(site: Site, *messages: str, **options) -> list:
    """Answers to messages: a text and, if there is a new picture, bytes, each."""

    async def go():
        got = []
        async with connect(site.url.replace("http", "ws", 1) + "ws", **options) as websocket:
            got.append(json.loads(await websocket.recv()))
            for message in messages:
                await websocket.send(message)
                got.append(await asyncio.wait_for(websocket.recv(), PATIENCE_S))
        return got

    return asyncio.run(go())
