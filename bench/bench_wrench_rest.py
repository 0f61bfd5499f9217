"""An untouched endcap under a changing lamp: what live reports, and how often contact is claimed.

    python bench/bench_wrench_rest.py               # bench/wrench_rest.csv, bench/wrench_rest.png

Rendered frames with fresh noise, through the pipeline of ``sensing.live``. Zeroed and the contact threshold learnt
under the nominal lamp; then the lamp changes by the share given (brightness, or a gradient to one side) and stays.
Force norm in N, of single frames (``single``) and of what live reports, the filter's. ``dot_px`` is what an axis of a
dot scatters by from frame to frame.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.one_line import in_one_line
from bench.table_file import write_table
from cad.params import EndcapParams
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import load_model
from sensing.live.core.pipeline import ZERO_FRAMES, EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.settings import Lamp, RenderSettings
from sensing.tracking.zero import take_zero
from sensing.wrench.contact import ContactDetector, threshold_from_rest

Array = NDArray[np.float64]
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
    parser.add_argument("--frames", type=int, default=800, help="a lamp (800)")
    parser.add_argument("--weights", type=Path, help="those that ship")
    parser.add_argument("--out", type=Path, default=HERE / "wrench_rest.csv")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows, norms = [], {}
    stand = Rest(options.weights)
    learnt = np.array([r.wrench.force_n for r in stand.readings(Lamp(), options.frames, 0)])
    threshold = threshold_from_rest(learnt, FALSE_RATE)
    for number, (name, lamp) in enumerate(LAMPS.items(), 1):
        readings = stand.readings(lamp, options.frames, number * options.frames)
        detector = ContactDetector(threshold)
        false = sum(detector.update(reading.wrench).touching for reading in readings)
        norms[name] = np.array([np.linalg.norm(r.wrench.force_n) for r in readings])
        row = {"lamp": name, "frames": len(readings)} | spread(norms[name])
        row |= spread(np.array([np.linalg.norm(r.estimate.force_n) for r in readings]), "single_")
        row |= {"dot_px": scatter_px(readings)}
        rows.append(row | {"threshold_n": threshold.on_n, "false_contacts": false / len(readings)})
        print(*(f"{v:.4g}" if isinstance(v, float) else v for v in rows[-1].values()), flush=True)
    write_table(options.out, rows, figures=4)
    plot(norms, threshold.on_n, options.out.with_suffix(".png"))


def spread(norm_n: Array, prefix: str = "") -> dict[str, float]:
    """Median, 99 % and largest of (N,) norms."""
    found = {"median_n": np.median(norm_n), "p99_n": np.quantile(norm_n, 0.99), "most_n": norm_n.max()}
    return {prefix + name: float(value) for name, value in found.items()}


def scatter_px(readings: list[EndcapReading]) -> float:
    """Standard deviation of an axis of a dot from frame to frame, root mean square over the dots."""
    moved = np.array([r.tracks.displacement_px for r in readings if r.tracks is not None])
    return float(np.sqrt(moved.var(axis=0, ddof=1).mean()))


class Rest:
    """One untouched endcap, zeroed as live does under the nominal lamp.

    Args:
        weights: of the model; None for those that ship.
    """

    def __init__(self, weights: Path | None) -> None:
        self.design = EndcapParams(130.0, 8.0)
        self.model = load_model("default", self.design, weights)
        self.settings = replace(RenderSettings(seed=0).at_level("data"), fresh_noise=True)
        self.renderer = DomeRenderer(self.design, settings=self.settings)
        self.zero = take_zero([self.frame(Lamp(), k - ZERO_FRAMES) for k in range(ZERO_FRAMES)])

    def readings(self, lamp: Lamp, count: int, start: int) -> list[EndcapReading]:
        """Live's readings of frames under a lamp, from a restart on.

        Raises:
            RuntimeError: a frame without numbers.
        """
        pipeline = EndcapPipeline(EndcapConfig("rest", "rest"), self.model, self.zero)
        found = []
        for k in range(start, start + count):
            reading = pipeline.update(self.frame(lamp, k))
            if reading is None or not reading.valid:
                raise RuntimeError(f"frame {k}: no number ({pipeline.outcome})")
            found.append(reading)
        return found

    def frame(self, lamp: Lamp, number: int) -> Frame:
        """One gray picture as received; a number is a noise."""
        image = self.renderer.render(frame=number + ZERO_FRAMES, settings=replace(self.settings, lamp=lamp)).image_bgr
        gray = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        return Frame(1 + number / RATE_HZ, number, "rest", image=gray)


def plot(norms: dict[str, Array], threshold_n: float, path: Path) -> None:
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
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    sys.exit(in_one_line(main))
