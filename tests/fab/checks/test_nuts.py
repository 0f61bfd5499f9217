"""Pockets of the captured nuts: right ones pass, each fault is seen by its check."""

from __future__ import annotations

import math

import pytest
import trimesh
from long_cases import others_long

from cad import interface
from cad.interface import build_flange
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.checks.nuts import nut_checks
from fab.meshing.mesh import from_manifold, tessellate, to_manifold

PARAMS = EndcapParams(98.9, 7)  # the smallest parts: quick


def by_name(checks: list[Check]) -> dict[str, Check]:
    return {check.name: check for check in checks}


def flange_checks(monkeypatch: pytest.MonkeyPatch, **sizes: float) -> dict[str, Check]:
    for name, value in sizes.items():
        monkeypatch.setattr(interface, name, value)
    return checks_of_nuts()


def checks_of_nuts() -> dict[str, Check]:
    return by_name(nut_checks(PARAMS, tessellate(build_flange(PARAMS))))


@pytest.fixture(scope="module")
def right_pockets() -> dict[str, Check]:
    return checks_of_nuts()


@pytest.mark.parametrize(
    ("fault", "check"),
    others_long(
        [
            ({"POCKET_WIDTH_MM": 7.9}, "nut.turn_deg"),
            ({"POCKET_WIDTH_MM": 5.1}, "nut.squeeze_mm"),
            ({"POCKET_FLOOR_MM": 1.4}, "nut.pull_through_mm"),
            ({"SCREW_HOLE_TOP_MM": 6.5}, "nut.roof_mm"),
            ({"POCKET_END_GAP_MM": -0.6}, "nut.seat_play_mm"),
            ({"POCKET_HEIGHT_MM": 1.6}, "nut.squeeze_mm"),
            ({"RIB_HEIGHT_MM": 0.9}, "nut.squeeze_mm"),
            ({"NUT_PLAY_MM": 1.2}, "nut.seat_play_mm"),
        ],
        5,
        unpack=True,
    ),
)
def test_a_wrong_pocket_is_seen(
    monkeypatch: pytest.MonkeyPatch, right_pockets: dict[str, Check], fault: dict[str, float], check: str
) -> None:
    assert right_pockets[check].ok
    assert not flange_checks(monkeypatch, **fault)[check].ok


def test_a_turned_flange_is_seen() -> None:
    flange = tessellate(build_flange(PARAMS))
    flange.apply_transform(trimesh.transformations.rotation_matrix(math.radians(4), (0, 0, 1)))
    checks = nut_checks(PARAMS, flange)
    assert [check.name for check in checks if not check.ok]


def test_pull_through_is_measured_not_echoed(monkeypatch: pytest.MonkeyPatch) -> None:
    value = flange_checks(monkeypatch, POCKET_FLOOR_MM=2.05)["nut.pull_through_mm"].value
    assert value == pytest.approx(2.05, abs=1e-4)


def test_tpu_above_the_flange_is_no_roof_of_a_pocket(right_pockets: dict[str, Check]) -> None:
    """Over a screw the gyroid stands or does not: it is not counted."""
    middle = (0, 0, PARAMS.flange_thickness_mm + 3.95)
    ring = trimesh.creation.annulus(PARAMS.bore_radius_mm, PARAMS.bore_radius_mm + 30, 8).apply_translation(middle)
    covered = to_manifold(tessellate(build_flange(PARAMS))) + to_manifold(ring)
    found = by_name(nut_checks(PARAMS, from_manifold(covered)))
    for name in ("nut.roof_mm", "nut.pull_through_mm"):
        assert found[name].value == pytest.approx(right_pockets[name].value, abs=1e-3)
