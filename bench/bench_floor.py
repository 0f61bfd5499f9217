"""The least error of the wrench that the dots allow (Cramer-Rao), beside what the live pipeline has on the same frames.

    W="python -m sensing.simulator data --protocol wide --azimuths 1"
    $W --seed 901 --frames 470 --out exports/floor_frames                  # judged
    for k in 1101 1102; do $W --seed $k --frames 1438 --render off --workers 2 --out exports/floor_states$k; done
    python bench/bench_floor.py exports/floor_frames --states exports/floor_states* --every 3

Around each judged frame a quadratic is fitted to the solved states near it in tilt and forces: its slopes say how the
dots move with the plane, and what it leaves is the loading history, which no single picture shows. The tracker's error
is measured on the judged frames against the true dots (bench/tracker_noise.py). Bounds of a frame: with the history
known, with it unknown, and with what ``sensing.calibrate`` leaves of the camera. Writes bench/floor.csv and .png. N,
N m about the sphere's centre.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.floor_plot import plot
from bench.one_line import in_one_line
from bench.table_file import write_table
from bench.tracker_noise import Noise, measured_noise
from cad.dots import dot_pattern, dot_position_mm
from cad.materials import silicone
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.camera.parameters import camera_at, camera_vector
from sensing.design.bound import BORDER_PX, SIZE_PX, quadratic_terms, smallest_covariance
from sensing.evaluation.cells import LOADS_N, TILTS_DEG
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.frames import T_sphere_endcap, wrench_adjoint
from sensing.learning.found_camera import camera_of_set
from sensing.learning.scores import AXES
from sensing.live.core.model import load_model
from sensing.records_labelled import LabelledSet, read_shard
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.shell_halves import ShellHalves
from sensing.simulator.solid.surface import turn_wrench
from sensing.wrench.camera_spread import independent_deviations

Array = np.ndarray
HERE = Path(__file__).parent
NEAR_TILT_DEG, NEAR_SHARE, NEAR_N = 6.0, 0.3, 1.5  # E: widths of the fit: degrees, and part of the load plus N
LEAST_WEIGHT = 0.02  # states with less do not count
HISTORIES = 25  # principal directions of what the fit leaves
TURN_DEG = 1.0  # for the slope by azimuth
VARIANTS = ("known", "unknown", "camera")


@dataclass(frozen=True)
class States:
    """Solved states, contact at azimuth 0.

    Attributes:
        place: (s, 4) tilt in degrees, normal force and tangential forces away from the tip and across, N.
        wrench: (s, 6) about the sphere's centre, N and N m. surface_mm: (s, k, 3) displacement of the inner surface.
    """

    place: Array
    wrench: Array
    surface_mm: Array


def main() -> int:
    """Measure, bound, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("frames", type=Path, help="rendered frames that are judged")
    parser.add_argument("--states", type=Path, nargs="+", required=True, help="sets written with --render off")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="judge every Nth frame in contact (1)")
    parser.add_argument("--weights", type=Path, help="of the model (those that ship)")
    parser.add_argument("--noise-of", type=Path, metavar="SET", help="set that the noise is measured on (the judged)")
    parser.add_argument("--out", type=Path, default=HERE / "floor.csv")
    options = parser.parse_args()
    data = LabelledSet(options.frames)
    noise = measured_noise(LabelledSet(options.noise_of) if options.noise_of else data)
    print("tracker:", *(f"{name}={value:.4g}" for name, value in vars(noise).items()), flush=True)
    camera = camera_of_set(data)
    answers = answered(data, camera, options.weights)
    used, bounds = frame_bounds(data, load_states(options.states), noise, camera, options.every)
    rows = table(answers.take(used), bounds)
    write_table(options.out, rows, figures=4)
    for row in rows:
        if row["axis"] in ("fz_n", "fx_n"):
            print(*(f"{v:.3g}" if isinstance(v, float) else v for v in row.values()))
    plot(rows, options.out.with_suffix(".png"))
    return 0


def load_states(folders: Sequence[Path]) -> States:
    """All states in contact of sets without pictures, each once."""
    parts = []
    for folder in folders:
        data = LabelledSet(folder)
        to_sphere = wrench_adjoint(T_sphere_endcap(data.params))
        for file in data.shards:
            shard = read_shard(file)
            first = np.array([shard["azimuth_deg"][shard["path"] == path][0] for path in shard["path"]])
            for row in np.flatnonzero(shard["contact"] & (shard["azimuth_deg"] == first)):
                wrench = to_sphere @ np.concatenate([shard["force_n"][row], shard["torque_nm"][row]])
                tilt = float(shard["tilt_deg"][row])
                place, still = placed(wrench, tilt, float(shard["azimuth_deg"][row]))
                parts.append((place, still, shard["surface_mm"][row].astype(np.float32)))
    return States(*(np.array(column) for column in zip(*parts, strict=True)))


