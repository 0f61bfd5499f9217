"""The skin's own weight, where an endcap is turned after zeroing: found in the motion of its dots, and taken out of it.

A turned skin sags otherwise, so all dots move although nothing touches: at D=130 T=8 on its side by 0.9 px, which reads
as 2.4 N. In linear elasticity the motion is d = A c with c = (gravity now - gravity at the reference) / 9.81 m/s^2, in
the endcap frame. The shell has an axis, so five profiles over the polar angle p give A; at azimuth a, a load along x
moves the skin by

    (cos(a) f1(p), cos(a) f2(p), -sin(a) f3(p))      outward, along p, along a

and one along the axis by (f4(p), f5(p), 0). own_weight.csv has them in units of rho g R^2 / mu, for shells over the
whole valid region and from the tip to the clamp (``python -m sensing.simulator.solid.own_weight_table`` solves them).

No pose is asked for: c is fitted to the dots themselves, three numbers to some two hundred. The fit leaves almost
nothing of a sag and at least a quarter of a touch's motion (bench/own_weight_leaves.csv), so c is set anew only where
it leaves less than a fifth. While something touches, the last c counts; so it does while most dots are hidden, because
the few beside a touch may move as a sag moves them.
"""

from __future__ import annotations

import csv
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cad import scaling
from cad.materials import Silicone
from cad.params import EndcapParams
from sensing.records import TABLE_G_M_S2, DotTracks
from sensing.tracking.model_input import ModelInput
from sensing.tracking.motion_kernels import fitted_change

Array = NDArray[np.float64]
TABLE = Path(__file__).with_name("own_weight.csv")
PROFILES = ("side_outward", "side_polar", "side_azimuth", "axis_outward", "axis_polar")
KG_PER_MM3 = 1e-6  # of 1 g/cm3
WALL_SCALE = 0.3  # M: of log T / R against clamp / R; where a shell is left out, its shape is met to 0.1 to 2.5 %
NEWS_PX = 0.25  # at 480: motion from which c is looked for anew; five times what the picture's noise leaves
LEAVES = 0.2  # of that motion, left by the fit at most: between 0.04 of a sag and 0.22 of two presses at once
MOST_G = 4.0  # turned over is 2; a silicone half as stiff as its table says doubles that
LEAST_DOTS = 12  # followed dots that are needed to estimate c
STEP_MM = 0.05  # largest displacement in the numerical derivative of the picture by c


class OwnWeight:
    """Watches the dots of one endcap against one reference.

    Args:
        seen: gives the dots' motion in the nominal camera's view.
        params: design.
        silicone: of the skin.

    Attributes:
        change_g: (3,) gravity in the skin's pose less that at the reference, as the dots have it, in units of 9.81
            m/s^2 and as far as the silicone is as stiff as its table says; zero until a turn is seen.
        left_px: third largest of what the fit leaves of the last motions; NaN where too few dots are seen.
        explains: whether that is as little of them as a sag leaves.
    """

    def __init__(self, seen: ModelInput, params: EndcapParams, silicone: Silicone) -> None:
        self._seen, self._scale = seen, min(seen.tracker.size) / 480.0
        self._modes = own_weight_motion(seen, params, silicone)
        self.change_g: Array = np.zeros(3)
        self.left_px, self.explains = float("nan"), False

    def motion(self, tracks: DotTracks) -> Array | None:
        """(n, 2) what own weight moves the known dots by, px of the nominal view; None before a turn is seen."""
        moved, live = self._seen_motion(tracks)
        self.left_px, self.explains = float("nan"), False
        if tracks.enough and np.count_nonzero(live) >= LEAST_DOTS:
            self._look(moved, live)
        return self._modes @ self.change_g if self.change_g.any() else None

    def left_of(self, tracks: DotTracks) -> float:
        """Third largest, px, of what own weight leaves of the motions; NaN where too few dots are seen."""
        moved, live = self._seen_motion(tracks)
        if np.count_nonzero(live) < LEAST_DOTS:
            return float("nan")
        return float(fitted_change(moved, self._modes, live, self.change_g)[1])

    def _seen_motion(self, tracks: DotTracks) -> tuple[Array, NDArray[np.bool_]]:
        """(n, 2) motion of the known dots in the nominal view, px, and (n,) which of them are seen."""
        moved = self._seen.motion(tracks)
        return moved, ~tracks.lost[self._seen.known] & np.isfinite(moved).all(axis=1)

    def _look(self, moved: Array, live: NDArray[np.bool_]) -> None:
        """Sets the change anew where the motions (n, 2) of the live dots show one."""
        change, left, news, most = fitted_change(moved, self._modes, live, self.change_g)
        if news >= NEWS_PX * self._scale and left <= LEAVES * news and float(change @ change) <= MOST_G**2:
            self.change_g = change
        self.left_px, self.explains = left, most >= NEWS_PX * self._scale and left <= LEAVES * most


