"""The base and what sits in it, measured on the solids: docs/provenance.md at D=130, closed forms, walls, fits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from build123d import Face, GeomType, Pos, Rectangle, Solid
from long_cases import others_long
from OCP.BRep import BRep_Builder
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.TopoDS import TopoDS_Compound

from cad.base import base_part, flank_profile, lug_fillet_mm
from cad.camera import camera_part
from cad.led_ring.board import led_ring_part
from cad.params import EndcapParams
from cad.ring_spacer import ring_spacer_part

DESIGNS = others_long([(98.86, 6.5), (130.0, 8.0), (250.0, 25.0), (100.0, 6.5), (121.0, 8.0), (180.0, 10.0)])
FACT_MM = 0.05  # agreement with the released base


@pytest.fixture(scope="module", params=DESIGNS, ids=lambda d: f"D{d[0]:g}_T{d[1]:g}")
def design(request):
    params = EndcapParams(*request.param)
    return params, base_part(params).solid


@pytest.fixture(scope="module")
def released():
    return base_part(EndcapParams(130.0, 8.0)).solid


def cylinders(solid: Solid) -> list[tuple[float, float, float, float, float]]:
    """Upright cylindrical faces: radius, x, y of the axis, lowest and highest z."""
    found = []
    for face in solid.faces().filter_by(GeomType.CYLINDER):
        cylinder = BRepAdaptor_Surface(face.wrapped).Cylinder()
        if abs(abs(cylinder.Axis().Direction().Z()) - 1) < 1e-9:
            place, box = cylinder.Axis().Location(), face.bounding_box()
            found.append((cylinder.Radius(), place.X(), place.Y(), box.min.Z, box.max.Z))
    return found


def polar(places) -> list[tuple[float, float]]:
    """Distinct axes as (radius of the circle, azimuth), sorted by azimuth."""
    return sorted(
        {(round(math.hypot(x, y), 3), round(math.degrees(math.atan2(y, x)) % 360, 2)) for x, y in places},
        key=lambda p: p[1],
    )


def axes_of(solid: Solid, radius: float) -> list[tuple[float, float]]:
    return [(x, y) for r, x, y, *_ in cylinders(solid) if abs(r - radius) <= FACT_MM / 2]


def assert_circle(solid: Solid, hole_radius: float, circle: float, azimuths: list[float]) -> None:
    """Holes of a radius lie on a circle at given azimuths, to 0.05 mm."""
    places = polar(axes_of(solid, hole_radius))
    assert len(places) == len(azimuths)
    for (radius, azimuth), expected in zip(places, sorted(azimuths), strict=True):
        assert radius == pytest.approx(circle, abs=FACT_MM)
        assert azimuth == pytest.approx(expected, abs=math.degrees(FACT_MM / circle))


# --- docs/provenance.md, GEO01 to GEO20 ---------------------------------------------------------------------------
def test_released_interface_screws(released):
    azimuths = [18 + 36 * k for k in range(10)]
    assert_circle(released, 1.7, 47.53, azimuths)
    assert_circle(released, 3.25, 47.53, azimuths)


def test_released_interface_screws_notice_a_shift(monkeypatch):
    monkeypatch.setattr(EndcapParams, "screw_circle_radius_mm", property(lambda self: 47.53 + 0.08))
    with pytest.raises(AssertionError):
        assert_circle(base_part(EndcapParams(130.0, 8.0)).solid, 1.7, 47.53, [18 + 36 * k for k in range(10)])


def test_released_arm_pattern(released):
    azimuths = [(180 + 72 * k) % 360 for k in range(5)]
    assert_circle(released, 2.8, 60.0, azimuths)
    depths = {round(high - low, 2) for r, _, _, low, high in cylinders(released) if abs(r - 2.8) < 0.01}
    assert depths == {9.2}
    assert {
        round(high, 2) for r, x, y, _, high in cylinders(released) if r == pytest.approx(7.5) and x**2 + y**2 > 1600
    } == {0.0}
    lugs = [(x, y) for r, x, y, *_ in cylinders(released) if abs(r - 7.5) < 0.01 and math.hypot(x, y) > 40]
    assert [radius for radius, _ in polar(lugs)] == pytest.approx([60.0] * 5, abs=FACT_MM)


def test_released_camera_and_cable(released):
    screws = {(round(x, 2), round(y, 2)) for x, y in axes_of(released, 0.975)}
    assert screws == set(itertools.product((-14.0, 14.0), repeat=2))
    for radius in (7.5, 4.1):
        near = {(round(x, 2), round(y, 2)) for x, y in axes_of(released, radius) if math.hypot(x, y) < 20}
        assert near == {(0.0, -12.5), (0.0, 12.5)}
    walls = [f for f in released.faces().filter_by(GeomType.PLANE) if abs(f.normal_at().Z) < 1e-9]
    reach = [abs(f.center().X) for f in walls if abs(abs(f.normal_at().X) - 1) < 1e-9 and f.bounding_box().max.Z < -1.5]
    assert 2 * max(reach) == pytest.approx(31.95, abs=FACT_MM)


def test_released_slots_and_blind_holes(released):
    slots = {(round(x, 2), round(y, 2)) for x, y in axes_of(released, 5.5)}
    assert slots == {(-22.58, 0.0), (22.58, 0.0)}
    blind = [(x, y, low, high) for r, x, y, low, high in cylinders(released) if r == pytest.approx(2.0) and low < -15.9]
    places = polar([(x, y) for x, y, *_ in blind])
    assert [radius for radius, _ in places] == pytest.approx([30.0] * 6, abs=FACT_MM)
    assert [azimuth for _, azimuth in places] == pytest.approx([30 + 60 * k for k in range(6)], abs=0.1)
    assert {round(high, 2) for *_, high in blind} == {-10.0}


def test_released_screw_seats(released):
    assert {round(high, 2) for r, *_, high in cylinders(released) if r == pytest.approx(3.25)} == {-3.1}


def test_released_m4_pairs(released):
    heads = {(round(x, 2), round(y, 2)) for x, y in axes_of(released, 4.125) if abs(x) > 20}
    assert heads == set(itertools.product((-28.53, 28.53), (-7.5, 7.5)))


def test_released_sphere_and_thickness(released):
    spheres = [BRepAdaptor_Surface(f.wrapped).Sphere() for f in released.faces().filter_by(GeomType.SPHERE)]
    assert spheres
    for sphere in spheres:
        assert sphere.Radius() == pytest.approx(67.5, abs=FACT_MM)
        assert sphere.Location().Z() == pytest.approx(38.37, abs=FACT_MM)
    box = released.bounding_box()
    height = [box.min.Z, box.max.Z]
    assert height == pytest.approx([-16.0, 0.0], abs=1e-6)


def test_released_ring_recess(released):
    recess = [c for c in cylinders(released) if math.hypot(c[1], c[2]) < 1e-6 and c[4] > -0.01]
    assert [(c[0], c[3]) for c in recess] == [pytest.approx((39.0, -0.28), abs=1e-3)]
    cones = [f for f in released.faces().filter_by(GeomType.CONE) if f.bounding_box().max.Z > -1]
    cones = [f for f in cones if f.bounding_box().size.X > 60]  # the others are chamfers of pockets
    low = [f.bounding_box().min.Z for f in cones]
    inner = [e.radius for f in cones for e in f.edges().filter_by(GeomType.CIRCLE)]
    assert (
        cones and low == pytest.approx([-1.0] * len(cones), abs=1e-3) and min(inner) == pytest.approx(35.0, abs=FACT_MM)
    )


# --- any size -----------------------------------------------------------------------------------------------------
def inside(params: EndcapParams, x: np.ndarray, y: np.ndarray, z: float) -> np.ndarray:
    """An independent base: set logic on points, from docs/provenance.md and the module's text."""
    rho = np.hypot(x, y)
    tangent_z, tangent_radius, _ = flank_profile(params)
    sphere = math.sqrt(params.base_sphere_radius_mm**2 - (z - params.centre_height_mm) ** 2)
    flank = sphere if z >= tangent_z else tangent_radius - (tangent_z - z)
    solid = rho < flank
    fillet, bottom = lug_fillet_mm(params), flank_profile(params)[2]
    for azimuth in params.arm_azimuths_deg:
        u, v = _turned(x, y, azimuth)
        along = np.clip(u, 0, params.arm_circle_radius_mm)
        solid |= np.hypot(u - along, v) < 7.5
        if fillet:
            start = math.sqrt((bottom + fillet) ** 2 - (7.5 + fillet) ** 2)
            below_tangent = abs(v) * start < (7.5 + fillet) * u
            outside_ball = np.hypot(u - start, abs(v) - 7.5 - fillet) > fillet
            solid |= below_tangent & outside_ball & (u > 0) & (u < start) & (abs(v) < 7.5 + fillet)
        radius = 2.8 if z < -6.8 else max(0.0, 2.8 - (z + 6.8))
        solid &= ~(np.hypot(u - params.arm_circle_radius_mm, v) < radius)
    for azimuth in params.screw_azimuths_deg:
        u, v = _turned(x, y, azimuth)
        solid &= ~(np.hypot(u - params.screw_circle_radius_mm, v) < (3.25 if z < -3.1 else 1.7))
    for azimuth in range(30, 360, 60):
        u, v = _turned(x, y, azimuth)
        radius = 2.0 if z < -10.0 else max(0.0, 2.0 - (z + 10.0))
        solid &= ~(np.hypot(u - 30.0, v) < radius)
    recess = 39.0 if z > -0.28 else 39.0 - 4.0 * (-0.28 - z) / 0.72
    solid &= ~((z > -1.0) & (rho < recess))
    if -10.0 < z < -1.75:
        solid &= ~camera_pocket(x, y)
    solid &= ~((z < -1.0) & (np.hypot(abs(x) - 14, abs(y) - 14) < 0.975))
    solid &= ~(np.hypot(x, abs(y) - 12.5) < 4.1)
    solid &= ~(np.hypot(abs(x) - 22.576, y) < 5.5)
    if -14.0 < z < -10.0:  # the cable's bend, 20 degrees on either side of the channel
        reach = 9.5 - math.sqrt(16.0 - (z + 14.0) ** 2)
        turned = np.degrees(np.arctan2(abs(y), 22.576 - abs(x)))
        solid &= ~((np.hypot(abs(x) - 22.576, y) < reach) & (turned < 20.0))
    return solid & ~(np.hypot(abs(x) - 28.531, abs(y) - 7.5) < (4.125 if z > -5.0 else 2.25))


