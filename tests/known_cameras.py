"""Cameras of drawn pictures, looked for once by all processes of a test run.

The drawn dome is flat, so that other diameters are tried for every reference of it: over a second a picture.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import ModuleType
from unittest import mock

import numpy as np
from run_cache import shared

from cad.params import EndcapParams
from sensing.calibration import rest_camera as module
from sensing.calibration.rest_camera import RestCamera
from sensing.camera.mount import MountedCamera
from sensing.records import Frame


def rest_camera(
    reference: Frame, dots_px: np.ndarray, params: EndcapParams, given: MountedCamera | None = None
) -> RestCamera:
    """As :func:`sensing.calibration.rest_camera.rest_camera`; what it finds for a set of dots is kept."""
    if given is not None:
        return module.rest_camera(reference, dots_px, params, given)
    key = hashlib.sha256(repr(params).encode() + np.ascontiguousarray(dots_px).tobytes()).hexdigest()
    return shared(f"camera_{key[:16]}", lambda: module.rest_camera(reference, dots_px, params))


@contextmanager
def known_to(*modules: ModuleType) -> Iterator[None]:
    """Modules that look for cameras take them from here."""
    with ExitStack() as stack:
        for user in modules:
            stack.enter_context(mock.patch.object(user, "rest_camera", rest_camera))
        yield
