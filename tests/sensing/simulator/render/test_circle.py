"""The drawn picture ends where the row of the camera module says that its image circle does."""

from __future__ import annotations

import numpy as np
import pytest

from cad.lens import VARIABLE, camera_modules
from sensing.camera.nominal import nominal_lens
from sensing.simulator.render.sensor import lens_transmission, pixel_angles
from sensing.simulator.render.settings import Optics


@pytest.mark.parametrize("module", camera_modules())
def test_the_picture_ends_with_the_circle_of_the_module(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the 170 degree lens was drawn to 88 degrees, the end of its model, and not to 85."""
    monkeypatch.setenv(VARIABLE, module)
    lens = nominal_lens()
    angle = np.degrees(np.nan_to_num(pixel_angles(lens), nan=180.0))
    lit = lens_transmission(lens, Optics()) > 0
    assert angle[lit].max() == pytest.approx(camera_modules()[module].circle_deg, abs=0.3)