def own_weight_motion(seen: ModelInput, params: EndcapParams, silicone: Silicone) -> Array:
    """(n, 2, 3) motion of the known dots in the nominal view, px by 1 g along x, y, z of the endcap frame.

    Args:
        seen: whose dots.
        params: design.
        silicone: of the skin.
    """
    points = seen.points_mm
    moved = own_weight_displacement(points - [0.0, 0.0, params.centre_height_mm], params, silicone)
    slopes = []
    for axis in range(3):
        by_g = moved[:, :, axis]
        step_g = STEP_MM / np.abs(by_g).max()
        ahead, behind = (seen.nominal.project(points + sign * step_g * by_g) for sign in (1, -1))
        slopes.append((ahead - behind) / (2 * step_g))
    return np.stack(slopes, axis=2)


def own_weight_displacement(arm_mm: Array, params: EndcapParams, silicone: Silicone) -> Array:
    """(n, 3, 3) displacement, mm, of points of the inner surface by 1 g along x, y, z.

    Args:
        arm_mm: (n, 3) from the sphere's centre.
        params: design.
        silicone: of the skin.
    """
    radius_mm = params.outer_radius_mm
    ratios = (params.wall_mm / radius_mm, (params.centre_height_mm - scaling.FLANGE_THICKNESS_MM) / radius_mm)
    unit_mm = silicone.density_g_cm3 * KG_PER_MM3 * TABLE_G_M_S2 * radius_mm**2 / silicone.neo_hooke().shear_mpa
    out = arm_mm / np.linalg.norm(arm_mm, axis=1, keepdims=True)
    polar, azimuth = np.arccos(np.clip(out[:, 2], -1, 1)), np.arctan2(out[:, 1], out[:, 0])
    share = polar / (np.pi / 2 + np.arcsin(ratios[1] / (1.0 - ratios[0])))  # 1 where the inner surface meets the clamp
    shares, profiles = _profiles(*ratios)
    f = [unit_mm * np.interp(share, shares, profile) for profile in profiles.T]
    cos_p, sin_p, cos_a, sin_a = np.cos(polar), np.sin(polar), np.cos(azimuth), np.sin(azimuth)
    along_polar = np.stack([cos_p * cos_a, cos_p * sin_a, -sin_p], axis=1)
    along_azimuth = np.stack([-sin_a, cos_a, np.zeros_like(azimuth)], axis=1)
    parts = [
        (c * f[0])[:, None] * out + (c * f[1])[:, None] * along_polar - (s * f[2])[:, None] * along_azimuth
        for c, s in ((cos_a, sin_a), (sin_a, -cos_a))
    ]
    parts.append(f[3][:, None] * out + f[4][:, None] * along_polar)
    return np.stack(parts, axis=2)


@lru_cache(maxsize=32)
def _profiles(wall: float, clamp: float) -> tuple[Array, Array]:
    """(P,) polar angles over that of the clamp, and (P, 5) the profiles there, of a shell of these ratios to R.

    Between the table's shells each value is interpolated by a polyharmonic spline r^3 with a linear part (Duchon 1977).
    """
    ratios, shares, values = _table()
    places, wanted = _place(ratios), _place(np.array([[wall, clamp]]))
    linear, here = np.c_[np.ones(len(places)), places], np.r_[1.0, wanted[0]]
    cubes = np.linalg.norm(places[:, None] - places, axis=2) ** 3
    matrix = np.block([[cubes, linear], [linear.T, np.zeros((3, 3))]])
    weights = np.linalg.solve(matrix, np.r_[np.linalg.norm(wanted - places, axis=1) ** 3, here])[: len(places)]
    return shares, np.tensordot(weights, values, axes=1)


def _place(ratios: Array) -> Array:
    return np.stack([WALL_SCALE * np.log(ratios[:, 0]), ratios[:, 1]], axis=1)


@lru_cache(maxsize=1)
def _table() -> tuple[Array, Array, Array]:
    """(K, 2) wall and clamp over R, (P,) polar angles over that of the clamp, (K, P, 5) profiles."""
    with TABLE.open(newline="") as file:
        rows = list(csv.DictReader(file))
    ratios = np.unique([(float(row["wall"]), float(row["clamp"])) for row in rows], axis=0)
    shares = np.unique([float(row["polar_share"]) for row in rows])
    order = sorted(rows, key=lambda row: (float(row["wall"]), float(row["clamp"]), float(row["polar_share"])))
    values = np.array([[float(row[name]) for name in PROFILES] for row in order])
    return ratios, shares, values.reshape(len(ratios), len(shares), len(PROFILES))
