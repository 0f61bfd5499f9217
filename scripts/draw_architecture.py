"""Draws docs/architecture.png: layers with their import arrows, and the three ways of the data.

python scripts/draw_architecture.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import FancyBboxPatch

OUT = Path(__file__).resolve().parent.parent / "docs" / "architecture.png"
MAKE, SENSE, SIMULATE, SHARED = "#d9e8f5", "#dcefdc", "#f6e6cf", "#e9e9e9"
Place = tuple[float, float, float, float]  # left, bottom, width, height


def box(axes: Axes, place: Place, title: str, text: str, colour: str) -> None:
    """A titled box."""
    left, bottom, width, height = place
    axes.add_patch(
        FancyBboxPatch((left, bottom), width, height, boxstyle="round,pad=0,rounding_size=0.6", fc=colour, ec="#555")
    )
    middle = left + width / 2
    axes.text(middle, bottom + height - 0.9, title, ha="center", va="top", weight="bold", size=10)
    axes.text(middle, bottom + height - 3.1, text, ha="center", va="top", size=8, linespacing=1.35)


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], text: str = "") -> None:
    """An arrow, with a word beside its middle."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": "#333", "lw": 1.2})
    if text:
        axes.text((start[0] + end[0]) / 2 + 0.6, (start[1] + end[1]) / 2, text, size=7.5, va="center", color="#333")


def draw_layers(axes: Axes) -> None:
    """Who imports whom: arrows point to what is imported."""
    axes.set(xlim=(0, 100), ylim=(0, 42), title="Layers: an arrow points to what is imported")
    box(
        axes,
        (2, 34.5, 96, 6),
        "endcap",
        "the command and the Python API; imports what a subcommand or a call needs when it is used",
        SHARED,
    )
    box(axes, (2, 20, 26, 10), "fab", "meshing, checks, pictures, exports,\nslicing, build sheet", MAKE)
    box(
        axes,
        (32, 20, 32, 10),
        "sensing",
        "sources, camera, calibration, tracking,\nwrench, recording, learning, live",
        SENSE,
    )
    box(axes, (77, 20, 21, 10), "sensing.simulator", "mechanics, renderer,\nprotocols, data sets", SIMULATE)
    box(axes, (2, 9, 26, 7), "cad: parts", "solids of the CAD kernel", MAKE)
    box(
        axes,
        (2, 0.5, 96, 5.5),
        "cad: bottom layer",
        "params, feasible, dots, errors, materials (standard library only)",
        SHARED,
    )
    for x in (15, 48, 87):
        arrow(axes, (x, 34.5), (x, 30))
    arrow(axes, (15, 20), (15, 16))
    arrow(axes, (15, 9), (15, 6))
    arrow(axes, (48, 20), (48, 6), "never the CAD kernel, never fab")
    arrow(axes, (87, 20), (87, 6), "as sensing")
    arrow(axes, (77, 27.5), (64, 27.5))
    axes.text(70.5, 28, "camera, records", size=7.5, ha="center", va="bottom", color="#333")
    arrow(axes, (64, 22.5), (77, 22.5))
    axes.text(70.5, 22, "demos, design", size=7.5, ha="center", va="top", color="#333")


def chain(axes: Axes, bottom: float, steps: list[tuple[str, str]], colour: str) -> None:
    """Boxes from left to right with arrows between them."""
    width, gap = (96 - 2.5 * (len(steps) - 1)) / len(steps), 2.5
    for number, (title, text) in enumerate(steps):
        left = 2 + number * (width + gap)
        box(axes, (left, bottom, width, 6), title, text, colour)
        if number:
            arrow(axes, (left - gap, bottom + 3), (left, bottom + 3))


FLOWS = (  # height of a way in the picture, its steps, its colour
    (
        19,
        [
            ("parameters", "D, T -> sizes"),
            ("parts", "solids, bought parts"),
            ("meshes", "with the gyroid"),
            ("checks", "on files read back"),
            ("exports", "whole or nothing"),
        ],
        MAKE,
    ),
    (
        10.5,
        [
            ("frame", "camera, file"),
            ("tracks", "each dot, px"),
            ("field", "shear, px"),
            ("wrench", "N, N m, cov."),
            ("filter", "predict, update"),
            ("contact", "touching, where"),
            ("outputs", "page, MCAP, ROS"),
        ],
        SENSE,
    ),
    (
        1,
        [
            ("protocol", "paths of a body"),
            ("press", "contact, friction"),
            ("render", "the camera's picture"),
            ("data set", "frames with labels"),
            ("learning", "weights"),
        ],
        SIMULATE,
    ),
)


def draw_flow(axes: Axes) -> None:
    """The three ways of the data."""
    axes.set(xlim=(0, 100), ylim=(0, 27), title="Data flow: one way")
    for height, steps, colour in FLOWS:
        chain(axes, height, steps, colour)
    axes.text(
        98, 8.3, "weights serve the wrench model; rendered frames are frames like any others", size=7.5, ha="right"
    )


def main() -> None:
    """Write the picture."""
    figure, (above, below) = plt.subplots(2, 1, figsize=(10, 7.4), height_ratios=(44, 27), layout="constrained")
    draw_layers(above)
    draw_flow(below)
    for axes in (above, below):
        axes.axis("off")
    figure.savefig(OUT, dpi=88, pil_kwargs={"optimize": True})


if __name__ == "__main__":
    main()
