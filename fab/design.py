"""One endcap, built: every part as a solid, every printed or cast part as a mesh.

The gyroid, which needs no CAD kernel but half of the time, is made in a second process beside the solids.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import trimesh

from cad.arm_adapter import adapter_part
from cad.base import base_part
from cad.camera import camera_part
from cad.hanger import hanger_part
from cad.interface import build_interface
from cad.led_ring import led_ring_part
from cad.mold_core import core_body, core_parts
from cad.mold_cup import cup_parts
from cad.mold_layout import MoldLayout
from cad.params import EndcapParams
from cad.part import Part
from cad.ring_spacer import ring_spacer_part
from cad.shell import shell_part
from fab.cache import Cache
from fab.kept import kept_interface_mesh
from fab.meshing.gyroid import InterfaceMesh, joint_band_mm, volume_above
from fab.meshing.mesh import TOLERANCE_MM, from_manifold, to_manifold
from fab.meshing.parts import PartMeshes
from fab.meshing.repair import without_crossings

Progress = Callable[[str], None]
PRODUCT = ("shell", "interface", "base", "ring_spacer", "led_ring", "camera", "arm_adapter")  # what the robot carries


@dataclass(frozen=True)
class Design:
    """Everything that is made for one pair of parameters.

    Attributes:
        layout: sizes, with ``layout.params``.
        parts: all parts by name; mold first, then the endcap from the tip down.
        meshes: closed meshes by part name; that of ``interface`` has the gyroid, that of ``shell`` its imprint.
        gyroid: how the gyroid came out.
    """

    layout: MoldLayout
    parts: dict[str, Part]
    meshes: dict[str, trimesh.Trimesh]
    gyroid: InterfaceMesh

    @property
    def params(self) -> EndcapParams:
        """The two numbers."""
        return self.layout.params

    @property
    def mold(self) -> dict[str, trimesh.Trimesh]:
        """Meshes of cup, core and hanger."""
        return {name: self.meshes[name] for name in self.parts if name.startswith(("cup_", "core_", "hanger"))}


def build_solids(layout: MoldLayout, progress: Progress) -> dict[str, Part]:
    """Build every part as a solid, shared bodies once."""
    progress("core")
    core = core_body(layout)
    parts = core_parts(layout, core)
    progress("cup")
    parts = [*cup_parts(layout), *parts, hanger_part(layout)]
    progress("shell")
    parts.append(shell_part(layout, core))
    progress("interface, base, hardware")
    makers = (build_interface, base_part, ring_spacer_part, adapter_part, led_ring_part, camera_part)
    parts.extend(make(layout.params) for make in makers)
    return {part.name: part for part in parts}


def build_design(
    layout: MoldLayout,
    workers: Executor,
    progress: Progress,
    tolerance_mm: float = TOLERANCE_MM,
    cache: Cache | None = None,
) -> Design:
    """Build solids and meshes.

    Args:
        layout: the two numbers and the joint clearance.
        workers: where the gyroid is made, while this process makes the solids.
        progress: called with the name of each step as it begins.
        tolerance_mm: chord tolerance of the meshes.
        cache: where the interface's mesh is kept from run to run.
    """
    pending = workers.submit(kept_interface_mesh, layout.params, cache)
    parts = build_solids(layout, progress)
    progress("meshes")
    maker = PartMeshes(tolerance_mm)
    meshes = {name: maker.of(part) for name, part in parts.items() if name != "interface"}
    progress("gyroid")
    gyroid = pending.result()
    meshes["interface"] = gyroid.mesh
    imprinted = from_manifold(to_manifold(meshes["shell"]) - to_manifold(gyroid.mesh))
    meshes["shell"] = without_crossings(imprinted, joint_band_mm(layout.params.flange_thickness_mm))
    return Design(layout, parts, {name: meshes[name] for name in parts}, gyroid)


def mesh_volume_mm3(design: Design, name: str) -> float:
    """Volume that a part's mesh should have, from its solid; for the shell, less the gyroid that it flows round."""
    volume = float(design.parts[name].solid.volume)
    if name == "shell":
        volume -= volume_above(design.meshes["interface"], design.params.flange_thickness_mm)
    return volume
