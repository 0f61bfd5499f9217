"""Rendered frames with the interface of every other source of frames.

    source = RenderedSource(DomeRenderer(params), [None, press_mm, 2 * press_mm])
    for frame in source: ...                     # sensing.records.Frame, as from a camera

Input is displacement fields of the inner surface (mm, endcap frame) from any mechanics. Times count from zero at the
frame rate; nothing downstream can distinguish such a frame from a camera's.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from numpy.typing import ArrayLike

from cad.errors import ParameterError
from sensing.records import Frame
from sensing.simulator.render.dome import DomeRenderer


class RenderedSource:
    """Frames of a rendered dome.

    Args:
        renderer: renderer with endcap, camera, paint and lamp.
        displacements_mm: one (n, 3) per frame at the renderer's surface nodes; None for the undeformed dome.
        rate_hz: frame rate of the capture times, Hz.
        name: name of the source in the frames.

    Raises:
        ParameterError: the rate is not positive.
    """

    def __init__(
        self,
        renderer: DomeRenderer,
        displacements_mm: Iterable[ArrayLike | None],
        rate_hz: float = 30.0,
        name: str = "simulated endcap",
    ) -> None:
        if not rate_hz > 0:
            raise ParameterError(f"rate_hz={rate_hz}: must be over 0", name="rate_hz", value=rate_hz)
        self.name = name
        self._renderer, self._displacements_mm, self._rate_hz = renderer, displacements_mm, rate_hz

    def __iter__(self) -> Iterator[Frame]:
        for index, displacement_mm in enumerate(self._displacements_mm):
            image = self._renderer.render(displacement_mm, frame=index).image_bgr
            yield Frame(index / self._rate_hz, index, self.name, image=image)
