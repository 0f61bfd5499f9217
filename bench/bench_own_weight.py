"""What an endcap reads of its own skin's weight when it is turned after zeroing: ``python bench/bench_own_weight.py``.

Three tables beside this file, from linear elasticity (sags) and the library of solved presses:

own_weight.csv          of each endcap: the skin's weight, and how far a turn moves the dots in the picture; of the one
                        whose weights ship also what ``sensing.live`` reads of rendered pictures, turned and untouched,
                        with own weight kept in the reading and subtracted from it
own_weight_presses.csv  the same endcap pressed along paths of the library, turned before or not: error of the force
own_weight_leaves.csv   share of a motion that the fit of own weight leaves: of presses, of two at once, of a camera
                        that moved, and of sags
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.calibration.dots import pattern_points
from sensing.camera.mount import rotation_matrix
from sensing.camera.nominal import nominal_mount
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import OWN_WEIGHT, EndcapConfig
from sensing.live.core.reading import EndcapReading
from sensing.live.core.warm_up import warm_up
from sensing.live.endcap import Endcap
from sensing.live.open_endcaps import open_endcaps
from sensing.records import TABLE_G_M_S2 as G
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.similarity.library import ShellStates, load_library
from sensing.simulator.similarity.paths import library_paths, touching_steps
from sensing.simulator.similarity.ratios import ShellRatios, common_order, wrench_units
from sensing.simulator.similarity.surface_modes import modes_at
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.own_weight import nodal_mass_kg, own_weight_displacement
from sensing.simulator.solid.shell import ShellModel, shell_model
from sensing.simulator.solid.surface import dot_directions, inner_surface, surface_sampler
from sensing.tracking import own_weight as estimate
from sensing.tracking.camera_motions import CameraMotions, third_largest

HERE = Path(__file__).parent
POSES = {
    "tip up": (0.0, 0.0, -G), "sideways": (G, 0.0, 0.0), "sideways along y": (0.0, -G, 0.0), "tip down": (0.0, 0.0, G),
}  # fmt: skip
ENDCAPS = (
    (130.0, 8.0, "Smooth-Sil 950"), (130.0, 8.0, "Dragon Skin 30"), (99.0, 6.5, "Smooth-Sil 950"),
    (180.0, 10.0, "Smooth-Sil 950"), (250.0, 12.0, "Smooth-Sil 950"),
)  # fmt: skip
SHIPPED = ENDCAPS[0]
REST, TURNED, STEP_FRAMES, RATE_HZ = 12, 12, 4, 30.0
APPROACH = (0.15, 0.3, 0.5, 0.75)  # of a path's first state
PATHS = (1, 5, 8, 12, 16, 19)  # of the library's: one at each tilt
NOISE = 1.5  # gray values
MOST_N = 36.0  # largest press of the training data
PIVOTS_MM, TURN_RAD = (-40, -20, -10, -5, 0, 5, 10, 20, 40, 80), 0.003
AZIMUTHS_DEG = (0.0, 37.0, 90.0)


def main() -> int:
    """Writes the tables and prints them."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    model = _model(SHIPPED)
    sags = {pose: own_weight_displacement(model, silicone(SHIPPED[2]).density_g_cm3, g) for pose, g in POSES.items()}
    _write("own_weight.csv", _turns(model, sags))
    _write("own_weight_presses.csv", _presses(model, sags))
    _write("own_weight_leaves.csv", _leaves())
    return 0


def _write(name: str, rows: Iterator[dict[str, Any]]) -> None:
    made = []
    for row in rows:
        made.append(row)
        print(row, flush=True)
    write_table(HERE / name, made)


def _model(endcap: tuple[float, float, str]) -> ShellModel:
    return shell_model(shell_geometry(*endcap[:2]), silicone(endcap[2]).neo_hooke(), "data")


