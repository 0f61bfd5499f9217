"""Pictures of the LED ring: the board from its fabrication files, and its light on the dome."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from shapely.geometry.base import BaseGeometry

from cad.led_ring.placement import Placement
from fab.led_ring.copper import polygons
from fab.led_ring.light import DomeLight
from fab.led_ring.rules import Holes, Layers, envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MASK, COPPER, SOLDER, INK, HOLE = "#1c6b45", "#2f8a5e", "#d9c27a", "#ffffff", "#202020"
DPI = 100


def draw_board(layers: Layers, holes: Holes, places: Sequence[Placement], path: Path) -> None:
    """Draw both sides, each seen from outside, and the driver enlarged with the names of its parts.

    Args:
        layers: areas by layer, mm.
        holes: (x, y, diameter) of each, mm.
        places: parts of the board.
        path: of the file.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 10.5))
    grid = figure.add_gridspec(2, 2, height_ratios=(1.35, 1), left=0.02, right=0.98, top=0.96, bottom=0.02, hspace=0.06)
    top, bottom, close = (figure.add_subplot(cell) for cell in (grid[0, 0], grid[0, 1], grid[1, :]))
    for axes, side, title in (
        (top, "top", "LED side"),
        (bottom, "bottom", "back"),
        (close, "top", "driver, with the outlines of its parts"),
    ):
        _side(axes, layers, holes, side)
        axes.set_title(title)
    bottom.invert_xaxis()
    for place in places:
        if place.side == "top":
            _fill(close, envelope(place), fc="none", ec="black", lw=1.0)
            close.annotate(
                place.reference, place.centre_mm, ha="center", va="center", fontsize=11, color="black", clip_on=True
            )
    close.set_xlim(-20, 9)
    close.set_ylim(27.5, 39.5)
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def draw_light(light: DomeLight, label: str, path: Path) -> None:
    """Draw the light over the visible dome, seen along the axis (radius is the polar angle).

    Args:
        light: on the dome.
        label: first words of the title.
        path: of the file.
    """
    from matplotlib.figure import Figure
    from matplotlib.patheffects import withStroke

    figure = Figure(figsize=(11, 4.8), layout="constrained")
    dome = figure.add_subplot(1, 2, 1, projection="polar")
    azimuth = np.radians(np.append(light.azimuth_deg, 360.0))
    relative = np.column_stack([light.total, light.total[:, :1]]) / light.mean
    picture = dome.pcolormesh(azimuth, light.polar_deg, relative, cmap="inferno", shading="gouraud")
    figure.colorbar(picture, ax=dome, label="irradiance over its mean")
    dome.set_title(f"{label}: darkest {light.darkest:.2f}, brightest {light.brightest:.2f} of the mean", fontsize=10)
    dome.set_xticklabels([])
    dome.tick_params(axis="y", labelsize=8)
    for degrees in dome.get_yticklabels():  # readable on dark and bright colours
        degrees.set_path_effects([withStroke(linewidth=2.5, foreground="white")])
    curve = figure.add_subplot(1, 2, 2)
    for name, field in (("with scattered light", light.total), ("direct", light.direct)):
        middle = field.mean(axis=1)
        scale = middle.max()
        line = curve.plot(light.polar_deg, middle / scale, label=name)[0]
        low, high = field.min(axis=1) / scale, field.max(axis=1) / scale
        curve.fill_between(light.polar_deg, low, high, color=line.get_color(), alpha=0.25)
    curve.set_xlabel("polar angle from the tip, degrees")
    curve.set_ylabel("irradiance, each curve over its largest mean")
    curve.set_title(f"mean and span round each circle; largest half swing {100 * light.ripple:.0f} %", fontsize=10)
    curve.set_ylim(0, None)
    curve.legend()
    figure.savefig(path, dpi=DPI, metadata={"Software": None})


def _side(axes: Axes, layers: Layers, holes: Holes, side: str) -> None:
    letter = "F" if side == "top" else "B"
    face = layers["Edge_Cuts"]
    _fill(axes, face, fc=MASK, ec="none")
    _fill(axes, layers[f"{letter}_Cu"], fc=COPPER, ec="none")
    _fill(axes, layers[f"{letter}_Mask"] & layers[f"{letter}_Cu"], fc=SOLDER, ec="none")
    _fill(axes, layers[f"{letter}_Silk"], fc=INK, ec="none")
    for x, y, diameter in holes:
        axes.add_patch(_circle(x, y, diameter / 2))
    left, low, right, high = face.bounds
    axes.set_xlim(left - 1, right + 1)
    axes.set_ylim(low - 1, high + 1)
    axes.set_aspect("equal")
    axes.axis("off")


def _circle(x: float, y: float, radius: float) -> Any:
    from matplotlib.patches import Circle

    return Circle((x, y), radius, fc=HOLE, ec="none")


def _fill(axes: Axes, shape: BaseGeometry, **style: Any) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Curve

    for part in polygons(shape):
        rings = [Curve(np.asarray(ring.coords)) for ring in (part.exterior, *part.interiors)]
        axes.add_patch(PathPatch(Curve.make_compound_path(*rings), **style))
