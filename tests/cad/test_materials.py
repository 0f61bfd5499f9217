"""The table of silicones: a bad row is named by its line."""

from __future__ import annotations

import csv

import pytest

from cad import materials
from cad.errors import FileError


@pytest.fixture
def table(tmp_path, monkeypatch):
    """A copy of the table, and a function that changes one value of its third row (line 4)."""
    with materials.TABLE.open(newline="", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    copy = tmp_path / "materials.csv"
    monkeypatch.setattr(materials, "TABLE", copy)
    materials.silicones.cache_clear()

    def change(column: str | None, value: str) -> None:
        if column is None:
            rows[3].append(value)
        else:
            rows[3][rows[0].index(column)] = value
        with copy.open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream).writerows(rows)

    yield change
    materials.silicones.cache_clear()


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("density_g_cm3", "heavy", "density_g_cm3='heavy' is not a positive number"),
        ("pot_life_min", "-5", "pot_life_min='-5' is not a positive number"),
        ("neo_hooke_c10_mpa", "nan", "neo_hooke_c10_mpa='nan' is not a positive number"),
        ("poisson", "0.7", "poisson=0.7 outside"),
        ("yeoh_c10_mpa", "0.2", None),
        ("prony_g", "x", "could not convert string to float: 'x'"),
        (None, "one too many", "has not one value for each column"),
    ],
)
def test_a_bad_row_is_named_by_line_and_silicone(table, column, value, expected):
    table(column, value)
    if expected is None:
        assert materials.silicones()["Dragon Skin 30"].yeoh_mpa is None  # Yeoh needs all three
        return
    with pytest.raises(FileError) as caught:
        materials.silicones()
    message = str(caught.value)
    assert message.startswith("materials.csv line 4 (Dragon Skin 30): ") and expected in message
    assert len(message.splitlines()) == 1


def test_a_missing_column_is_named(table):
    table("name", "Dragon Skin 30")
    text = materials.TABLE.read_text(encoding="utf-8")
    materials.TABLE.write_text(text.replace("pot_life_min", "pot_life"), encoding="utf-8")
    with pytest.raises(FileError, match="no column 'pot_life_min'"):
        materials.silicones()