def _turns(shipped: ShellModel, sags: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Of each endcap and turn: weight, motion of the dots; of the one whose weights ship, what live reads."""
    for endcap in ENDCAPS:
        model, density = _model(endcap), silicone(endcap[2]).density_g_cm3
        own = {pose: own_weight_displacement(model, density, g) for pose, g in POSES.items()}
        for before, after in (("tip up", pose) for pose in POSES if pose != "tip up"):
            row = _moved(model, endcap, own[after] - own[before]) | {"zeroed": before, "turned": after}
            if endcap != SHIPPED:
                yield row
                continue
            films = [(sags[before], REST), (sags[after], TURNED)]
            for choice in reversed(OWN_WEIGHT):
                yield row | {"own_weight": choice} | _words(readings_of(shipped, films, choice)[-1])


def _moved(model: ShellModel, endcap: tuple[float, float, str], moved: Any) -> dict[str, Any]:
    """Weight, and the largest motion of a dot in mm and px."""
    diameter, wall, name = endcap
    params, density = EndcapParams(diameter, wall), silicone(name).density_g_cm3
    camera, points = nominal_mount(params), pattern_points(params)[0]
    dots = surface_sampler(model, dot_directions(model.geometry)).sample(moved)
    seen = camera.sees(points)
    pixels = np.linalg.norm(camera.project(points + dots) - camera.project(points), axis=1)[seen].max()
    return {
        "diameter_mm": diameter, "wall_mm": wall, "silicone": name,
        "weight_n": round(float(nodal_mass_kg(model, density).sum()) * G, 2),
        "dot_mm": round(float(np.linalg.norm(dots[seen], axis=1).max()), 3), "dot_px": round(float(pixels), 2),
    }  # fmt: skip


def _words(last: EndcapReading) -> dict[str, Any]:
    force, deviation = last.wrench.force_n, np.sqrt(np.diag(last.wrench.covariance)[:3])
    read = {f"{axis}_n": round(float(value), 2) for axis, value in zip(("fx", "fy", "fz"), force, strict=True)}
    stated = {f"sd_{axis}_n": round(float(value), 2) for axis, value in zip("xyz", deviation, strict=True)}
    flags = "+".join(sorted(last.wrench.flags)) or "none"
    return read | stated | {"contact": last.contact.touching, "flags": flags}


def readings_of(model: ShellModel, films: Sequence[tuple[Any, int]], own_weight: str) -> list[EndcapReading]:
    """What live reads of the skin in these states, each for so many frames, the first of them its reference."""
    params, surface, rng = EndcapParams(*SHIPPED[:2]), inner_surface(model), np.random.default_rng(41)
    renderer = DomeRenderer(params, nominal_mount(params), None, surface.position, surface.interpolation)
    with tempfile.TemporaryDirectory() as folder:
        number = 0
        for moved, count in films:
            field = moved if len(moved) == len(surface.position) else surface.field(moved)
            picture = renderer.render(field).image_bgr.astype(float)
            for _ in range(count):
                noisy = np.clip(np.rint(picture + rng.normal(0, NOISE, picture.shape)), 0, 255).astype(np.uint8)
                cv2.imwrite(f"{folder}/{number:03d}.png", noisy)
                number += 1
        config = EndcapConfig("endcap_0", folder, None, *SHIPPED[:2], rate_hz=RATE_HZ, own_weight=own_weight)
        endcap = Endcap(open_endcaps(LiveConfig((config,)))[0])
        warm_up(lambda _: None)
        with endcap as running:
            return list(running.readings())


def _presses(model: ShellModel, sags: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Paths of the library, after a turn and without: error of the force with own weight kept and subtracted."""
    geometry, law, surface = model.geometry, silicone(SHIPPED[2]).neo_hooke(), inner_surface(model)
    states = load_library().states(ShellRatios.of(geometry))
    units, order = wrench_units(geometry.outer_radius_mm, law.shear_mpa), common_order(geometry, surface.position)
    rest = {pose: surface.field(sags[pose]) for pose in ("tip up", "sideways")}
    for path in PATHS:
        rows = _rows(path, states, units)
        moved = np.empty_like(states.surface[rows])
        moved[:, order] = states.surface[rows] * geometry.outer_radius_mm
        truth = states.wrench[rows, :3] * units[:3]
        for pose, after in rest.items():
            films = [(rest["tip up"], REST), (after, TURNED)]
            films += [(after + share * moved[0], STEP_FRAMES) for share in APPROACH]
            films += [(after + field, STEP_FRAMES) for field in moved]
            yield {"path": path, "pose": pose, "states": len(moved)} | _errors(
                {choice: readings_of(model, films, choice) for choice in OWN_WEIGHT}, truth
            )


def _errors(readings: dict[str, list[EndcapReading]], truth: Any) -> dict[str, Any]:
    """Of single frames at the end of each state; how far apart both choices are at most, over all frames."""
    forces = {choice: np.array([each.estimate.force_n for each in read]) for choice, read in readings.items()}
    row: dict[str, Any] = {"most_n": round(float(np.linalg.norm(truth, axis=1).max()), 1)}
    for choice, force in forces.items():
        error = np.linalg.norm(force[-1 - STEP_FRAMES * np.arange(len(truth))[::-1]] - truth, axis=1)
        row |= {f"{choice}_n": round(float(error.mean()), 2), f"{choice}_worst_n": round(float(error.max()), 2)}
    subtracted, kept = forces.values()
    return row | {"apart_n": round(float(np.abs(subtracted - kept).max()), 3)}


def _rows(path: int, states: ShellStates, units: Any) -> list[int]:
    """Rows of a path that are solved and no harder than what was trained."""
    first = 0
    for each in library_paths():
        count = len(touching_steps(each))
        if each.number == path:
            rows = range(first, first + count)
            forces = np.linalg.norm(states.wrench[:, :3] * units[:3], axis=1)
            return [row for row in rows if states.known[row] and forces[row] <= MOST_N]
        first += count
    raise ValueError(path)


def _leaves() -> Iterator[dict[str, Any]]:
    """What the fit leaves of the motion of every state of the library, of two at once, of a camera and of sags."""
    rng = np.random.default_rng(43)
    for endcap in ENDCAPS:
        view = View(EndcapParams(*endcap[:2]), endcap[2])
        every = view.presses()
        pairs = every[rng.integers(len(every), size=1000)] + every[rng.integers(len(every), size=1000)]
        for what, motions in (
            ("press", map(view.pixels, every)), ("two presses", map(view.pixels, pairs)),
            ("picture", (view.similarity(rng) for _ in range(300))),
            ("camera, pivoting", view.pivots()),
            ("camera, any mix", view.camera(rng, 1500)),
            ("own weight", map(view.pixels, view.sags([rng.normal(size=3) for _ in range(5)]))),
        ):  # fmt: skip
            left = np.array([_left(motion, view.modes) for motion in motions])
            yield dict(zip(("diameter_mm", "wall_mm", "silicone"), endcap, strict=True)) | {
                "motion": what, "count": len(left), "least": round(float(left.min()), 3),
                "median": round(float(np.median(left)), 3), "most": round(float(left.max()), 3),
            }  # fmt: skip


class View:
    """The dots of an endcap that its camera sees, and how skin that moves there looks.

    Args:
        params: design. silicone_name: of the skin.

    Attributes:
        modes: (n, 2, 3) px by 1 g, of the estimate. points_mm: (n, 3) dots in the endcap frame. rest_px: (n, 2).
    """

    def __init__(self, params: EndcapParams, silicone_name: str) -> None:
        self._camera, self._material, points = nominal_mount(params), silicone(silicone_name), pattern_points(params)[0]
        self._params = params
        self._geometry, seen = shell_geometry(params.diameter_mm, params.wall_mm), self._camera.sees(points)
        self.points_mm, self._directions = points[seen], dot_directions(self._geometry)[seen]
        self.rest_px = self._camera.project(self.points_mm)
        arm = self.points_mm - [0, 0, params.centre_height_mm]
        per_g = estimate.own_weight_displacement(arm, params, self._material)
        self.modes = np.stack([self.pixels(0.1 * per_g[:, :, axis]) / 0.1 for axis in range(3)], axis=2)

    def pixels(self, moved_mm: Any) -> Any:
        """(n, 2) motion of the dots in the picture."""
        return self._camera.project(self.points_mm + moved_mm) - self.rest_px

    def presses(self) -> Any:
        """(S, n, 3) displacement of the dots in every state of the library up to the training's largest force."""
        library, ratios, radius_mm = load_library(), ShellRatios.of(self._geometry), self._geometry.outer_radius_mm
        weights, known = library.state_weights(library.travel, ratios)
        forces = np.linalg.norm(library.states(ratios).wrench[:, :3], axis=1)
        used = known & (forces * wrench_units(radius_mm, self._material.neo_hooke().shear_mpa)[0] <= MOST_N)
        shares = library.travel.mixed(weights, "coefficients")[used]
        at = [modes_at(library, self._geometry, self._directions, azimuth) for azimuth in AZIMUTHS_DEG]
        return radius_mm * np.concatenate([np.einsum("sm,mni->sni", shares, modes) for modes in at])

    def sags(self, gravities_g: Sequence[Any]) -> list[Any]:
        """(n, 3) displacement of the dots by gravities, of the shell's own solution."""
        model = shell_model(self._geometry, self._material.neo_hooke(), "data")
        sampler = surface_sampler(model, self._directions)
        density = self._material.density_g_cm3
        return [sampler.sample(own_weight_displacement(model, density, G * gravity)) for gravity in gravities_g]

    def camera(self, rng: np.random.Generator, count: int) -> list[Any]:
        """(n, 2) motions of all dots by turns and shifts of the camera and a zoom, mixed at random."""
        by_motion = CameraMotions.of(self.rest_px, (640, 480), self._params).by_motion
        found = []
        for _ in range(count):
            share = rng.normal(size=7)
            share[rng.permutation(7)[rng.integers(1, 8) :]] = 0.0  # one to seven of the motions
            found.append(by_motion @ share)
        return found

    def pivots(self) -> list[Any]:
        """(n, 2) motions of all dots by small turns of the camera about points from above to far below its pupil."""
        pupil = np.array(self._camera.pupil_endcap_mm)
        found = []
        for below_mm in PIVOTS_MM:
            for azimuth in range(0, 180, 30):
                axis = np.array([np.cos(np.radians(azimuth)), np.sin(np.radians(azimuth)), 0.0])
                turn = rotation_matrix(TURN_RAD * axis)
                place = pupil - [0.0, 0.0, below_mm]
                found.append(self._camera.project((self.points_mm - place) @ turn + place) - self.rest_px)
        return found

    def similarity(self, rng: np.random.Generator) -> Any:
        """(n, 2) motion of all dots by a shift, a turn and a zoom of the camera, about a pixel of each."""
        arm = self.rest_px - self.rest_px.mean(axis=0)
        shift, (turn, zoom) = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2) / 240
        return shift + zoom * arm + turn * np.stack([-arm[:, 1], arm[:, 0]], axis=1)


def _left(motion: Any, modes: Any) -> float:
    change = np.linalg.lstsq(modes.reshape(-1, 3), motion.ravel(), rcond=None)[0]
    return third_largest(motion - modes @ change) / third_largest(motion)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
