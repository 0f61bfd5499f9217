"""Plots of a study and of the map, as PNG inside a page."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from sensing.design.pressed import PARTS, TILTS_DEG, Study
from sensing.design.region import Place

AXES = ("fx", "fy", "fz", "tx", "ty", "tz")  # names of the wrench's axes
DPI = 110  # resolution of the plots


def load_curves(study: Study) -> str:
    """Plot of force, patch and strain by depth at three tilts."""
    figure, axes = _figure(1, 3, (11, 3.2))
    for curve in study.curves:
        label = f"{curve.tilt_deg:g}°"
        for axis, column in zip(axes, (curve.normal_n, curve.patch_mm2, 100 * curve.strain), strict=True):
            axis.plot([0, *curve.depth_mm], [0, *column], label=label)
    safe_n, why = study.safe
    axes[0].axhline(safe_n, color="0.4", lw=1, ls="--")
    axes[0].set_title(f"dashed: safe, {safe_n:.3g} N ({why})", size=9)  # beside the line the curves would cross it
    for axis, text in zip(axes, ("normal force, N", "patch, mm²", "largest strain, %"), strict=True):
        axis.set(xlabel="depth, mm", ylabel=text)
        axis.set_ylim(bottom=0)
    axes[0].legend(title="tilt", loc="upper left")
    return _png(figure)


def bound_bars(study: Study) -> str:
    """Plot of the bounds by axis, tilt and load."""
    figure, axes = _figure(1, 2, (11, 3.2))
    sigma = np.array([bound.sigma for bound in study.bounds]).reshape(len(TILTS_DEG), len(PARTS), 6)
    for k, (axis, unit) in enumerate(zip(axes, ("N", "N m"), strict=True)):
        for j in range(3):
            for p in range(len(PARTS)):
                x = np.arange(len(TILTS_DEG)) + 0.27 * (j - 1) + 0.08 * (p - 1)
                axis.bar(x, sigma[:, p, 3 * k + j], 0.07, color=f"C{j}", alpha=0.4 + 0.3 * p,
                         label=AXES[3 * k + j] if p == 1 else None)  # fmt: skip
        axis.set_xticks(range(len(TILTS_DEG)), [f"{tilt:g}°" for tilt in TILTS_DEG])
        axis.set(xlabel="tilt", ylabel=f"bound (1 sigma), {unit}")
        axis.legend(ncols=3)
    axes[0].set_title(
        "lighter to darker: " + ", ".join(f"{100 * part:g} %" for part in PARTS) + " of the range", size=9
    )
    return _png(figure)


def dots_picture(study: Study) -> str:
    """Picture of the untouched endcap's dots."""
    figure, axes = _figure(1, 1, (4.6, 3.6))
    axis = axes[0]
    pixels = study.bound.rest_px()
    axis.scatter(pixels[:, 0], pixels[:, 1], s=14, color="0.2")
    axis.set(
        xlim=(0, 640), ylim=(480, 0), aspect="equal", title=f"{len(pixels)} dots of {study.params.label}, untouched"
    )
    return _png(figure)


def map_panels(places: Sequence[Place], silicone: str) -> str:
    """Plots of range, stiffness, bound in percent of the range, mass and cost over (D, T) for one silicone."""
    own = [place for place in places if place.silicone == silicone]
    x, y = (np.array([getattr(place, name) for place in own]) for name in ("diameter_mm", "wall_mm"))
    panels = [
        ("range, N", np.array([place.range_n for place in own]), True),
        ("stiffness at 25°, N/mm", np.array([place.stiffness_n_mm for place in own]), True),
        ("bound, % of the range", np.array([100 * place.bound_n / place.range_n for place in own]), False),
        ("silicone, g", np.array([place.mass_g for place in own]), True),
        ("silicone and mold, $ (estimated)", np.array([place.cost_usd for place in own]), True),
    ]
    figure, axes = _figure(1, 5, (18, 3.6))
    for axis, (title, values, log) in zip(axes, panels, strict=True):
        levels = np.geomspace(values.min(), values.max(), 9) if log else np.linspace(values.min(), values.max(), 9)
        filled = axis.tricontourf(x, y, values, levels=levels, cmap="viridis")
        lines = axis.tricontour(x, y, values, levels=levels[1:-1:2], colors="w", linewidths=0.6)
        axis.clabel(lines, fmt=_three_digits, fontsize=7)
        figure.colorbar(filled, ax=axis, format=lambda value, _: _three_digits(value))
        axis.set(title=title, xlabel="D, mm", ylabel="T, mm")
        low = np.linspace(x.min(), x.max(), 200)
        axis.fill_between(low, low / 10, y.max() + 1, color="w", zorder=3)  # T over R / 5
        axis.set_ylim(y.min(), y.max())
        best = np.array([place.pareto for place in own])
        axis.scatter(x[best], y[best], s=6, color="r", zorder=4)
    figure.suptitle(f"{silicone} (red: Pareto front of range, bound in % of it, mass, over all silicones)", size=10)
    return _png(figure)


def _three_digits(value: float) -> str:
    """Value with three digits and without a power of ten: 0.0611, 18.1, 2503."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _figure(rows: int, columns: int, size: tuple[float, float]) -> tuple[Any, list[Any]]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(np.atleast_1d(figure.subplots(rows, columns)).ravel())


def _png(figure: Any) -> str:
    """A figure as PNG in a data address."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI)
    return "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
