"""What weighing brings: ``python bench/bench_weigh.py`` writes bench/weigh.csv.

An endcap of Smooth-Sil 940 (27 % softer than the training's 950; its pictures and paths are in no training set) is
weighed on a level table by ``sensing.weigh`` from two films. Then it is pressed and dragged by planes at five tilts,
and the shipped weights answer through the live pipeline, without and with the gain, nominal camera. Errors in N and N m
by the true load.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from pressed_films import Film, Recipe, asked_film, pressed_film

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.materials import silicone
from sensing import weigh
from sensing.frames import T_sphere_endcap, wrench_adjoint
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import load_config, save_config
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import EndcapPipeline
from sensing.simulator.press.press import Target
from sensing.tensegrity.description import GRAVITY_M_S2
from sensing.tracking.zero import single_zero

HERE = Path(__file__).parent
OUT = HERE.parent / "exports" / "bench"
SOFT = "Smooth-Sil 940"
WEIGHTS_G = (600.0, 1800.0)
LOADS_N = ((0.5, 7.0), (7.0, 15.0), (15.0, 30.0), (0.5, 30.0))
TILTS = 5


def weighing_film(number: int) -> Film:
    """Rest, then the weight in four steps, then 1.5 s at rest."""
    load = WEIGHTS_G[number] / 1000 * GRAVITY_M_S2
    targets: list[Target | None] = [None] * 6
    targets += [Target(normal_n=load * part) for part in (0.25, 0.5, 0.75)] + [Target(normal_n=load)] * 40
    return pressed_film(OUT / f"weigh_{WEIGHTS_G[number]:g}", Recipe(SOFT, noise=1000 * number), targets)


def test_film(number: int) -> Film:
    """Two pictures at rest, then loads up and down, dragged along the meridian in between."""
    rng = np.random.default_rng([7301, number])
    tilt, azimuth, friction = 10.0 * (number + 1), float(rng.uniform(0, 360)), float(rng.uniform(0.3, 1.0))
    loads = rng.uniform(0.9, 1.1, 9) * (2, 5, 9, 13, 18, 24, 16, 10, 4)
    shift = np.cumsum([0, 0, 0, 0.4, 0, 0, 0.8, 0, 0])
    targets: list[Target | None] = [None, None]
    targets += [Target(normal_n=float(n), shift_mm=(float(s), 0.0)) for n, s in zip(loads, shift, strict=True)]
    return pressed_film(
        OUT / f"soft_{number}", Recipe(SOFT, tilt, azimuth, friction, noise=5000 + 100 * number), targets
    )


def weighed(folders: list[tuple[float, Path]]) -> EndcapConfig:
    """The endcap after the command."""
    path = OUT / "endcaps.toml"
    save_config(LiveConfig((EndcapConfig("soft", "0"),)), path)
    poses = [f"--pose=tilt=0,grams={weight_g:g},source={folder}" for weight_g, folder in folders]
    if weigh.main(["--config", str(path), *poses]):
        sys.exit("weighing was refused")
    return load_config(path).endcaps[0]


def answers(endcap: EndcapConfig, films: list[Film]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(n, 6) answers of single frames about the sphere's centre, their truth, and standard deviations."""
    model, to_sphere = load_model("default", endcap.params), wrench_adjoint(T_sphere_endcap(endcap.params))
    rows = []
    for film in films:
        pipeline = EndcapPipeline(endcap, model, single_zero(film.frames[0]))
        for frame, wrench in zip(film.frames[1:], film.wrench[1:], strict=True):
            reading = pipeline.update(frame)
            assert reading is not None and reading.valid, reading
            value = np.concatenate([reading.estimate.force_n, reading.estimate.torque_nm])
            spread = np.sqrt(np.diag(to_sphere @ reading.estimate.covariance @ to_sphere.T))
            rows.append((to_sphere @ value, to_sphere @ wrench, spread))
    value, truth, spread = (np.array(column) for column in zip(*rows, strict=True))
    return value, truth, spread


def row(
    name: str, endcap: EndcapConfig, found: tuple[np.ndarray, ...], load_n: tuple[float, float]
) -> dict[str, object]:
    """Errors within a range of true loads."""
    load = np.linalg.norm(found[1][:, :3], axis=1)
    value, truth, spread = (column[(load > load_n[0]) & (load < load_n[1])] for column in found)
    error = value - truth
    rmse = np.sqrt((error**2).mean(axis=0))
    return {
        "what": name, "gain": f"{endcap.gain:.4f}", "gain_sd": f"{endcap.gain_sd:.4f}", "load_from_n": load_n[0],
        "load_to_n": load_n[1], "frames": len(error), "fx_n": f"{rmse[0]:.4f}", "fy_n": f"{rmse[1]:.4f}",
        "fz_n": f"{rmse[2]:.4f}", "fz_bias_n": f"{error[:, 2].mean():.4f}",
        "torque_nm": f"{np.sqrt((rmse[3:] ** 2).mean()):.5f}",
        "covered": f"{(np.abs(error) < 1.96 * spread).mean():.3f}",
    }  # fmt: skip


def main() -> None:
    """Weigh, answer, write the table; a number makes one film only."""
    number = asked_film(__doc__, TILTS + len(WEIGHTS_G))
    if number is not None:
        print(test_film(number).folder if number < TILTS else weighing_film(number - TILTS).folder)
        return
    films = [test_film(number) for number in range(TILTS)]
    weighings = [(weight_g, weighing_film(number).folder) for number, weight_g in enumerate(WEIGHTS_G)]
    plain, found = EndcapConfig("soft", "0"), weighed(weighings)
    true = silicone(SOFT).neo_hooke().shear_mpa / silicone().neo_hooke().shear_mpa
    rows = []
    for name, gain, sd in (("not weighed", 1.0, 0.0), ("weighed", found.gain, found.gain_sd), ("true gain", true, 0.0)):
        endcap = replace(plain, gain=gain, gain_sd=sd)
        given = answers(endcap, films)
        rows += [row(name, endcap, given, load_n) for load_n in LOADS_N]
        print(*rows[-len(LOADS_N) :], sep="\n", flush=True)
    write_table(HERE / "weigh.csv", rows)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