def camera_pocket(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What the camera's pocket takes away at its own heights: board with four posts, cable's channel, eased corners."""
    across, wide = np.maximum(abs(x), abs(y)), np.minimum(abs(x), abs(y))
    tip = (np.hypot(abs(x) - 13.965, abs(y) - 13.965) > 1.94) & (abs(x) < 13.965) & (abs(y) < 13.965)
    back = np.hypot(wide - 10.025, across - 13.975) < 2.0
    corner = (wide > 12.025) & ~tip  # the post
    rounded = (wide > 10.025) & (across > 13.975) & ~back  # at its foot
    taken = (across < 15.975) & ~corner & ~rounded
    taken |= np.hypot(x, abs(y) - 12.5) < 7.5
    taken |= (abs(x) < 22.576) & (abs(y) < 4.0)
    eased = (abs(abs(x) - 17.4) < 1.43) & (abs(y) < 6.0) & (abs(y) > 4.0)
    for centre in (17.975, 18.076):
        eased &= np.hypot(abs(x) - centre, abs(y) - 6.0) > 2.0
    arc = (abs(x) < 7.764) & (abs(y) > 15.9) & (abs(y) < 17.975) & (np.hypot(abs(x) - 7.764, abs(y) - 17.975) > 2.0)
    return taken | eased | (arc & (abs(x) > 5.3) & (abs(y) < 16.9))


def _turned(x: np.ndarray, y: np.ndarray, azimuth_deg: float) -> tuple[np.ndarray, np.ndarray]:
    c, s = math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg))
    return c * x + s * y, c * y - s * x


def test_section_areas_agree_with_set_logic(design):
    params, solid = design
    heights = (-0.6, -2.4, -4.5, -8.0, -11.0, -15.0)
    size, step = params.diameter_mm + 10, params.diameter_mm / 1000
    ticks = np.arange(-size / 2, size / 2, step) + 0.37 * step
    x, y = np.meshgrid(ticks, np.arange(step / 2, size / 2, step))  # the half y > 0 of a symmetric part
    for z in heights:
        area = sum(face.area for face in (solid & (Pos(0, 0, z) * Rectangle(size, size).face())).faces())
        assert area == pytest.approx(2 * inside(params, x, y, z).sum() * step**2, rel=5e-4)


def test_upper_slab_has_its_closed_form_volume(design):
    """Above the camera's seat and inside the flank: a disc less recess and M3 holes."""
    params, solid = design
    radius = params.screw_circle_radius_mm + 2.5
    recess = math.pi * (39.0**2 * 0.28 + 0.72 / 3 * (39.0**2 + 39.0 * 35.0 + 35.0**2))
    holes = 10 * math.pi * 1.7**2
    slab = solid & Solid.make_cylinder(radius, 1.0).moved(Pos(0, 0, -1.0))
    assert slab.volume == pytest.approx(math.pi * radius**2 - recess - holes, rel=1e-6)


def test_flank_is_tangent_and_overhangs_45_degrees_at_most(design):
    _, solid = design
    for face in solid.faces():
        if face.geom_type in (GeomType.SPHERE, GeomType.CONE) and face.bounding_box().min.Z < -1.5:
            for u, v in itertools.product((0.02, 0.5, 0.98), repeat=2):
                assert math.degrees(math.asin(-face.normal_at(u, v).Z)) <= 45.0 + 1e-6


def distance(first: list[Face], second: list[Face]) -> float:
    """Least distance between two groups of faces, mm."""
    groups = (TopoDS_Compound(), TopoDS_Compound())
    for group, faces in zip(groups, (first, second), strict=True):
        BRep_Builder().MakeCompound(group)
        for face in faces:
            BRep_Builder().Add(group, face.wrapped)
    return BRepExtrema_DistShapeShape(*groups).Value()


def test_walls(design):
    _, solid = design
    spheres = solid.faces().filter_by(GeomType.SPHERE)
    found = [(f, BRepAdaptor_Surface(f.wrapped).Cylinder()) for f in solid.faces().filter_by(GeomType.CYLINDER)]

    def faces(radius: float) -> list[Face]:
        return [f for f, c in found if abs(c.Radius() - radius) < 1e-6 and c.Location().Y() > -1.0]  # mirror image

    holes, pockets, inserts = faces(1.7), faces(3.25), faces(2.8)
    heads, recess, camera = faces(4.125), faces(39.0), faces(0.975)
    pairs = [(holes, spheres), (pockets, inserts), (pockets, heads), (holes, recess), (heads, camera), (inserts, heads)]
    gaps = [distance(first, second) for first, second in pairs]
    roof = 16.0 - 9.2 - 2.8
    floor = -10.0 - -16.0
    assert min(*gaps, roof, floor) >= 1.2


def test_parts_fit(design):
    params, base = design
    parts = {"base": base}
    for build in (ring_spacer_part, led_ring_part, camera_part):
        parts[build(params).name] = build(params).solid
    for (_, first), (_, second) in itertools.combinations(parts.items(), 2):
        common = first & second
        assert (sum(s.volume for s in common.solids()) if common is not None else 0.0) < 1e-6
    for name, solid in parts.items():
        assert solid.is_valid
        if name != "base":
            points = np.array([tuple(v) for v in solid.vertices()])
            assert np.hypot(points[:, 0], points[:, 1]).max() <= params.bore_radius_mm - 0.3
            if name != "camera":
                assert points[:, 2].max() < params.camera_height_mm
