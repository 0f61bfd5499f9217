"""Screws: grip, engagement and room on blocks made for the test, faults planted, and the real base and hanger."""

from __future__ import annotations

import pytest
import trimesh
from long_cases import others_long

from cad.errors import GeometryError
from cad.fasteners import ScrewJoint
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.screw_fit import LENGTHS_MM, fitted, length_tolerance_mm, screw_fit

LAYOUT = MoldLayout(EndcapParams(130.0, 8.0))


def block(low: float, high: float, hole_radius: float = 0.0, hole: tuple[float, float] | None = None):
    """A block 20 x 20 between two heights with an upright hole."""
    body = trimesh.creation.box((20, 20, high - low))
    body.apply_translation((0, 0, (low + high) / 2))
    if not hole_radius:
        return body
    bottom, top = hole or (low - 1, high + 1)
    bore = trimesh.creation.cylinder(hole_radius, top - bottom, sections=96)
    bore.apply_translation((0, 0, (bottom + top) / 2))
    return trimesh.boolean.difference([body, bore], engine="manifold")


def joint(holder: str, washers: int = 0, thread: str = "screw_m3") -> ScrewJoint:
    return ScrewJoint(
        "plate_to_block", "plate", thread, "ISO 4762", "test", ((0.0, 0.0),), True, "plate", ("plate",), "block",
        holder, washers,
    )  # fmt: skip


def test_a_screw_in_plastic_holds_what_is_left_of_its_length():
    meshes = {"plate": block(-8, 0, 1.7), "block": block(0, 30, 1.3, (-1, 14))}
    fit = screw_fit(joint("plastic"), meshes, 16.0)
    assert fit.grip_mm == pytest.approx(8.0, abs=1e-4)
    assert fit.engagement_mm == pytest.approx(16 - 0.35 - 8, abs=1e-4)
    assert fit.tip_room_mm == pytest.approx(14 - (16.35 - 8), abs=1e-4)
    assert all(check.ok for check in fit.checks)
    assert fitted(joint("plastic"), meshes).length_mm == 16.0


@pytest.mark.parametrize(
    ("length", "failing"), [(12.0, "engagement_mm"), (25.0, "tip_room_mm"), (8.0, "engagement_mm")]
)
def test_a_screw_too_short_or_too_long_fails_its_gate(length, failing):
    meshes = {"plate": block(-8, 0, 1.7), "block": block(0, 30, 1.3, (-1, 14))}
    fit = screw_fit(joint("plastic"), meshes, length)
    assert [check.name for check in fit.checks if not check.ok] == [f"plate_to_block.{failing}"]


@pytest.mark.parametrize(("deep_mm", "is_ok"), [(8.47, True), (8.43, False)])
def test_the_longest_screw_ends_a_tenth_above_the_floor(deep_mm, is_ok):
    meshes = {"plate": block(-8, 0, 1.7), "block": block(0, 30, 1.3, (-1, deep_mm))}
    check = next(c for c in screw_fit(joint("plastic"), meshes, 16.0).checks if c.name.endswith("tip_room_mm"))
    assert check.value == pytest.approx(deep_mm - 8.35, abs=1e-4) and check.ok is is_ok


def test_a_loose_nut_needs_its_height_and_one_pitch():
    meshes = {"plate": block(-6, 0, 2.25), "block": block(0, 6, 2.25)}
    bolt = joint("loose nut", washers=1, thread="screw_m4")
    fit = screw_fit(bolt, meshes, 20.0)
    assert fit.grip_mm == pytest.approx(12 + 2 * 0.8, abs=1e-4)
    assert all(check.ok for check in fit.checks) and fitted(bolt, meshes).length_mm == 20.0
    assert not all(check.ok for check in screw_fit(bolt, meshes, 16.0).checks)


def test_a_head_on_an_edge_or_beside_its_part_is_seen():
    tilted = block(-8, 0, 1.7)
    tilted.vertices[:, 2] += 0.1 * tilted.vertices[:, 0] * (tilted.vertices[:, 2] < -4)
    anchor = block(0, 30, 1.3, (-1, 14))
    fit = screw_fit(joint("plastic"), {"plate": tilted, "block": anchor}, 16.0)
    assert not next(check for check in fit.checks if check.name.endswith("seat_error_mm")).ok
    anchor.apply_translation((40, 0, 0))
    with pytest.raises(GeometryError, match="block is not where the screw"):
        screw_fit(joint("plastic"), {"plate": tilted, "block": anchor}, 16.0)


def test_tolerances_are_those_of_the_standard():
    assert [length_tolerance_mm(length) for length in (3.0, 6.0, 10.0, 12.0, 20.0, 40.0)] == [
        0.20, 0.24, 0.29, 0.35, 0.42, 0.50
    ]  # fmt: skip
    assert list(LENGTHS_MM) == sorted(LENGTHS_MM)


@pytest.fixture(scope="module")
def fits():
    """The real base, hanger and interface flange, with their screws."""
    from cad.base import base_part, screw_joints
    from cad.hanger import hanger_part
    from cad.hanger import screw_joints as hanger_joints
    from cad.interface import build_flange
    from fab.meshing.mesh import tessellate

    meshes = {
        "base": tessellate(base_part(LAYOUT.params).solid, 0.05),
        "hanger": tessellate(hanger_part(LAYOUT).solid, 0.05),
        "interface": tessellate(build_flange(LAYOUT.params), 0.05),
    }
    joints = [screw_joints(LAYOUT.params)[0], hanger_joints(LAYOUT)[0]]
    return {j.name: (j, meshes) for j in joints}


@pytest.mark.parametrize(
    ("name", "length"), others_long([("base_to_interface", 8.0), ("hanger_to_interface", 12.0)], unpack=True)
)
def test_the_real_screws_hold_all_of_their_nuts(fits, name, length):
    group, meshes = fits[name]
    fit = fitted(group, meshes)
    assert fit.length_mm == length and all(check.ok for check in fit.checks)
    shorter = screw_fit(group, meshes, LENGTHS_MM[LENGTHS_MM.index(length) - 1])
    assert not shorter.checks[0].ok
    thick = {**meshes, group.seat: meshes[group.seat].copy()}
    thick[group.seat].vertices[:, 2] -= 1.0  # a seat a millimetre lower: the same screw no longer reaches
    assert not screw_fit(group, thick, length).checks[0].ok