def placed(wrench: Array, tilt_deg: float, azimuth_deg: float) -> tuple[Array, Array]:
    """(place (4,) as in :class:`States`, wrench (6,) turned to azimuth 0).

    Args:
        wrench: (6,) about the sphere's centre. tilt_deg, azimuth_deg: of the first touch.
    """
    still = turn_wrench(wrench, -azimuth_deg)
    outward, away, across = still[:3] @ Indenter(tilt_deg).frame()
    return np.array([tilt_deg, -outward, away, across]), still


def frame_bounds(
    data: LabelledSet, states: States, noise: Noise, camera: MountedCamera | None, every: int = 1
) -> tuple[Array, dict[str, Array]]:
    """(rows of the set that have enough states near, covariances (n, 6, 6) by variant).

    Args:
        data: judged frames. states: solved. noise: of the tracker. camera: as calibrated; None for the nominal one.
        every: judge every Nth frame.
    """
    params = data.params
    shell = ShellHalves(shell_geometry(params.diameter_mm, params.wall_mm), silicone().neo_hooke(), "data")
    rest = np.array([dot_position_mm(params, dot) for dot in dot_pattern(params)])
    to_sphere = wrench_adjoint(T_sphere_endcap(params))
    wrenches = np.concatenate([data.column("force_n"), data.column("torque_nm")], axis=1) @ to_sphere.T
    contact, tilt, azimuth = (data.column(name) for name in ("contact", "tilt_deg", "azimuth_deg"))
    used, found = [], []
    for row in np.flatnonzero(contact & (np.linalg.norm(wrenches[:, :3], axis=1) > 1))[::every]:
        place, _ = placed(wrenches[row], float(tilt[row]), float(azimuth[row]))
        near = _near(states, place)
        if near is not None:
            seen = camera or nominal_mount(params, *SIZE_PX)
            found.append(_bounds(near, shell, rest, float(azimuth[row]), seen, noise))
            used.append(row)
    return np.array(used), {name: np.array([each[name] for each in found]) for name in VARIANTS}


@dataclass(frozen=True)
class Near:
    """A quadratic fit round one place.

    Attributes:
        operator: (5, s) value and slopes by tilt (degrees) and forces (N), from the values of states.
        table, fit: (s, 15) and (15, s): what the fit makes of values is table @ fit @ values.
        share: (s,) roots of the weights of what it leaves. surface_mm, wrench: of the states.
    """

    operator: Array
    table: Array
    fit: Array
    share: Array
    surface_mm: Array
    wrench: Array


def _near(states: States, place: Array) -> Near | None:
    """The fit, or None where too few states are near."""
    width = np.array([NEAR_TILT_DEG, *[NEAR_SHARE * place[1] + NEAR_N] * 3])
    offset = (states.place - place) / width
    weight = np.exp(-(offset**2).sum(axis=1))
    use = weight > LEAST_WEIGHT
    table = quadratic_terms(offset[use])
    freedom = weight[use].sum() ** 2 / (weight[use] ** 2).sum() - table.shape[1]
    if freedom < table.shape[1]:
        return None
    root = np.sqrt(weight[use])[:, None]
    fit = np.linalg.pinv(root * table, rcond=1e-8) * root.T
    share = np.sqrt(weight[use] / weight[use].sum() * (1 + table.shape[1] / freedom))
    operator = fit[:5] / np.array([1.0, *width])[:, None]
    return Near(operator, table, fit, share, states.surface_mm[use], states.wrench[use])


def _bounds(
    near: Near, shell: ShellHalves, rest: Array, azimuth_deg: float, camera: MountedCamera, noise: Noise
) -> dict[str, Array]:
    """(6, 6) smallest covariance by variant.

    Args:
        near: the fit. shell: samples its dots. rest: (d, 3) mm. azimuth_deg: of the frame. camera: that sees it.
        noise: of the tracker.
    """
    surfaces = np.tensordot(near.operator, near.surface_mm, axes=1)  # value and four slopes
    here, *moves = (shell.sampler(azimuth_deg).sample(surface) for surface in surfaces)
    turned = [shell.sampler(azimuth_deg + turn).sample(surfaces[0]) for turn in (-TURN_DEG, TURN_DEG)]
    moves.append((turned[1] - turned[0]) / (2 * TURN_DEG))
    at, still = camera.project(rest + here), camera.project(rest)
    seen = ((np.minimum(still, at) > BORDER_PX) & (np.maximum(still, at) < SIZE_PX - BORDER_PX)).all(axis=1)

    def by_pixel(move: Array) -> Array:
        return ((camera.project(rest + here + 1e-3 * move) - at)[seen] / 1e-3).ravel()

    value = near.operator @ near.wrench
    turn = np.concatenate([np.cross([0, 0, 1.0], part) for part in (value[0, :3], value[0, 3:])]) * np.pi / 180
    slopes = np.array([by_pixel(move) for move in moves]), turn_wrench(np.vstack([value[1:], turn]), azimuth_deg)
    histories = _histories(near, shell, azimuth_deg, by_pixel)
    cameras = np.array(list(_cameras(camera, rest, here, seen)) or [np.zeros(slopes[0].shape[1])])
    far = np.linalg.norm(at - still, axis=1)[seen]
    return _variants(slopes, histories, cameras, noise.covariance(at[seen], far))


