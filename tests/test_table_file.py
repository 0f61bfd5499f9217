"""How the benches write their tables."""

import numpy as np
import pytest

from bench.table_file import write_table
from cad.errors import FileError

ROWS = [{"what": "a", "n": 3, "force_n": 1 / 3}, {"what": "b", "force_n": np.float32(12345.678), "more": True}]


def test_a_table_has_all_columns_in_the_order_in_which_the_rows_name_them(tmp_path):
    write_table(tmp_path / "t.csv", ROWS, figures=3)
    assert (tmp_path / "t.csv").read_bytes() == b"what,n,force_n,more\na,3,0.333,\nb,,1.23e+04,True\n"


def test_columns_and_missing_values_can_be_given_and_numbers_stay_as_they_are(tmp_path):
    write_table(
        tmp_path / "t.csv", [ROWS[0] | {"more": ""}, {"what": "b"}], ("more", "force_n", "n", "what"), missing="nan"
    )
    assert (tmp_path / "t.csv").read_text().splitlines() == ["more,force_n,n,what", f",{1 / 3!r},3,a", "nan,nan,nan,b"]


def test_what_cannot_be_written_leaves_the_table_of_before(tmp_path):
    path = tmp_path / "t.csv"
    write_table(path, ROWS)
    before = path.read_bytes()
    with pytest.raises(ValueError, match="more"):
        write_table(path, ROWS, ("what", "n", "force_n"))
    assert path.read_bytes() == before and list(tmp_path.iterdir()) == [path]
    with pytest.raises(FileError, match="nowhere"):
        write_table(tmp_path / "nowhere" / "t.csv", ROWS)
