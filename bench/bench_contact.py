"""What a plane's contact leaves in the wrench and in the dots: constants of the place's law, slip, curvature.

    python bench/bench_contact.py law STATES...          # sets written with --render off
    python bench/bench_contact.py shells                 # what the law leaves of other shells
    python bench/bench_contact.py slip STATES...         # needs torch
    python bench/bench_contact.py curvature              # solves some twenty states
    python bench/bench_contact.py places FRAMES...       # rendered sets, as sensing.evaluate reads them

``law`` fits the constants of :mod:`sensing.wrench.plane_contact` to three quarters of the paths and prints what they
leave on the others. ``shells`` holds the law against the library of solved states, at shells that it was not fitted to.
``slip`` asks a perceptron for the share of slipping contact, from the true displacements of all
dots with the tracker's noise, of paths never seen. ``curvature`` gives the least standard deviation of the curvature of
the ground (Cramer-Rao) where tilt, forces and azimuth are unknown, too. ``places`` runs the live pipeline, calibrated
from the rest picture, and prints by how much contact centre and normal are off.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from cad.dots import dot_pattern, dot_position_mm
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.design.bound import SIZE_PX, smallest_covariance
from sensing.design.weights import DesignRequest
from sensing.evaluation.live_answers import live_answers
from sensing.frames import T_sphere_endcap, wrench_adjoint
from sensing.learning.found_camera import found_camera
from sensing.learning.marker_fields import BORDER_PX, Scatter
from sensing.live.core.model import load_model
from sensing.records_labelled import LabelledSet
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.scene import Scene
from sensing.simulator.similarity.labelled import library_source, shell_of, with_azimuths, write_labelled
from sensing.simulator.solid.geometry import shell_geometry
from sensing.wrench.plane_contact import FITTED_LENGTH_MM, FITTED_RADIUS_MM, LAW, pressure_point

Array = np.ndarray
PARAMS = EndcapParams(130, 8)
SHELLS = (130, 8), (100, 10), (112, 7.3), (164, 9), (180, 15), (250, 6.5), (250, 25)
LOADS_N, STEEPEST_DEG = (1.0, 40.0), 52.0  # of the states that count
NOISE_MM = 0.01  # E: the tracker's, on the dome
CURVED_MM = 200.0  # radius of the slightly curved ground whose difference from a plane gives the slope
PLACE_RANGES = ((5, 35, 50), (1, 5, 50), (0, 1000, 90))  # N from, N to, degrees at most
CIRCLE_95 = np.sqrt(-2 * np.log(0.05))  # radius in standard deviations of one direction that holds 95 %
EPOCHS, HIDDEN, COMPONENTS = 25, 96, 80


def main() -> int:
    """Run the study asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("law", "shells", "slip", "curvature", "places"))
    parser.add_argument("states", type=Path, nargs="*")
    options = parser.parse_args()
    if options.study in ("law", "slip", "places") and not options.states:
        parser.error(f"{options.study} needs folders of states or frames: see the top of this file")
    if options.study == "curvature":
        curvature()
    elif options.study == "shells":
        shells()
    elif options.study == "places":
        places(options.states)
    else:
        {"law": law, "slip": slip}[options.study](pushed(options.states))
    return 0


def places(folders: list[Path]) -> None:
    """Medians by load and tilt, and how many lie inside the stated 95 %.

    Args:
        folders: of rendered sets; all frames count together.
    """
    off, load, tilt = [], [], []
    for folder in folders:
        data = LabelledSet(folder)
        with tempfile.TemporaryDirectory() as kept:
            camera = Path(kept) / "camera.json"
            found_camera(data).save(camera)
            answers = live_answers(data, load_model("default", data.params), camera)
        answers = answers.take(answers.contact & np.isfinite(answers.place).all(axis=1))
        off.append(answers.place)
        load.append(np.linalg.norm(answers.truth[:, :3], axis=1))
        tilt.append(answers.tilt_deg)
    place, force, steep = np.concatenate(off), np.concatenate(load), np.concatenate(tilt)
    for low, high, most in PLACE_RANGES:
        use = (force >= low) & (force < high) & (steep <= most)
        inside = 100 * (place[use, :2] <= CIRCLE_95 * place[use, 2:]).mean(axis=0)
        centre, normal = np.median(place[use, :2], axis=0)
        print(
            f"{low:g} to {high:g} N, to {most:g} degrees: {use.sum()} frames, centre off {centre:.2f}, normal off "
            f"{normal:.2f} degrees, within the stated 95 %: {inside[0]:.0f} %, {inside[1]:.0f} %"
        )