def _histories(near: Near, shell: ShellHalves, azimuth_deg: float, by_pixel: Any) -> tuple[Array, Array]:
    """Independent deviations of unit variance that the fit leaves: of the pixels (h, m) and of the wrench (h, 6)."""
    sampler = shell.sampler(azimuth_deg)
    dots = np.array([sampler.sample(surface) for surface in near.surface_mm])
    flat = np.concatenate([dots.reshape(len(dots), -1), 1e3 * near.wrench], axis=1)  # mm, mN, mN m: any unit will do
    left = near.share[:, None] * (flat - near.table @ (near.fit @ flat))
    values, vectors = np.linalg.eigh(left.T @ left)
    principal = (np.sqrt(np.maximum(values, 0.0)) * vectors)[:, ::-1][:, :HISTORIES].T
    pixels = np.array([by_pixel(move.reshape(-1, 3)) for move in principal[:, :-6]])
    return pixels, turn_wrench(principal[:, -6:] / 1e3, azimuth_deg)


def _cameras(camera: MountedCamera, rest: Array, here: Array, seen: Array) -> Iterator[Array]:
    """(m,) change of the displacements by one deviation of each direction that the calibration leaves."""
    if camera.covariance is None:
        return
    vector = camera_vector(camera)
    for step in independent_deviations(camera.covariance).T:
        more, less = (camera_at(vector + sign * step, camera) for sign in (1, -1))
        moved = [(each.project(rest + here) - each.project(rest))[seen].ravel() for each in (more, less)]
        yield (moved[0] - moved[1]) / 2


def _variants(
    slopes: tuple[Array, Array], histories: tuple[Array, Array], cameras: Array, noise: Array
) -> dict[str, Array]:
    """Bounds with the history known, with it unknown, and with the camera as calibrated, too.

    Args:
        slopes, histories: of pixels (p, m) and wrench (p, 6). cameras: of pixels (c, m). noise: (m, m).
    """
    found = {"known": smallest_covariance(slopes[0], noise, slopes[1])}
    pixels, wrenches = slopes
    known = [0.0] * len(pixels)
    for name, (more, change) in zip(VARIANTS[1:], (histories, (cameras, np.zeros((len(cameras), 6)))), strict=True):
        pixels, wrenches = np.vstack([pixels, more]), np.vstack([wrenches, change])
        known += [1.0] * len(more)  # deviations of unit variance
        found[name] = smallest_covariance(pixels, noise, wrenches, np.diag(known))
    return found


def answered(data: LabelledSet, camera: MountedCamera | None, weights: Path | None) -> LiveAnswers:
    """What the live pipeline answers with the calibrated camera.

    Args:
        data: frames. camera: as calibrated. weights: of the model; None for those that ship.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "camera.json"
        if camera is not None:
            camera.save(file)
        return live_answers(data, load_model("default", data.params, weights), None if camera is None else file)


def table(answers: LiveAnswers, bounds: dict[str, Array]) -> list[dict[str, Any]]:
    """A row for each range of tilt and load and each axis: bounds and error, root mean square over its frames."""
    load = np.linalg.norm(answers.truth[:, :3], axis=1)
    tilt_of = np.clip(np.digitize(answers.tilt_deg, TILTS_DEG) - 1, 0, len(TILTS_DEG) - 2)
    load_of = np.clip(np.digitize(load, LOADS_N) - 1, 0, len(LOADS_N) - 2)
    rows = []
    for t, n in sorted(set(zip(tilt_of.tolist(), load_of.tolist(), strict=True))):
        here = (tilt_of == t) & (load_of == n)
        error = (answers.value - answers.truth)[here]
        for k, axis in enumerate(AXES):
            row: dict[str, Any] = {"tilt_from_deg": TILTS_DEG[t], "tilt_to_deg": TILTS_DEG[t + 1]}
            row |= {"load_from_n": LOADS_N[n], "load_to_n": LOADS_N[n + 1], "axis": axis, "frames": int(here.sum())}
            row |= {f"bound_{name}": float(np.sqrt(bounds[name][here, k, k].mean())) for name in VARIANTS}
            row["rmse"] = float(np.sqrt((error[:, k] ** 2).mean()))
            rows.append(row | {"ratio": row["rmse"] / row["bound_camera"]})
    return rows


if __name__ == "__main__":
    sys.exit(in_one_line(main))
