"""docs/provenance.md: every id that code and documents cite is there, and its values are those of the code."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from cad import base, coupons, pattern, scaling
from cad.bought import bought_mm
from cad.led_ring.parts import led_part
from cad.led_ring.placement import LED_COUNT
from cad.materials import silicone
from cad.params import EndcapParams
from cad.pattern import RELEASED_GYROID
from fab.led_ring.light import INK_SHARE
from fab.slice.growth import BULK, CROSSING, END_MM, PER_MM

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs" / "provenance.md"
FAMILIES = "GEO|CAM|MAT|LED|NET|GYR|BND"
ID = re.compile(rf"\b(?:{FAMILIES})\d\d\b")
PLACES = ("cad", "endcap", "fab", "sensing", "tests", "bench", "scripts", "docs", "README.md", "CHANGELOG.md")
SUFFIXES = {".py", ".md", ".csv", ".js", ".html", ".toml", ".sh"}
RELEASED = EndcapParams(130.0, 8.0)


@dataclass(frozen=True)
class Fact:
    """One row: values of its numbers, unit, letters, source."""

    values: tuple[float, ...]
    unit: str
    letters: tuple[str, ...]
    source: str


def read_table(text: str) -> dict[str, Fact]:
    facts: dict[str, Fact] = {}
    for line in text.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not ID.fullmatch(cells[0]):
            continue
        name, _, value, unit, letter, source = cells
        assert name not in facts, f"{name} stands twice"
        values = tuple(float(part) for part in value.split(";")) if value else ()
        facts[name] = Fact(values, unit, tuple(letter.split(", ")), source)
    return facts


FACTS = read_table(TABLE.read_text(encoding="utf-8"))


def cited_files() -> list[Path]:
    found: list[Path] = []
    for place in PLACES:
        path = ROOT / place
        found += sorted(path.rglob("*")) if path.is_dir() else [path]
    return [p for p in found if p.suffix in SUFFIXES and "__pycache__" not in p.parts and p != Path(__file__).resolve()]


def test_the_table_is_complete_and_plain():
    assert len(FACTS) > 70
    families: dict[str, list[int]] = {}
    for name, fact in FACTS.items():
        assert fact.source and set(fact.letters) <= set("PMSE"), name
        assert bool(fact.values) <= bool(fact.unit), f"{name} has values without a unit"
        assert all(math.isfinite(value) for value in fact.values), name
        families.setdefault(name[:3], []).append(int(name[3:]))
    assert set(families) == set(FAMILIES.split("|"))
    for family, numbers in families.items():
        assert numbers == list(range(1, len(numbers) + 1)), f"{family}: ids are counted from 01, without gaps"


def test_every_citation_resolves():
    """Also that nothing refers to the notes from which the table was made: they are not in the repository."""
    wrong = []
    for path in cited_files():
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            where = f"{path.relative_to(ROOT)}:{number}"
            wrong += [f"{where}: {name} is not in {TABLE.name}" for name in ID.findall(line) if name not in FACTS]
            wrong += [f"{where}: cite an id"] * ("facts" + ".md" in line)
    assert not wrong, "\n".join(wrong)


def test_letters_at_a_citation_are_those_of_the_table():
    """``(M, GEO07)`` and ``# P, NET11: ...`` name a letter that the row has, and no other."""
    cited = re.compile(rf"\b((?:[PMSE], )+)({ID.pattern})")
    seen, wrong = 0, []
    for path in cited_files():
        if path == TABLE:
            continue
        for letters, name in cited.findall(path.read_text(encoding="utf-8")):
            seen += 1
            given = letters.rstrip(", ").split(", ")
            if name in FACTS and not set(given) <= set(FACTS[name].letters):
                wrong.append(f"{path.relative_to(ROOT)}: {letters}{name}, the table has {FACTS[name].letters}")
    assert seen > 40
    assert not wrong, "\n".join(wrong)


