"""Topics as another DDS reads them: Fast DDS, where its headers and a compiler are installed (libfastrtps-dev)."""

import os
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, a_reading

from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.topics import TOPICS, RosTopics

pytest.importorskip("cyclonedds")
LATER_S = 3.0  # a subscriber that starts later hears nothing of the first announcements
SOURCE = Path(__file__).resolve().parent / "fastdds_subscriber.cpp"


@pytest.fixture(scope="module")
def subscriber(tmp_path_factory):
    """The program, compiled."""
    if shutil.which("g++") is None:
        pytest.skip("g++ is not installed")
    there = "#include <fastdds/dds/domain/DomainParticipant.hpp>\n"
    look = subprocess.run(["g++", "-std=c++17", "-E", "-x", "c++", "-"], input=there, capture_output=True, text=True)
    if look.returncode:
        pytest.skip("Fast DDS is not installed: apt-get install libfastrtps-dev")
    program = tmp_path_factory.mktemp("fastdds") / "subscriber"
    words = ["g++", "-std=c++17", "-O0", str(SOURCE), "-o", str(program), "-lfastrtps", "-lfastcdr"]
    subprocess.run(words, check=True, timeout=PATIENCE_S)
    return program


def dds_name(kind):
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def test_fast_dds_reads_every_topic(subscriber, monkeypatch, tmp_path):
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    monkeypatch.delenv("CYCLONEDDS_URI", raising=False)
    domain = 1 + os.getpid() % 100  # above 101 ports are those that the system lends out
    kinds = {f"rt/endcap_0/{name}": kind for name, kind in TOPICS.items()}
    kinds["rt/diagnostics"] = ros.DIAGNOSTICS
    words = [word for topic, kind in kinds.items() for word in (topic, dds_name(kind))]
    pipe, reading = a_reading()
    topics = RosTopics([pipe], domain)
    topics.start()
    time.sleep(LATER_S)
    end, printed = time.monotonic() + PATIENCE_S / 3, tmp_path / "printed"
    with printed.open("w") as stream:
        other = subprocess.Popen([str(subscriber), str(domain), *words], stdout=stream)
    while other.poll() is None and time.monotonic() < end:
        topics.put(reading)
        time.sleep(0.05)
    topics.close(PATIENCE_S)
    other.kill()
    lines = dict(line.split() for line in printed.read_text().splitlines())
    assert set(lines) == set(kinds)
    found = {topic: ros.decode(kind, bytes.fromhex(lines[topic])) for topic, kind in kinds.items()}
    plain, full = found["rt/endcap_0/wrench/wrench_pred"], found["rt/endcap_0/wrench/with_covariance"]
    assert [plain.wrench.force.x, plain.wrench.force.y, plain.wrench.force.z] == reading.wrench.force_n.tolist()
    assert np.array_equal(full.covariance, reading.wrench.covariance.ravel()) and full.state == "running"
    assert found["rt/endcap_0/image/compressed"].data.tobytes() == reading.frame.jpeg
    assert found["rt/endcap_0/camera_info"].k[0] == pipe.camera(640, 480).camera.fx_px