def pushed(folders: list[Path], load_scale: float = 1.0) -> dict[str, Array]:
    """Columns of all states under load: forces in the contact's axes, place beside the normal, depth, slip, dots.

    Args:
        folders: of labelled sets. load_scale: how large the forces are against those of D=130 T=8.
    """
    rows = []
    for number, folder in enumerate(folders):
        data = LabelledSet(folder)
        to_sphere = wrench_adjoint(T_sphere_endcap(data.params))
        names = ("path", "tilt_deg", "azimuth_deg", "depth_mm", "friction", "slip_share", "dots_mm", "contact")
        table = {name: data.column(name) for name in names}
        wrenches = np.concatenate([data.column("force_n"), data.column("torque_nm")], axis=1) @ to_sphere.T
        for k in np.flatnonzero(table["contact"] & (table["tilt_deg"] < STEEPEST_DEG)):
            c, s = np.cos(np.radians(table["azimuth_deg"][k])), np.sin(np.radians(table["azimuth_deg"][k]))
            axes = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ Indenter(float(table["tilt_deg"][k])).frame()
            force, height = wrenches[k, :3], data.params.outer_radius_mm - table["depth_mm"][k]
            push, along, across = force @ axes * [-1, 1, 1]
            if LOADS_N[0] < push / load_scale < LOADS_N[1]:
                point = pressure_point(force, 1000 * wrenches[k, 3:], axes[:, 0], height) @ axes
                path = 10_000 * number + table["path"][k]
                rows.append((path, table["tilt_deg"][k], push, along, across, *point[1:], table["depth_mm"][k],
                             table["friction"][k], table["slip_share"][k], table["dots_mm"][k].ravel()))  # fmt: skip
    named = ("path", "tilt", "push", "along", "across", "x", "y", "depth", "friction", "slip", "dots")
    return {name: np.array(column) for name, column in zip(named, zip(*rows, strict=True), strict=True)}


def held_out(path: Array, share: float = 0.25) -> Array:
    """(n,) True on whole paths drawn at random."""
    names = np.unique(path)
    return np.isin(path, np.random.default_rng(1).permutation(names)[: round(share * len(names))])


def law(found: dict[str, Array]) -> None:
    """Constants of the law and what it leaves, by axis, mm."""
    wall, unit = PARAMS.wall_mm, silicone().neo_hooke().shear_mpa * PARAMS.wall_mm**2
    n, along, across = (found[name] / unit for name in ("push", "along", "across"))
    tilt, zero, test = np.radians(found["tilt"]), np.zeros(len(n)), held_out(found["path"])
    columns = [  # of x and of y
        (along, across), (np.sqrt(n) * along, np.sqrt(n) * across), (np.sin(tilt) ** 2 * along, zero),
        (zero, np.sin(tilt) ** 2 * across), (np.sin(2 * tilt) * n, zero), (np.sin(tilt) * n, zero),
    ]  # fmt: skip
    table = np.concatenate([np.stack(part, axis=1) for part in zip(*columns, strict=True)])
    values = np.concatenate([found["x"], found["y"]]) / wall
    fit = np.linalg.lstsq(table[np.tile(~test, 2)], values[np.tile(~test, 2)], rcond=None)[0]
    deep = np.stack([n, n**1.5, np.sqrt(n)], axis=1)
    sink = np.linalg.lstsq(deep[~test], found["depth"][~test] / wall, rcond=None)[0]
    print(f"{len(n)} states; c0 c1 c2 c3 c4 c8:", *fit.round(4), "depth:", *sink.round(3))
    left = wall * (values - table @ fit).reshape(2, -1)
    for name, of_axis in zip("xy", left, strict=True):
        for low, high in ((1, 9), (9, 40)):
            part = of_axis[test & (found["push"] >= low) & (found["push"] < high)]
            print(f"{name} left, {low} to {high} N: rms {np.sqrt((part**2).mean()):.3f}, "
                  f"median {np.median(np.abs(part)):.3f} mm")  # fmt: skip
        print(f"{name}: rms {np.sqrt((of_axis[test] ** 2).mean()) / wall:.4f} walls")


def shells() -> None:
    """What the law leaves of shells of the library, by axis, mm, at loads that are 1 to 40 N at D=130 T=8."""
    for diameter_mm, wall_mm in SHELLS:
        request = DesignRequest(EndcapParams(diameter_mm, wall_mm))
        data = request.data("off", 1)
        shell = shell_of(data)
        with tempfile.TemporaryDirectory() as folder:
            states = Path(folder) / "states"
            write_labelled(data, with_azimuths(request.paths, 1), library_source(shell[0]), states, shell)
            found = pushed([states], request.scale.force)
        unit_n = silicone().neo_hooke().shear_mpa * wall_mm**2
        n, along, across = (found[name] / unit_n for name in ("push", "along", "across"))
        s, twice, k = np.sin(np.radians(found["tilt"])), np.sin(2 * np.radians(found["tilt"])), LAW[0] + LAW[1] * n**0.5
        law = {
            "x": (k + LAW[2] * s**2) * along + (LAW[4] * twice + LAW[8] * s) * n, "y": (k + LAW[3] * s**2) * across,
            "depth": LAW[5] * n + LAW[6] * n**1.5 + LAW[7] * n**0.5,
        }  # fmt: skip
        span_mm = diameter_mm / 2 * FITTED_LENGTH_MM / FITTED_RADIUS_MM
        rms = {name: np.sqrt(((found[name] - span_mm * by_law) ** 2).mean()) for name, by_law in law.items()}
        whole = {name: np.sqrt((found[name] ** 2).mean()) for name in law}
        left = ", ".join(f"{name} {rms[name]:.2f} of {whole[name]:.2f}" for name in law)
        print(f"D={diameter_mm:g} T={wall_mm:g}, {len(n)} states, rms left in mm: {left}")


