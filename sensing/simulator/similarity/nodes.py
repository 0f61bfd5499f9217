"""The shells of the library: their (D, T), mm, in the valid region. Only their ratios matter."""

from __future__ import annotations

Design = tuple[float, float]
# (D, T) of each node, mm.
NODES: tuple[Design, ...] = (
    (250.0, 6.5),
    (250.0, 25.0),
    (165.0, 6.5),
    (121.0, 6.5),
    (125.0, 12.5),
    (110.0, 8.5),
    (99.0, 6.5),
    (100.0, 10.0),
    (165.0, 11.0),
    (104.0, 6.5),
    (200.0, 16.0),
    (104.5, 10.4),
)
SOME_PATHS: dict[Design, tuple[int, ...]] = {  # near its snap level 1 has to solve most states: one path a tilt
    (250.0, 6.5): (0, 4, 8, 9, 13, 17, 18, 22)
}


def file_name(part: str, design: Design) -> str:
    """Name of a solved node's file.

    Args:
        part: ``node`` or ``stands``.
        design: D and T, mm.
    """
    return f"{part}_D{design[0]:g}_T{design[1]:g}.npz"
