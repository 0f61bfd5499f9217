"""An untouched endcap under a changing lamp: what the model reports, and how often contact is claimed.

    python bench/bench_wrench_rest.py               # bench/wrench_rest.csv, bench/wrench_rest.png

Rendered frames with fresh noise, through the real tracker. Zeroed and the contact threshold learnt under the nominal
lamp; then the lamp changes by the share given (brightness, or a gradient to one side) and stays. Force norm in N.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cad.params import EndcapParams
from sensing.records import Frame, Wrench
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import Lamp, RenderSettings
from sensing.tracking.model_input import model_input
from sensing.wrench.contact import ContactDetector, threshold_from_rest
from sensing.wrench.model import WrenchModel, load_wrench_model

HERE = Path(__file__).parent
LAMPS = {
    "nominal": Lamp(),
    "15 % darker": Lamp(brightness=0.85),
    "30 % darker": Lamp(brightness=0.7),
    "30 % brighter": Lamp(brightness=1.3),
    "gradient 15 %": Lamp(gradient=0.15, gradient_azimuth_deg=70),
    "gradient 30 %": Lamp(gradient=0.3, gradient_azimuth_deg=70),
    "30 % darker, gradient 30 %": Lamp(brightness=0.7, gradient=0.3, gradient_azimuth_deg=200),
}
RATE_HZ = 30.0
FALSE_RATE = 1e-3


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1000, help="a lamp (1000)")
    parser.add_argument("--weights", type=Path, help="those that ship")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    design = EndcapParams(130.0, 8.0)
    model = load_wrench_model(design, options.weights)
    rows, norms = [], {}
    stand = Rest(model, replace(RenderSettings(seed=0).at_level("data"), fresh_noise=True))
    threshold = threshold_from_rest(
        np.array([w.force_n for w in stand.reported(Lamp(), options.frames, 0)]), FALSE_RATE
    )
    for number, (name, lamp) in enumerate(LAMPS.items(), 1):
        reported = list(stand.reported(lamp, options.frames, number * options.frames))
        detector = ContactDetector(threshold)
        norm = np.array([np.linalg.norm(w.force_n) for w in reported])
        false = sum(detector.update(wrench).touching for wrench in reported)
        norms[name] = norm
        rows.append(
            {"lamp": name, "frames": len(reported), "median_n": np.median(norm), "p99_n": np.quantile(norm, 0.99),
             "most_n": norm.max(), "threshold_n": threshold.on_n, "false_contacts": false / len(reported)}
        )  # fmt: skip
        print(*(f"{v:.4g}" if isinstance(v, float) else v for v in rows[-1].values()), flush=True)
    with (HERE / "wrench_rest.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows)
    plot(norms, threshold.on_n)


class Rest:
    """One untouched endcap, zeroed on an average picture under the nominal lamp."""

    def __init__(self, model: WrenchModel, settings: RenderSettings) -> None:
        self.model, self.settings = model, settings
        self.renderer = DomeRenderer(model.design, settings=self.settings)
        first = np.mean([self.picture(Lamp(), -1 - k).astype(float) for k in range(10)], axis=0)
        self.zero = Frame(0.0, 0, "rest", image=np.round(first).astype(np.uint8))

    def reported(self, lamp: Lamp, count: int, start: int) -> Iterator[Wrench]:
        """The model's answers on frames under a lamp."""
        seen = model_input(self.zero, self.model.shape, self.model.design)
        for k in range(count):
            frame = Frame(k / RATE_HZ, k, "rest", image=self.picture(lamp, start + k))
            yield self.model.estimate(seen.update(frame))

    def picture(self, lamp: Lamp, number: int) -> NDArray[np.uint8]:
        """One gray picture as received; a number is a noise."""
        image = self.renderer.render(frame=number + 10, settings=replace(self.settings, lamp=lamp)).image_bgr
        return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def plot(norms: dict[str, NDArray[np.float64]], threshold_n: float) -> None:
    """How often a force is exceeded at rest."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axis = pyplot.subplots(figsize=(7, 4.2))
    for name, norm in norms.items():
        axis.step(np.sort(norm), 1 - np.arange(len(norm)) / len(norm), label=name, where="post")
    axis.axvline(threshold_n, color="k", ls=":", label=f"contact from {threshold_n:.3f} N")
    axis.set(
        xlabel="force reported of an untouched endcap, N", ylabel="share of frames above", yscale="log", xlim=(0, None)
    )
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(HERE / "wrench_rest.png", dpi=90)


if __name__ == "__main__":
    main()
