"""Displacement of a dot as a camera sees it: the mean motion of its outline in the picture.

A tracked window follows the outline in the picture. The mean of the outline's image is not the image of its mean: a
fisheye lens distorts, and a ring that comes nearer or tilts changes shape. This changes fields by 0.1 % at 10 to 40 N.
"""

from __future__ import annotations

import numpy as np

from sensing.camera.mount import MountedCamera
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.surface import OUTLINE_POINTS, dot_directions, outline_directions


def shown_mm(geometry: ShellGeometry, moved_mm: Array, camera: MountedCamera) -> Array:
    """(m, 3) displacement of each dot that the camera would see as it sees the outline's mean; mm, endcap frame.

    Its distance from the pupil is that of the dot with the outline's mean displacement. Where the camera does not see
    the dot and all of its outline, the result is that mean itself.

    Args:
        geometry: geometry of the shell, with its m dots.
        camera: camera and its mounting.
        moved_mm: (m * OUTLINE_POINTS, 3) displacement of :func:`sensing.simulator.solid.surface.outline_directions`.
    """
    centre, radius = np.array(geometry.centre_mm), geometry.inner_radius_mm
    dots, outlines = centre + radius * dot_directions(geometry), centre + radius * outline_directions(geometry)
    seen_to_move = camera.project(outlines + moved_mm) - camera.project(outlines)
    pixels = camera.project(dots) + seen_to_move.reshape(-1, OUTLINE_POINTS, 2).mean(axis=1)
    shown = moved_mm.reshape(-1, OUTLINE_POINTS, 3).mean(axis=1)
    seen, pupil = np.isfinite(pixels).all(axis=1), camera.pupil_endcap_mm
    distance = np.linalg.norm((dots + shown - pupil)[seen], axis=1, keepdims=True)
    shown[seen] = pupil + distance * camera.rays_endcap(pixels[seen]) - dots[seen]
    return np.asarray(shown)
