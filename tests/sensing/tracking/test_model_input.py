"""What the nominal camera would see, against projections of the same points through both cameras."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cad.dots import dot_pattern
from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.camera.mount import mount, rotation_matrix
from sensing.camera.nominal import nominal_lens, nominal_mount
from sensing.learning.marker_fields import PLAIN, MarkerSensor
from sensing.records import DotTracks
from sensing.tracking.field.operator import displacement_to_cells, field_operator
from sensing.tracking.model_input import ModelInput

PARAMS = EndcapParams(130, 8)
SHAPE = (16, 16)
TURNED = mount(nominal_lens(), (0.6, -0.4, PARAMS.camera_height_mm + 0.5), rotation_matrix([0.03, -0.02, 0.04]))


def on_sphere():
    centre = np.array([0, 0, PARAMS.centre_height_mm])
    points = centre + PARAMS.inner_radius_mm * np.array([dot.direction for dot in dot_pattern(PARAMS)])
    pixels = TURNED.project(points)
    return points[((pixels > 5) & (pixels < [634, 474])).all(axis=1)]


def view(points, radial=None):
    tracker = SimpleNamespace(size=(640, 480), reference_px=TURNED.project(points))
    return ModelInput(tracker, SHAPE, PARAMS, TURNED, radial)


def test_a_camera_of_another_picture_size_is_refused():
    tracker = SimpleNamespace(size=(1280, 960), reference_px=TURNED.project(on_sphere()))
    with pytest.raises(ParameterError, match="a camera of 640x480 px, the pictures have 1280x960"):
        ModelInput(tracker, SHAPE, PARAMS, TURNED)


def test_points_of_the_undeformed_sphere_are_seen_exactly_as_the_nominal_camera_sees_them():
    points = on_sphere()
    assert len(points) > 80
    seen = view(points).seen(TURNED.project(points))
    assert np.abs(seen - nominal_mount(PARAMS).project(points)).max() < 1e-6
    assert np.abs(TURNED.project(points) - nominal_mount(PARAMS).project(points)).max() > 8  # they do differ


def test_the_field_is_nearly_that_of_the_nominal_camera_whatever_is_built_in():
    """A dent of 3 mm: what misalignment leaves is a small part of what it does without."""
    points = on_sphere()
    near = np.exp(-(((points - points[5]) / 25) ** 2).sum(axis=1))[:, None]
    moved = points + near * [0.8, 0.4, -3.0]
    count = len(points)
    tracks = DotTracks(0.0, np.arange(count), TURNED.project(points), TURNED.project(moved), np.ones(count),
                       np.zeros(count, bool), (640, 480))  # fmt: skip
    reported = view(points).field(tracks).channels
    nominal = nominal_mount(PARAMS)
    plain = ModelInput(
        SimpleNamespace(size=(640, 480), reference_px=nominal.project(points)), SHAPE, PARAMS, nominal
    ).field(DotTracks(0.0, np.arange(count), nominal.project(points), nominal.project(moved), np.ones(count),
                      np.zeros(count, bool), (640, 480))).channels  # fmt: skip
    raw = field_operator(tracks.reference_px, (640, 480), SHAPE)
    untold = raw.field(tracks.displacement_px) * np.float32(200 / 480)
    rms = [np.sqrt(((field - plain)[:, 1:-1, 1:-1] ** 2).mean()) for field in (reported, untold)]
    assert rms[0] < 0.04 * np.sqrt((plain**2).mean()) and rms[0] < 0.4 * rms[1]


def test_what_the_field_says_of_the_skin_takes_the_parallax_out():
    """A map that is right for this dent, against the nominal camera's own view of it; its opposite makes it worse."""
    points, nominal = on_sphere(), nominal_mount(PARAMS)
    near = np.exp(-(((points - points[5]) / 25) ** 2).sum(axis=1))[:, None]
    moved = points + near * [0.8, 0.4, -3.0]
    count, kept = len(points), (np.ones(len(points)), np.zeros(len(points), bool), (640, 480))
    tracks = DotTracks(0.0, np.arange(count), TURNED.project(points), TURNED.project(moved), *kept)
    place = nominal.project(points)
    plain = ModelInput(SimpleNamespace(size=(640, 480), reference_px=place), SHAPE, PARAMS).field(
        DotTracks(0.0, np.arange(count), place, nominal.project(moved), *kept)
    )
    centre, flat = np.array([0, 0, PARAMS.centre_height_mm]), plain.channels.ravel().astype(float)
    raised = np.linalg.norm(moved - centre, axis=1) - np.linalg.norm(points - centre, axis=1)
    radial = np.outer(raised @ displacement_to_cells(place, (640, 480), SHAPE), flat) / (flat @ flat)

    def left(found):
        return np.sqrt(((view(points, found).field(tracks).channels - plain.channels)[:, 1:-1, 1:-1] ** 2).mean())

    assert left(radial) < 0.25 * left(None) and left(-radial) > 1.7 * left(None)


def test_lost_dots_are_filled_and_all_lost_is_invalid():
    points = on_sphere()
    count = len(points)
    lost = np.arange(count) % 7 == 0
    position = TURNED.project(points) + 3.0
    position[lost] = 1e4
    tracks = DotTracks(0.0, np.arange(count), TURNED.project(points), position, np.ones(count), lost, (640, 480))
    field = view(points).field(tracks)
    assert np.isfinite(field.channels).all() and np.abs(field.channels).max() < 4 and field.valid.mean() > 0.9
    none = DotTracks(0.0, np.arange(count), TURNED.project(points), position, np.ones(count), np.ones(count, bool),
                     (640, 480))  # fmt: skip
    assert not view(points).field(none).valid.any()


def test_paint_beside_its_place_moves_as_the_skin_does_there():
    """A smooth motion is the same field whether dots sit on their places or beside them."""
    rng = np.random.default_rng(0)
    plain = MarkerSensor(PARAMS, SHAPE, PLAIN, np.random.default_rng(1))
    beside = MarkerSensor(PARAMS, SHAPE, replace(PLAIN, paint_px=1.2), np.random.default_rng(1))
    moved = 2.0 * np.exp(-(((plain.rest_mm - plain.rest_mm[8]) / 30) ** 2).sum(axis=1))[:, None] * rng.normal(size=3)
    a, b = (sensor.fields(moved[None])[0] for sensor in (plain, beside))
    rms = np.sqrt(((a - b) ** 2).mean()) / np.sqrt((a**2).mean())
    assert rms < 0.02, rms


@pytest.mark.parametrize("name", ["camera", "paint_px", "unseen", "still_px", "share"])
def test_every_scatter_changes_the_field(name):
    moved = np.ones((1, len(dot_pattern(PARAMS)), 3))
    fields = [
        MarkerSensor(PARAMS, SHAPE, scatter, np.random.default_rng(2)).fields(moved)
        for scatter in (PLAIN, replace(PLAIN, **{name: 0.1}))
    ]
    assert not np.array_equal(*fields)
