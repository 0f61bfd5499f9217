"""Kits of silicones: one price of a silicone for the bill, the design page and the study."""

from __future__ import annotations

import re

import pytest

from cad import silicone_kits as module
from cad.materials import silicone, silicones
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.silicone_kits import UNKNOWN_USD_KG, silicone_kits, silicone_usd_kg
from fab.design_page import estimate as page
from fab.recipe import closed_cast_mm3, overflow_of, recipe
from fab.slice.filaments import filament
from fab.supplies import silicone_line
from sensing.design import prints
from sensing.design.figures import figures
from sensing.design.pressed import Study
from sensing.design.region import place_of

PARAMS = EndcapParams(147, 8.5)


def test_every_silicone_has_a_kit_and_no_kit_is_of_another_one():
    assert list(silicone_kits()) == list(silicones())


@pytest.mark.parametrize(("name", "usd_kg"), [("Smooth-Sil 950", 80.0), ("Dragon Skin 30", 40 / 0.9)])
def test_a_silicone_costs_the_same_on_the_bill_the_page_and_in_the_study(name, usd_kg, monkeypatch):
    """The study took 40 dollars a kg of any of them: half of what the bill counts of the first."""
    study, layout = Study(PARAMS, name), MoldLayout(PARAMS, silicone=name)
    mix = recipe(closed_cast_mm3(PARAMS), overflow_of(layout), name)
    kit, line = silicone_kits()[name], silicone_line(mix)
    assert line.price_usd == pytest.approx(int(line.order_as.split()[0]) * kit.amount_g / 1000 * usd_kg)
    assert place_of(study, 0.1).cost_usd == pytest.approx(usd_kg * study.mass_g / 1000 + prints.mold_usd(PARAMS))
    lines = {figure.key: figure for figure in figures(study)}
    of_silicone = lines["cost_usd"].value - lines["print_usd"].value
    assert of_silicone == pytest.approx(usd_kg * study.mass_g / 1000)
    assert f"at {usd_kg:.0f} dollars a kg" in lines["cost_usd"].note
    with_it = page.estimate(layout, silicone(name), "generic256").usd
    monkeypatch.setattr(page, "silicone_usd_kg", lambda _: 0.0)
    without = page.estimate(layout, silicone(name), "generic256").usd
    assert with_it - without == pytest.approx(usd_kg * (mix.part_a_g + mix.part_b_g) / 1000)


def test_the_study_estimates_plastic_at_the_prices_of_the_filaments():
    assert filament("PLA").price_usd_kg == prints.PLA_USD_KG
    assert filament("TPU 95A").price_usd_kg == prints.TPU_USD_KG


@pytest.mark.parametrize("price", ["", None])
def test_a_silicone_without_a_kit_or_a_price_is_taken_as_the_dearest(price, monkeypatch):
    row = {"name": "mine", "order_as": "any", "amount_g": "1000", "price_usd": price or "", "provenance": "E"}
    monkeypatch.setattr(module, "silicone_kits", lambda: {} if price is None else {"mine": module._kit(row)})
    assert silicone_usd_kg("mine") == UNKNOWN_USD_KG == max(map(silicone_usd_kg, ("mine", "Ecoflex 00-30")))


def test_a_kit_in_kilograms_is_refused():
    """1 kg of it counted as one gram: 567 kits for one cast."""
    row = {"name": "mine", "order_as": "any", "amount_g": "1", "price_usd": "40", "provenance": "E"}
    with pytest.raises(ValueError, match=re.escape("amount_g=1 is under 50") + ".* in g: 1 kg is 1000"):
        module._kit(row)
