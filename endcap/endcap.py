"""Class of one endcap: solids, files, simulator, and running sensor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cad.identity import Identity, identity
from cad.materials import DEFAULT_SILICONE, silicone
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_GYROID, RELEASED_RINGS, parse_rings

if TYPE_CHECKING:
    from cad.mold.layout import MoldLayout
    from endcap.simulator import Simulator
    from endcap.solid import TwoKernelSolid
    from sensing.design.report import Report
    from sensing.live.core.model import LiveModel
    from sensing.live.endcap import Endcap as RunningEndcap


@dataclass(frozen=True)
class Endcap:
    """An endcap of outer diameter D and wall T; solids are built on first access (seconds each), and kept.

    Args:
        diameter_mm: D.
        wall_mm: T.
        silicone: of the shell, a row of cad/materials.csv.
        joint_clearance_mm: gap of the mold's joints on your printer; None for the default.
        dots: dots of each ring from tip to equator, as in 1-6-10-12-16-18; empty for the released ones.
        dot_mm: diameter of a dot.
        gyroid: fraction of TPU in the gyroid zone; simulator and running sensor do not depend on it.

    Raises:
        ParameterError: a size that cannot be made, an unknown silicone, or a value of a wrong type.
    """

    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    silicone: str = DEFAULT_SILICONE
    joint_clearance_mm: float | None = None
    dots: str = ""
    dot_mm: float = RELEASED_DOT_MM
    gyroid: float = RELEASED_GYROID

    def __post_init__(self) -> None:
        silicone(self.silicone)
        _ = self.params if self.joint_clearance_mm is None else self.layout

    @cached_property
    def params(self) -> EndcapParams:
        """Every derived size, mm."""
        rings = RELEASED_RINGS if self.dots == "" else parse_rings(self.dots)
        return EndcapParams(self.diameter_mm, self.wall_mm, rings, self.dot_mm, self.gyroid)

    @cached_property
    def layout(self) -> MoldLayout:
        """Sizes of the mold, mm."""
        from cad.mold.layout import JOINT_CLEARANCE_MM, MoldLayout

        gap = self.joint_clearance_mm
        return MoldLayout(self.params, JOINT_CLEARANCE_MM if gap is None else gap, self.silicone)

    @property
    def identity(self) -> Identity:
        """Identity written into the files that are made for it."""
        return identity(self.params, self.silicone)

    @cached_property
    def shell(self) -> TwoKernelSolid:
        """The silicone shell as the mold makes it, without the gyroid's imprint."""
        from cad.shell import shell_part

        return _solid(shell_part(self.layout, self._core))

    @cached_property
    def mold(self) -> dict[str, TwoKernelSolid]:
        """Cup, core and hanger, piece by piece in their casting positions; names are those of the files."""
        from cad.hanger import hanger_part
        from cad.mold.core import core_parts
        from cad.mold.cup import cup_parts

        parts = [*cup_parts(self.layout), *core_parts(self.layout, self._core), hanger_part(self.layout)]
        return {part.name: _solid(part) for part in parts}

    @cached_property
    def interface(self) -> TwoKernelSolid:
        """The TPU interface's flange; its gyroid exists as a mesh only (:meth:`export`)."""
        from cad.interface import build_interface

        return _solid(build_interface(self.params))

    @cached_property
    def base(self) -> TwoKernelSolid:
        """The rigid base with camera pocket and lugs."""
        from cad.base import base_part

        return _solid(base_part(self.params))

    def export(self, exports: str | Path = "exports", use_cache: bool = True) -> Path:
        """Make, check and write all files, as ``endcap molds`` does; nothing is written where a check fails.

        Args:
            exports: folder that receives ``D130_T8/`` or alike.
            use_cache: whether unchanged files of earlier runs are taken.

        Returns:
            The folder that was written.

        Raises:
            ChecksFailedError: a check failed.
            FileError: the folder cannot be written.
        """
        from fab.molds import export
        from fab.variant import Variant

        return export(Variant(self.layout), Path(exports), use_cache).folder

    def study(self, export: str | Path | None = None) -> Report:
        """Predicted figures with their sources, before anything is printed, as ``endcap study``.

        ``study()["silicone_g"].value``, ``study().write("out")`` (:class:`sensing.design.report.Report`).

        Args:
            export: folder of its files (:meth:`export`); if they are sliced, printing is measured, not estimated.
        """
        from sensing.design.pressed import Study
        from sensing.design.prints import prints_of
        from sensing.design.report import Report

        return Report(Study(self.params, self.silicone), prints_of(self.params, Path(export)) if export else None)

    def simulator(self, density: str = "data", level: int = 2) -> Simulator:
        """Its simulator (:class:`endcap.simulator.Simulator`)."""
        from endcap.simulator import Simulator

        return Simulator(self, density, level)

    def live(
        self, source: str = "scene:0", zero: str | Path | None = None, model: LiveModel | None = None
    ) -> RunningEndcap:
        """The running sensor; use as a context manager (:class:`sensing.live.endcap.Endcap`).

        Args:
            source: camera number, http address, video, folder of pictures, or ``scene:0`` to ``scene:5``.
            zero: reference file; None to use the first frames, of the untouched endcap.
            model: of the wrench (:func:`sensing.live.core.model.live_model`); None for the weights that ship.

        Raises:
            EndcapError: a source, file or design that cannot be used.
        """
        from sensing.live.endcap import open_endcap

        params = self.params
        return open_endcap(
            source, zero, diameter_mm=params.diameter_mm, wall_mm=params.wall_mm, silicone=self.silicone,
            dots=self.dots, dot_mm=params.dot_mm, model=model,
        )  # fmt: skip

    @cached_property
    def _core(self) -> Any:
        from cad.mold.core import core_body

        return core_body(self.layout)


def _solid(part: Any) -> TwoKernelSolid:
    from endcap.solid import TwoKernelSolid

    return TwoKernelSolid.of(part)