def slip(found: dict[str, Array]) -> None:
    """Error of the slipping share, of paths never seen, against its scatter."""
    import torch

    torch.manual_seed(0)
    test, rng = held_out(found["path"]), np.random.default_rng(0)
    dots = found["dots"] + NOISE_MM * rng.standard_normal(found["dots"].shape)
    mean = dots[~test].mean(axis=0)
    _, size, axes = np.linalg.svd(dots[~test] - mean, full_matrices=False)
    fields = (dots - mean) @ (axes[:COMPONENTS] / size[:COMPONENTS, None]).T * np.sqrt((~test).sum())
    use = np.hypot(found["along"], found["across"]) / found["push"]
    given = {
        "dots": fields,
        "tangential over normal force": use[:, None],
        "and the coefficient of friction": np.stack([use, use / found["friction"], found["friction"]], axis=1),
    }
    print(f"{len(test)} states; standard deviation of the share: {found['slip'][test].std():.3f}")
    for name, inputs in given.items():
        x, y = (torch.tensor(v, dtype=torch.float32) for v in (inputs, found["slip"][:, None]))
        layers = [torch.nn.Linear(x.shape[1], HIDDEN), torch.nn.SiLU(), torch.nn.Linear(HIDDEN, HIDDEN)]
        net = torch.nn.Sequential(*layers, torch.nn.SiLU(), torch.nn.Linear(HIDDEN, 1))
        steps = torch.optim.AdamW(net.parameters(), 2e-3, weight_decay=1e-2)
        known = torch.tensor(np.flatnonzero(~test))
        for _ in range(EPOCHS):
            for batch in known[torch.randperm(len(known))].split(128):
                steps.zero_grad()
                ((net(x[batch]) - y[batch]) ** 2).mean().backward()
                steps.step()
        with torch.no_grad():
            error = (net(x) - y).numpy()[test, 0]
        print(f"from {name}: rms {np.sqrt((error**2).mean()):.3f}, median {np.median(np.abs(error)):.3f}")


def curvature(tilt_deg: float = 25.0, loads_n: tuple[float, ...] = (5.0, 15.0, 30.0)) -> None:
    """Least standard deviation of the curvature, and the radius that lies three of them from a plane."""
    simulator = Simulator(shell_geometry(130, 8), silicone().neo_hooke())
    rest = np.array([dot_position_mm(PARAMS, dot) for dot in dot_pattern(PARAMS)])
    camera = nominal_mount(PARAMS, *SIZE_PX)

    def pixels(
        body: Indenter, friction: float = 0.6, load: float = 1.0, shift: float = 0.0, turn: float = 0.0
    ) -> Array:
        ends = [Target(normal_n=load * n, shift_mm=(shift * n / loads_n[-1], 0.0)) for n in loads_n]
        states = simulator.follow(Scene(body, friction), ends)
        return np.array([camera.project(rest + simulator.markers(state, turn)) for state in states])

    plane = Indenter(tilt_deg)
    base, still = pixels(plane), camera.project(rest)
    moved = [
        pixels(Indenter(tilt_deg + 1)),
        pixels(plane, load=1.04),
        pixels(plane, shift=0.3),
        pixels(plane, turn=1.0),
    ]
    histories = [pixels(plane, friction=0.3), pixels(plane, friction=1.2)]
    curved = pixels(Indenter(tilt_deg, kind="sphere", radius_mm=CURVED_MM))
    for k, load in enumerate(loads_n):
        seen = ((np.minimum(still, base[k]) > BORDER_PX) & (np.maximum(still, base[k]) < SIZE_PX - BORDER_PX)).all(
            axis=1
        )
        slopes = np.array([(each[k] - base[k])[seen].ravel() for each in (*moved, *histories, curved)])
        far = np.linalg.norm(base[k] - still, axis=1)[seen]
        variance = Scatter().tracking_px(far) ** 2
        known = np.diag([0.0] * len(moved) + [1.0] * len(histories) + [0.0])
        answer = np.zeros((len(slopes), 1))
        answer[-1] = 1000 / CURVED_MM
        sd = float(np.sqrt(smallest_covariance(slopes, np.repeat(variance, 2), answer, known)[0, 0]))
        print(f"{load:g} N: {sd:.2f} per m; three deviations: a radius of {1000 / (3 * sd):.0f} mm")


if __name__ == "__main__":
    sys.exit(in_one_line(main))
