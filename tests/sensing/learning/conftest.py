"""Drawn sets to learn from and to test on, and cameras that are looked for once."""

import known_cameras
import pytest
from pictured_set import write_set

from sensing.learning import found_camera
from sensing.live.core import pipeline


@pytest.fixture(scope="module")
def looked_for_once():
    """Drawn pictures are no dome's, and take a search of seconds each."""
    with known_cameras.known_to(pipeline, found_camera):
        yield


@pytest.fixture(scope="module")
def folders(tmp_path_factory, looked_for_once):
    """Folders of training and of test."""
    base = tmp_path_factory.mktemp("sets")
    return write_set(base / "train", 8, 1), write_set(base / "test", 3, 2)
