"""Folders of the user's files: of the environment, below the home, and none for a user without a home."""

import hashlib
from pathlib import Path

import pytest

from cad.errors import FileError
from cad.params import EndcapParams
from cad.user_folders import cache_folder, data_folder
from sensing.live.outputs.mcap.config import _kept
from sensing.wrench.weight_files import find_weights


@pytest.fixture
def homeless(monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    for variable in ("XDG_CACHE_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(Path, "home", no_home)


def test_a_folder_is_that_of_the_environment_or_lies_in_the_home(tmp_path, monkeypatch):
    for variable, folder, usual in (("CACHE", cache_folder, ".cache"), ("DATA", data_folder, ".local/share")):
        monkeypatch.setenv(f"XDG_{variable}_HOME", str(tmp_path))
        assert folder() == tmp_path / "endcap-toolkit"
        monkeypatch.delenv(f"XDG_{variable}_HOME")
        assert folder() == Path.home() / usual / "endcap-toolkit"


def test_a_user_without_a_home_has_no_weights_of_his_own_and_is_shown_why_a_replay_is_refused(homeless):
    """A container without a home: both ended in a traceback."""
    assert find_weights(EndcapParams(140.0, 8.0)) is None
    with pytest.raises(FileError, match="files are kept there: set XDG_CACHE_HOME to a folder"):
        _kept(Path("run.mcap"), "weights", hashlib.sha256(b"x").hexdigest(), b"x")
