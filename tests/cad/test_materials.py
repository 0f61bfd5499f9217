"""The table of silicones: a bad row is named by its line."""

from __future__ import annotations

import csv

import pytest

from cad import materials
from cad.errors import FileError

YEOH, PRONY = materials.YEOH_COLUMNS, ("prony_g", "prony_tau_s")


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
        ("poisson", "0.45", "poisson=0.45 outside 0.48..0.49999: weights and study of any size are made with 0.49"),
        ("mix_ratio", "1A:1B by volume", "mix_ratio='1A:1B by volume' is not of the form '100A:10B by weight'"),
        ("mix_ratio", "1.2.3A:1B by weight", "mix_ratio='1.2.3A:1B by weight' is not of the form"),
        ("mix_ratio", "1A:0B by weight", "with both parts above 0"),
        ("mix_ratio", "some of each", "take the ratio by weight from the data sheet"),
        (YEOH, ("0.2", "", ""), "yeoh_c20_mpa='': Yeoh's law has three constants"),
        (YEOH, ("", "", "0.1"), "yeoh_c10_mpa='': Yeoh's law has three constants"),
        (YEOH, ("nan", "0", "0"), "yeoh_c10_mpa='nan' is not a positive number"),
        (YEOH, ("0.2", "inf", "0"), "yeoh_c20_mpa='inf' is not a number"),
        (YEOH, ("0.2", "-0.11", "0"), "below I1 - 3 = 1 (a bar stretched by 68 %)"),
        (YEOH, ("0.2", "-5", "0"), "c20_mpa=-5, c30_mpa=0 make the Yeoh stiffness vanish"),
        (YEOH, ("0.2", "-0.536", "0.4764"), "make the Yeoh stiffness vanish"),  # at I1 - 3 = 0.375 alone
        (YEOH, ("0.2", "1e308", "0"), "make the Yeoh stiffness vanish"),
        (PRONY, ("x", "1"), "prony_g='x' is not a positive number"),
        (PRONY, ("0.7;0.7", "1;2"), "prony_g='0.7;0.7': relative moduli add up to less than 1"),
        (PRONY, ("0.5;0.5", "1;2"), "prony_g='0.5;0.5': relative moduli add up to less than 1"),
        (PRONY, ("-0.1", "1"), "prony_g='-0.1' is not a positive number"),
        (PRONY, ("0.1", "-1"), "prony_tau_s='-1' is not a positive number"),
        (PRONY, ("0.1;0.1", "1"), "prony_tau_s='1' have 2 and 1 numbers"),
        (PRONY, ("0.1;", "1;2"), "prony_g='' is not a positive number"),
        ("viscosity_pa_s", "20000", "viscosity_pa_s=20000 outside 0.5..300 Pa s (1000 cps are 1)"),
        ("density_g_cm3", "1080", "density_g_cm3=1080 outside 0.9..2 g/cm3 (1000 kg/m3 are 1)"),
        ("modulus_100_mpa", "86", "modulus_100_mpa=86 outside 0.02..6 MPa (145 psi are 1)"),
        ("neo_hooke_c10_mpa", "1.01", "C10 is half the shear modulus, a sixth of Young's"),
        ("neo_hooke_c10_mpa", "0.017", "modulus_100_mpa=0.593: C10 is half the shear modulus"),
        (None, "one too many", "has not one value for each column"),
    ],
)
def test_a_bad_row_is_named_by_line_and_silicone(table, column, value, expected):
    columns, values = ((column,), (value,)) if isinstance(value, str) else (column, value)
    for name, text in zip(columns, values, strict=True):
        table(name, text)
    with pytest.raises(FileError) as caught:
        materials.silicones()
    message = str(caught.value)
    assert message.startswith("materials.csv line 4 (Dragon Skin 30): ") and expected in message
    assert len(message.splitlines()) == 1


def test_the_stretch_that_the_message_of_yeoh_states_is_that_of_its_invariant():
    stretch = 1.68  # of an incompressible bar
    assert stretch**2 + 2 / stretch - 3 == pytest.approx(1, abs=0.02)


def test_a_missing_column_is_named(table):
    table("name", "Dragon Skin 30")
    text = materials.TABLE.read_text(encoding="utf-8")
    materials.TABLE.write_text(text.replace("pot_life_min", "pot_life"), encoding="utf-8")
    with pytest.raises(FileError, match="no column 'pot_life_min'"):
        materials.silicones()


def test_the_laws_that_a_row_gives_are_those_of_its_columns(table):
    for column, value in zip((*YEOH, *PRONY), ("0.2", "-0.1", "0.05", "0.1;0.05", "0.5;2"), strict=True):
        table(column, value)
    row = materials.silicones()["Dragon Skin 30"]
    assert row.yeoh().c20_mpa == -0.1 and row.prony_series() == ((0.1, 0.5), (0.05, 2.0))
    assert materials.silicones()["Dragon Skin 20"].yeoh_mpa is None  # none of the three


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49, 0.4999])
def test_the_moduli_of_a_law_are_those_of_linear_elasticity(poisson):
    law = materials.hyperelastic_law(0.34, poisson)
    young = 2 * law.shear_mpa * (1 + poisson)
    assert law.shear_mpa == 0.68 and law.bulk_mpa == pytest.approx(young / (3 * (1 - 2 * poisson)))
    assert law.poisson == pytest.approx(poisson, abs=1e-12) and law.young_mpa == pytest.approx(young)


def test_the_parts_of_every_silicone_are_those_of_its_words():
    parts = {name: materials.mix_parts(row.mix_ratio) for name, row in materials.silicones().items()}
    assert parts["Smooth-Sil 950"] == (100.0, 10.0) and parts["Dragon Skin 30"] == (1.0, 1.0)
    assert materials.mix_parts("9.7A:1B by weight") == (9.7, 1.0)
