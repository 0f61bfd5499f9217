"""What programs hear while a camera is unplugged: the last number must not stand as if it were good."""

import itertools
import os
import socket
import time
from types import SimpleNamespace

import numpy as np
import pytest
from live_program import program
from live_stand_in import PATIENCE_S, a_reading, endless, film, frames, pipeline

from sensing.live.cli import _never_came
from sensing.live.core.engine import LiveEndcap
from sensing.live.core.feed import CameraFeed, FileFeed
from sensing.live.core.state import Event
from sensing.live.endcap import Endcap
from sensing.live.outputs.ros import types as ros
from sensing.sources.newest import SourceError


def test_valid_says_false_while_a_camera_is_unplugged(monkeypatch):
    """The last message stood for as long as it was unplugged: true."""
    monkeypatch.setenv("ROS_LOCALHOST_ONLY", "1")
    pytest.importorskip("cyclonedds")
    from sensing.live.outputs.ros.topics import RosTopics

    pipe, _ = a_reading()
    endcap = LiveEndcap(CameraFeed(list), pipe)
    topics = RosTopics([pipe], 1 + os.getpid() % 100, lambda: [endcap.health])
    said = []
    topics._writers["endcap_0"]["valid"] = SimpleNamespace(write=said.append)
    topics._writers["endcap_0"]["image/compressed"] = SimpleNamespace(get_matched_subscriptions=list)
    for event in (Event.GOOD, Event.LOST, Event.UNSEEN):  # a blind camera's frames say it themselves
        endcap.machine.happened(event, "planted")
        topics._look()
    assert [message.cdr for message in said] == [ros.boolean(False)]
    topics.close(PATIENCE_S)


def test_a_zero_that_was_refused_as_no_frame_came_is_not_taken_when_the_camera_comes_back(monkeypatch):
    pytest.importorskip("cyclonedds")
    from sensing.live.outputs.ros import dds, messages, zero_service

    messages.register_trigger()
    monkeypatch.setattr(zero_service, "PATIENCE_S", 0.0)
    pipe, said, rest = pipeline(), [], frames(film([0] * 6))
    pipe.update(rest[0])
    asked = [dds.idl_type(messages.TRIGGER_REQUEST)(guid=1, seq=2, structure_needs_at_least_one_member=0)]
    requests = SimpleNamespace(take=lambda count: [asked.pop()] if asked else [])
    service = zero_service.ZeroServices(None, [], pytest.fail)
    service._ends = [zero_service._End(pipe, requests, SimpleNamespace(write=said.append))]
    before = pipe.zero
    for _ in range(3):  # no frame comes meanwhile
        time.sleep(0.01)
        service._look()
    (answer,) = (ros.decode(messages.TRIGGER_REPLY, message.cdr) for message in said)
    assert not answer.success and "no reference within" in answer.message
    for frame in rest[1:]:  # plugged in again
        pipe.update(frame)
    assert pipe.zero is before and not pipe.taker.collecting


def test_a_stream_says_once_that_a_camera_is_unplugged_and_goes_on_with_it():
    """It gave nothing at all: a loop over it held the last force for as long as the camera was away."""
    openings = itertools.count()

    def camera():
        number, pictures = next(openings), endless(film([0] * 6))()
        if number in (1, 2):
            raise SourceError("/dev/video9: no such camera")
        yield from itertools.islice(pictures, 20 if number == 0 else 1000)

    seen = []
    with Endcap(LiveEndcap(CameraFeed(camera), pipeline())) as endcap:
        for wrench in endcap.stream():
            seen.append(wrench)
            if seen and np.isnan(seen[-1].force_n).all():
                assert "unplugged" in wrench.flags and not endcap.valid
            if len(seen) > 2 and np.isfinite(wrench.force_n).all() and any(np.isnan(w.force_n).all() for w in seen):
                break
    assert sum(bool(np.isnan(wrench.force_n).all()) for wrench in seen) == 1


def test_a_camera_that_gives_no_number_in_a_run_of_fixed_length_is_a_loss():
    """A script of ``--seconds`` went on with an empty file."""
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{nobody.getsockname()[1]}/"
        with program("--url", address, "--no-page", "--json", "--seconds", "1") as process:
            assert process.wait(PATIENCE_S) == 1
            said = process.stderr.read().splitlines()[-1]
    assert said.startswith(f"sensing.live: endcap_0: no number came from {address} (unplugged: ")


def test_a_camera_that_has_given_numbers_is_no_loss_and_nor_is_a_file():
    pipe, reading = a_reading()
    camera, file = LiveEndcap(CameraFeed(list), pipe), LiveEndcap(FileFeed(list), pipe)
    assert "no number came" in _never_came(camera) and _never_came(file) == ""
    camera.stats.add(reading)
    assert _never_came(camera) == ""
