"""Errors of centre and normal against a plane whose place is known, at a tilt."""

from types import SimpleNamespace

import numpy as np
import pytest

from cad.params import EndcapParams
from sensing.camera.mount import rotation_matrix
from sensing.evaluation.place_errors import place_errors
from sensing.frames import T_sphere_endcap, inverse, wrench_in
from sensing.records import Wrench

PARAMS = EndcapParams(150, 9)
CENTRE = np.array([0.0, 0.0, PARAMS.centre_height_mm])
HEIGHT_MM = 70.0  # of the sphere's centre over the plane: pressed by 5 mm


def turned(vector: np.ndarray, degrees: float) -> np.ndarray:
    """A vector, turned about an axis across it."""
    axis = np.cross(vector, [0.3, 1.0, 0.2])
    return rotation_matrix(np.radians(degrees) * axis / np.linalg.norm(axis)) @ vector


@pytest.fixture
def pressed():
    """(frame with a push straight into a leaning endcap, outward normal, endcap frame)."""
    pose = np.eye(4)
    pose[:3, :3] = rotation_matrix([np.pi - 0.4, 0.2, 0.1])
    outward = -pose[2, :3]
    pose[2, 3] = HEIGHT_MM - pose[2, :3] @ CENTRE
    push = wrench_in(Wrench(0.0, -20.0 * outward, np.zeros(3), "sphere"), inverse(T_sphere_endcap(PARAMS)), "endcap")
    return SimpleNamespace(labels={"T_world_endcap": pose}, contact=True, wrench=push), outward


def law(position_mm, normal):
    """A law that answers so, whatever the wrench."""
    found = SimpleNamespace(position_mm=position_mm, normal=normal, position_sd_mm=1.0, normal_sd_deg=0.5)
    return SimpleNamespace(of=lambda wrench: found)


def test_centre_and_normal_are_off_by_the_angles_by_which_they_were_turned(pressed):
    item, outward = pressed
    answer = law(CENTRE + HEIGHT_MM * turned(outward, 5.0), turned(outward, 3.0))
    wanted = [5.0, 3.0, np.degrees(1.0 / HEIGHT_MM), 0.5]
    assert place_errors(item, item.wrench, answer, PARAMS) == pytest.approx(wanted)


def test_without_a_plane_or_a_push_nothing_is_known(pressed):
    item, outward = pressed
    answer = law(CENTRE + HEIGHT_MM * outward, outward)
    pulled = SimpleNamespace(**{**vars(item), "wrench": Wrench(0.0, 20.0 * outward, np.zeros(3), "sphere")})
    untouched = SimpleNamespace(**{**vars(item), "contact": False})
    for frame, with_law in ((item, None), (pulled, answer), (untouched, answer)):
        assert np.isnan(place_errors(frame, item.wrench, with_law, PARAMS)).all()
