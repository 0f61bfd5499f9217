"""Physics inverse, for comparison: the place and force whose compliance field fits the picture best.

A force at a place deforms the shell, to first order, in proportion: field = B(tilt, azimuth) (normal, meridian,
lateral). By the shell's symmetry B at any azimuth is B at azimuth 0 turned, so B is fitted once per tilt, to samples
of known place turned to azimuth 0 (the measured compliance of the sensor itself), and interpolated linearly between
tilts. The inverse solves a linear least-squares problem for every place on a grid and keeps the best. The torque is
that of the force at its place: a single contact on the undeformed sphere. Fields in pixels of the 200 x 200 crop;
N, N m, degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.learning.samples import Samples

Array = NDArray[np.float64]
DAMPING = 1e-3  # of the mean square of the columns: separates weak directions from noise
AZIMUTH_STEP_DEG = 5.0  # of the grid
BETWEEN_TILTS = 4  # grid steps between two fitted tilts


@dataclass(frozen=True)
class ComplianceInverse:
    """Places on a grid, each with its linear inverse.

    Attributes:
        basis: (K, 2 H W, 3) orthonormal columns that span the fields of each place.
        inverse: (K, 6, 2 H W) field to wrench about the sphere's centre.
    """

    basis: Array
    inverse: Array

    def predict(self, inputs: Array) -> Array:
        """(N, 6) wrenches about the sphere's centre, from (N, 2 H W) fields."""
        explained = np.einsum("nd,kdc->nkc", inputs, self.basis, optimize=True)
        best = (explained**2).sum(axis=2).argmax(axis=1)
        return np.stack([self.inverse[k] @ x for k, x in zip(best, inputs, strict=True)])


def fit_compliance(samples: Samples) -> ComplianceInverse:
    """Fit the inverse to samples of known contact place.

    Raises:
        ParameterError: samples without tilt, or without contact.
    """
    usable = samples.take(samples.contact & np.isfinite(samples.tilt_deg + samples.azimuth_deg))
    if not len(usable):
        raise ParameterError(
            f"{samples.where}: no sample with contact and a known place: the physics inverse is fitted to those",
            name="samples",
        )
    tilts = np.unique(usable.tilt_deg.round(1))
    fields = np.stack([_basis_at_tilt(usable.take(usable.tilt_deg.round(1) == tilt)) for tilt in tilts])
    return _on_grid(tilts, fields, samples.design)


def turned_field(field: Array, angle_deg: float) -> Array:
    """(2, H, W) field of a contact turned about the axis by an angle (from x to y), bilinear interpolation."""
    height, width = field.shape[1:]
    centre = ((width - 1) / 2, (height - 1) / 2)
    matrix = cv2.getRotationMatrix2D(centre, -angle_deg, 1.0)  # OpenCV's angle has the opposite sign: y is down
    moved = [cv2.warpAffine(channel, matrix, (width, height), flags=cv2.INTER_LINEAR) for channel in field]
    cos, sin = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.stack([cos * moved[0] - sin * moved[1], sin * moved[0] + cos * moved[1]])


def contact_axes(tilt_deg: float, azimuth_deg: float) -> Array:
    """(3, 3) columns outward, meridian (away from the tip), lateral, in the endcap's axes."""
    t, a = np.radians(tilt_deg), np.radians(azimuth_deg)
    outward = [np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)]
    meridian = [np.cos(t) * np.cos(a), np.cos(t) * np.sin(a), -np.sin(t)]
    return np.array([outward, meridian, [-np.sin(a), np.cos(a), 0.0]]).T


def _basis_at_tilt(samples: Samples) -> Array:
    """(2, H, W, 3) field of a unit push inward, along the meridian and across, at azimuth 0."""
    gram, moment = np.zeros((3, 3)), np.zeros((3, samples.fields[0].size))
    for k in range(len(samples)):
        axes = contact_axes(float(samples.tilt_deg[k]), float(samples.azimuth_deg[k]))
        local = samples.wrenches[k, :3] @ axes * [-1, 1, 1]
        field = turned_field(samples.fields[k].astype(float), -float(samples.azimuth_deg[k])).ravel()
        gram += np.outer(local, local)
        moment += np.outer(local, field)
    damped = gram + 1e-9 * max(float(np.trace(gram)), 1e-30) * np.eye(3)
    solved = np.linalg.solve(damped, moment).astype(np.float64)
    return np.moveaxis(solved.reshape(3, *samples.fields.shape[1:]), 0, -1)


def _on_grid(tilts: Array, fields: Array, design: EndcapParams) -> ComplianceInverse:
    basis, inverse = [], []
    fine = np.interp(np.arange((len(tilts) - 1) * BETWEEN_TILTS + 1) / BETWEEN_TILTS, np.arange(len(tilts)), tilts)
    lever_m = design.outer_radius_mm / 1000
    for place, tilt in enumerate(fine):
        low, part = divmod(place, BETWEEN_TILTS)
        high = min(low + 1, len(tilts) - 1)
        at_zero = fields[low] + part / BETWEEN_TILTS * (fields[high] - fields[low])
        for azimuth in np.arange(0.0, 360.0, AZIMUTH_STEP_DEG):
            B = np.stack([turned_field(at_zero[..., c], azimuth).ravel() for c in range(3)], axis=1)
            axes = contact_axes(float(tilt), float(azimuth))
            damping = DAMPING * float((B**2).sum()) / 3
            local = np.linalg.solve(B.T @ B + (damping + 1e-30) * np.eye(3), B.T)
            force = axes @ (np.array([-1.0, 1.0, 1.0])[:, None] * local)
            torque = np.cross(lever_m * axes[:, 0], force, axisa=0, axisb=0, axisc=0)
            basis.append(np.linalg.qr(B)[0])
            inverse.append(np.concatenate([force, torque]))
    return ComplianceInverse(np.array(basis), np.array(inverse))
