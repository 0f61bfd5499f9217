"""The shells of the library: where in the valid region of (D, T) they lie (mm). Only their ratios count."""

from __future__ import annotations

NODES: tuple[tuple[float, float], ...] = (
    (250.0, 6.5),
    (250.0, 25.0),
    (121.0, 6.5),
    (125.0, 12.5),
    (165.0, 11.0),
    (99.0, 6.5),
    (250.0, 10.0),
    (165.0, 6.5),
    (165.0, 16.5),
    (100.0, 10.0),
    (110.0, 8.5),
    (250.0, 15.0),
    (121.0, 9.0),
    (110.0, 6.5),
    (108.0, 10.8),
)  # corners first, so that a library of the first ones already spans the region
