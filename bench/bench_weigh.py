"""What weighing brings: ``python bench/bench_weigh.py`` writes bench/weigh.csv.

An endcap of Smooth-Sil 940 (27 % softer than the training's 950; its pictures and paths are in no training set) is
weighed on a level table by ``sensing.weigh`` from two films, then the shipped weights answer on paths of the ``static``
protocol (seed 7301) through the live pipeline, without and with the gain, nominal camera. Errors in N and N m on
frames in contact, by the true load.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
from pressed_films import Recipe, pressed_film

from cad.materials import silicone
from sensing import weigh
from sensing.evaluation.live_answers import LiveAnswers, live_answers
from sensing.live.core.config import EndcapConfig, LiveConfig, load_config, save_config
from sensing.live.core.model import load_model
from sensing.records_labelled import LabelledSet
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.dataset.writer import write_dataset
from sensing.simulator.press.press import Target
from sensing.weighing.words import GRAVITY_M_S2
from sensing.wrench.stiffness import Stiffness

HERE = Path(__file__).parent
OUT = HERE.parent / "exports" / "bench"
SOFT = "Smooth-Sil 940"
WEIGHTS_G = (600.0, 1800.0)
LOADS_N = ((0.0, 5.0), (5.0, 15.0), (15.0, 25.0), (25.0, 60.0), (0.0, 25.0))


def weighing_film(weight_g: float, noise: int) -> Path:
    """Rest, then the weight in four steps, then 1.5 s at rest."""
    load = weight_g / 1000 * GRAVITY_M_S2
    targets = [None] * 12 + [Target(normal_n=load * part) for part in (0.25, 0.5, 0.75)] + [Target(normal_n=load)] * 45
    folder = OUT / f"weigh_{weight_g:g}"
    pressed_film(folder, Recipe(SOFT, noise=noise), targets)
    return folder


def weighed(folders: list[tuple[float, Path]]) -> EndcapConfig:
    """The endcap after the command."""
    path = OUT / "endcaps.toml"
    save_config(LiveConfig((EndcapConfig("soft", "0"),)), path)
    poses = [f"--pose=tilt=0,grams={weight_g:g},source={folder}" for weight_g, folder in folders]
    if weigh.main(["--config", str(path), *poses]):
        sys.exit("weighing was refused")
    return load_config(path).endcaps[0]


def row(name: str, answers: LiveAnswers, load_n: tuple[float, float], gain: float, sd: float) -> dict[str, object]:
    """Errors within a range of true loads."""
    load = np.linalg.norm(answers.truth[:, :3], axis=1)
    used = answers.take(answers.contact & (load >= load_n[0]) & (load < load_n[1]))
    error = used.value - used.truth
    rmse, spread = np.sqrt((error**2).mean(axis=0)), np.sqrt(np.diagonal(used.covariance, axis1=1, axis2=2))
    return {
        "what": name, "gain": f"{gain:.4f}", "gain_sd": f"{sd:.4f}", "load_from_n": load_n[0], "load_to_n": load_n[1],
        "frames": len(error), "fx_n": f"{rmse[0]:.4f}", "fy_n": f"{rmse[1]:.4f}", "fz_n": f"{rmse[2]:.4f}",
        "torque_nm": f"{np.sqrt((rmse[3:] ** 2).mean()):.5f}",
        "covered": f"{(np.abs(error) < 1.96 * spread).mean():.3f}",
    }  # fmt: skip


def main() -> None:
    """Weigh, answer, write the table."""
    request = DataRequest(400, silicone=SOFT, seed=7301, azimuths=1)
    write_dataset(request, OUT / "soft_static")
    data = LabelledSet(OUT / "soft_static")
    endcap = weighed([(weight_g, weighing_film(weight_g, 1000 * k)) for k, weight_g in enumerate(WEIGHTS_G)])
    model = load_model("default", data.params)
    true = silicone(SOFT).neo_hooke().shear_mpa / silicone().neo_hooke().shear_mpa
    rows = []
    for name, gain, sd in (("not weighed", 1.0, 0.0), ("weighed", endcap.gain, endcap.gain_sd), ("true", true, 0.0)):
        answers = live_answers(data, model, None, Stiffness(gain, sd))
        rows += [row(name, answers, load_n, gain, sd) for load_n in LOADS_N]
        print(*rows[-len(LOADS_N) :], sep="\n", flush=True)
    with (HERE / "weigh.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


if __name__ == "__main__":
    main()
