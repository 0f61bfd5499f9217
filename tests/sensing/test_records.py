import numpy as np
import pytest

from cad.errors import ParameterError
from sensing.records import DotTracks, Frame, ShearField, Wrench


def tracks(count: int = 3) -> DotTracks:
    place = np.arange(2.0 * count).reshape(count, 2)
    return DotTracks(
        0.0, np.arange(count), place, place + np.array([1.0, -2.0]), np.ones(count), np.zeros(count, bool), (640, 480)
    )


def test_frame_learns_its_size_from_the_image():
    assert Frame(0.0, 0, "x", image=np.zeros((480, 640, 3), np.uint8)).size == (640, 480)


def test_frame_without_content_is_refused():
    with pytest.raises(ParameterError, match="neither image nor jpeg"):
        Frame(0.0, 0, "camera 3")


def test_displacement_is_position_minus_reference():
    assert (tracks().displacement_px == [1.0, -2.0]).all()


def test_records_cannot_be_changed_but_the_callers_arrays_can():
    own = np.zeros((2, 3, 4), np.float32)
    field = ShearField(0.0, own)
    with pytest.raises(ValueError, match="read-only"):
        field.channels[0, 0, 0] = 1
    own[0, 0, 0] = 1
    assert field.valid.shape == (3, 4) and field.valid.all()


def test_wrong_shapes_are_named():
    with pytest.raises(ParameterError, match=r"quality has shape \(2,\), expected \(3,\)"):
        DotTracks(0.0, np.arange(3), np.zeros((3, 2)), np.zeros((3, 2)), np.ones(2), np.zeros(3, bool), (1, 1))
    with pytest.raises(ParameterError, match=r"force_n has shape \(2,\)"):
        Wrench(0.0, np.zeros(2), np.zeros(3))
    with pytest.raises(ParameterError, match="do not fit names"):
        ShearField(0.0, np.zeros((3, 2, 2), np.float32))


def test_unknown_channel_lists_the_known():
    with pytest.raises(ParameterError, match="'w' not in u, v"):
        ShearField(0.0, np.zeros((2, 2, 2), np.float32)).channel("w")