SMOOTH = silicone("Smooth-Sil 950")
SCREWS, ARMS = RELEASED.screw_azimuths_deg, sorted(RELEASED.arm_azimuths_deg)
# Values of the table as the code has them; estimator and simulator are read where they need no heavy import.
CODE: dict[str, tuple[float, ...]] = {
    "GEO01": (2 * scaling.RELEASED_OUTER_RADIUS_MM,),
    "GEO02": (RELEASED.base_sphere_radius_mm,),
    "GEO03": (RELEASED.centre_height_mm,),
    "GEO04": (RELEASED.base_thickness_mm,),
    "GEO05": (len(SCREWS),),
    "GEO06": (SCREWS[0], SCREWS[1] - SCREWS[0]),
    "GEO07": (RELEASED.screw_circle_radius_mm,),
    "GEO08": (2 * base.SCREW_HOLE_RADIUS_MM, 2 * base.SCREW_HEAD_RADIUS_MM),
    "GEO09": (len(ARMS),),
    "GEO10": (RELEASED.arm_azimuths_deg[0], ARMS[1] - ARMS[0]),
    "GEO11": (RELEASED.arm_circle_radius_mm,),
    "GEO12": (2 * base.ARM_INSERT_RADIUS_MM, base.ARM_INSERT_DEPTH_MM),
    "GEO13": (base.LUG_RADIUS_MM,),
    "GEO14": (bought_mm("screw_m4", "clearance_hole"),),
    "GEO15": (2 * base.CAMERA_HOLE_RADIUS_MM, 2 * base.CAMERA_HOLE_OFFSET_MM),
    "GEO16": (base.CAMERA_POCKET_WIDTH_MM,),
    "GEO17": (base.RECESS_RADIUS_MM, base.RECESS_EDGE_DEPTH_MM),
    "GEO18": (base.RECESS_FLOOR_RADIUS_MM, base.RECESS_DEPTH_MM),
    "GEO19": (base.CABLE_OFFSET_MM, base.CABLE_POCKET_RADIUS_MM, base.CABLE_HOLE_RADIUS_MM),
    "GEO20": (*base.M4_POSITION_MM, 2 * base.M4_HEAD_RADIUS_MM),
    "GEO25": (scaling.INTERLOCK_DEPTH_MM,),
    "CAM06": pattern.RELEASED_RINGS[:6],
    "MAT01": (bought_mm("nut_m3", "across_flats"), bought_mm("nut_m3", "thickness")),
    "MAT02": (SMOOTH.density_g_cm3,),
    "MAT04": (SMOOTH.pot_life_min,),
    "MAT05": (SMOOTH.cure_h,),
    "MAT06": (float(SMOOTH.shore.rstrip("A")),),
    "MAT08": (SMOOTH.modulus_100_mpa,),
    "MAT09": (SMOOTH.elongation_percent,),
    "MAT10": (SMOOTH.neo_hooke_c10_mpa,),
    "LED01": (led_part("driver").value,),
    "LED04": (led_part("r_set").value,),
    "LED05": (led_part("led").value,),
    "LED09": (INK_SHARE,),
    "GYR07": (BULK, CROSSING, END_MM),
    "GYR08": (PER_MM,),
    "BND01": (coupons.WIDTH_MM, coupons.WIDTH_MM, coupons.TENSILE_BLOCK_MM),
    "BND02": (coupons.INTERFERENCE_MM,),
    "BND05": (coupons.WIDTH_MM, coupons.PEEL_MM, coupons.WIDTH_MM, coupons.UNBONDED_MM),
}


@pytest.mark.parametrize("name", sorted(CODE))
def test_values_are_those_of_the_code(name):
    assert CODE[name] == pytest.approx(FACTS[name].values, rel=1e-4), name


def test_the_ink_is_that_of_the_renderer():
    from sensing.simulator.render.ink import INK
    from sensing.simulator.render.skin import SILICONE

    assert pytest.approx(INK[1] / SILICONE[0, 2], rel=5e-3) == INK_SHARE  # green


def test_values_of_the_released_pipeline():
    from sensing.recording.synchronise import SLOP_S
    from sensing.tracking import gelslim

    assert FACTS["NET02"].values == (gelslim.CROP_PX,)
    assert FACTS["NET04"].values == gelslim.FARNEBACK
    assert FACTS["NET05"].values == (gelslim.BLOCK_PX, gelslim.CROP_PX // gelslim.BLOCK_PX)
    assert pytest.approx(FACTS["NET23"].values[0]) == SLOP_S * 1000


def test_values_of_the_released_network():
    from sensing.learning import paper_recipe
    from sensing.wrench import paper_model

    assert FACTS["NET08"].values == (paper_model.FIELD_SIZE, paper_model.HIDDEN, 6)
    assert math.prod(FACTS["NET06"].values) == paper_model.FIELD_SIZE
    assert FACTS["NET10"].values[0] == paper_model.SIX_CAMERA_THRESHOLD_N
    assert FACTS["NET11"].values == (paper_recipe.LEARNING_RATE,)
    assert FACTS["NET12"].values == (paper_recipe.BATCH, paper_recipe.EPOCHS)


def test_values_of_fabrication():
    from fab.led_ring.budget import LED_A, RING_A
    from fab.slice import settings

    assert FACTS["MAT07"].values == (silicone().viscosity_pa_s,)
    assert pytest.approx(FACTS["LED03"].values[0]) == LED_A * 1000
    assert pytest.approx(FACTS["LED08"].values[0]) == RING_A * 1000
    assert FACTS["GYR01"].values == (100 * RELEASED_GYROID,)
    assert FACTS["GYR03"].values == (settings.GYROID_LINE,)
    assert pytest.approx(settings.LAYER_MM * (1 - math.pi / 4)) == settings.ROUNDING_MM
    spacing = settings.LINE_MM - settings.ROUNDING_MM
    period = 2 * math.pi * spacing / (settings.GYROID_LINE * RELEASED_GYROID)
    assert period == pytest.approx(FACTS["GYR04"].values[0], abs=0.05)
    with (ROOT / "fab/slice/filaments.csv").open(encoding="utf-8") as stream:
        density = {row["name"]: float(row["density_g_cm3"]) for row in csv.DictReader(stream)}
    for name, fact in (("TPU 95A", FACTS["MAT11"]), ("PLA", FACTS["MAT12"])):
        assert fact.values[0] <= density[name] <= fact.values[1]


def test_computed_rows_follow_from_their_sources():
    value = {name: fact.values[0] for name, fact in FACTS.items() if fact.values}
    assert value["LED04"] == pytest.approx(value["LED01"] / value["LED03"] * 1000)
    assert round(value["LED06"] / value["LED05"]) == LED_COUNT
    outer = value["GEO01"] / 2
    rims = [math.sqrt(r**2 - value["GEO03"] ** 2) for r in (outer, outer - value["GEO23"])]
    assert sum(rims) / 2 == pytest.approx(value["GEO24"], abs=0.01)
    assert value["NET24"] == 2 * FACTS["NET05"].values[1] ** 2
