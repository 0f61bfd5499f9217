"""Excluded rectangle of a bed: its distance from a part, and how far lines extend into it. Millimetres.

The X1 Carbon cuts filament there. A rectangle is (low x, low y, high x, high y) from the corner of the bed.
"""

from __future__ import annotations

import itertools

import numpy as np

Rectangle = tuple[float, float, float, float]


def read_rectangle(text: str) -> Rectangle | None:
    """Read a rectangle from a cell such as ``0|0|18|28``; ``None`` for an empty one.

    Args:
        text: of the cell.

    Raises:
        ValueError: the cell does not have four numbers, or the rectangle has no area.
    """
    if not text:
        return None
    try:
        low_x, low_y, high_x, high_y = (float(part) for part in text.split("|"))
    except ValueError:
        low_x = high_x = low_y = high_y = 0.0
    if not (0 <= low_x < high_x and 0 <= low_y < high_y):
        raise ValueError(f"exclude={text!r} is no rectangle low x|low y|high x|high y in mm, such as 0|0|18|28")
    return low_x, low_y, high_x, high_y


def corners(rectangle: Rectangle) -> tuple[tuple[float, float], ...]:
    """Corners of a rectangle, counter-clockwise from the lowest."""
    low_x, low_y, high_x, high_y = rectangle
    return (low_x, low_y), (high_x, low_y), (high_x, high_y), (low_x, high_y)


def outline(points: np.ndarray) -> np.ndarray:
    """Corners (m, 2) of the convex hull of points (n, 2), counter-clockwise."""
    from scipy.spatial import ConvexHull  # the table of printers is read before any command handles Ctrl-C

    return np.asarray(points[ConvexHull(points).vertices])


def gap_mm(hull: np.ndarray, rectangle: Rectangle) -> float:
    """Width of the widest straight strip between a convex hull and a rectangle; negative where they overlap.

    Args:
        hull: (m, 2) its corners, counter-clockwise.
        rectangle: of the bed.
    """
    sides = np.roll(hull, -1, axis=0) - hull
    outward = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    beyond = (np.array(corners(rectangle)) @ outward.T).min(axis=0) - (hull * outward).sum(axis=1)
    low, high = hull.min(axis=0), hull.max(axis=0)
    beside = np.concatenate([low - rectangle[2:], np.array(rectangle[:2]) - high])
    return float(max(beyond.max(), beside.max()))


def reach_mm(start: np.ndarray, end: np.ndarray, half_width_mm: float, rectangle: Rectangle) -> float:
    """Largest depth to which straight lines extend into a rectangle, mm; 0 where none does.

    Args:
        start: (n, 2) of the lines.
        end: (n, 2) of the lines.
        half_width_mm: of a line.
        rectangle: of the bed.
    """
    low, high = np.array(rectangle[:2]) - half_width_mm, np.array(rectangle[2:]) + half_width_mm
    near = (np.minimum(start, end) < high).all(axis=1) & (np.maximum(start, end) > low).all(axis=1)
    if not near.any():
        return 0.0
    at_start, at_end = (np.concatenate([ends - low, high - ends], axis=1) for ends in (start[near], end[near]))
    change, deepest = at_end - at_start, 0.0
    # The depth is the least of four linear functions along a line: its maximum is at an end, or where two are equal.
    shares = [np.zeros(len(change)), np.ones(len(change))]
    for i, j in itertools.combinations(range(4), 2):
        apart, closing = at_start[:, i] - at_start[:, j], change[:, j] - change[:, i]
        shares.append(np.clip(np.divide(apart, closing, out=np.zeros(len(change)), where=closing != 0), 0.0, 1.0))
    for share in shares:
        deepest = max(deepest, float((at_start + share[:, None] * change).min(axis=1).max()))
    return deepest
