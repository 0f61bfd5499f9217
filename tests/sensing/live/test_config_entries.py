"""Entries that a command changes in an endcaps.toml that people wrote."""

import pytest

from cad.errors import FileError
from sensing.live.core.config_entries import change_entries
from sensing.live.core.endcaps_file import load_config

MATRIX = "T_robot_endcap = [\n  [1, 0, 0, 300],  # mm\n  [0, 1, 0, 0],\n  [0, 0, 1, 0],\n  [0, 0, 0, 1],\n]\n"
TERMS = "relaxation = [\n  [0.05, 0.1, 0.01],\n\n  [0.03, 1.0, 0.01],\n]\n"
WRITTEN = (
    f'weight_n = 60.0\n# right foot\n[[endcap]]\nname = "a"\nsource = "0"\n{TERMS}{MATRIX}"gain" = 2.0  # guessed\n\n'
    '# left foot\n[[endcap]]  # softer\nname = "b"\nsource = "1"\n'
)


def test_a_matrix_over_several_lines_stays_and_a_list_of_before_goes(tmp_path):
    path = tmp_path / "endcaps.toml"
    path.write_text(WRITTEN)
    change_entries(path, {"a": {"gain": 0.73, "relaxation": [[0.06, 0.2, 0.01]]}})
    new = "gain = 0.73\nrelaxation = [[0.06, 0.2, 0.01]]\n"
    assert path.read_text() == WRITTEN.replace(TERMS, "").replace('"gain" = 2.0  # guessed\n', new)
    assert load_config(path).endcaps[0].T_robot_endcap[0, 3] == 300


def test_a_comment_stays_above_the_endcap_that_it_speaks_of(tmp_path):
    path = tmp_path / "endcaps.toml"
    path.write_text(WRITTEN)
    change_entries(path, {"a": {"gain_sd": 0.01}, "b": {"gain": 0.5}})
    assert path.read_text() == WRITTEN.replace("# guessed\n", "# guessed\ngain_sd = 0.01\n") + "gain = 0.5\n"


def test_entries_of_several_endcaps_are_written_together_or_not_at_all(tmp_path):
    path = tmp_path / "endcaps.toml"
    text = WRITTEN.replace('source = "1"', 'source = """\\\ngain = 1"""')
    path.write_text(text)
    with pytest.raises(FileError, match=r"by hand, under a: gain = 0\.7; under b: gain = 0\.9"):
        change_entries(path, {"a": {"gain": 0.7}, "b": {"gain": 0.9}})
    assert path.read_text() == text


def test_ends_of_lines_stay_and_a_byte_order_mark_is_no_hindrance(tmp_path):
    path = tmp_path / "endcaps.toml"
    path.write_bytes(b"\xef\xbb\xbf" + WRITTEN.replace("\n", "\r\n").encode())
    change_entries(path, {"b": {"gain": 0.5}})
    assert path.read_bytes() == (WRITTEN + "gain = 0.5\n").replace("\n", "\r\n").encode()
