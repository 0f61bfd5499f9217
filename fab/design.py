"""One endcap, built: every part as a solid, every printed or cast part as a mesh.

Gyroid, cup, hardware and the imprint are made in other processes beside the core.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

import trimesh

from cad.hanger import hanger_part
from cad.interface import build_interface
from cad.mold.core import core_body, core_parts
from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from cad.part import Part
from cad.robot_sides import DEFAULT_ROBOT
from cad.shell import shell_part
from fab.cache import Cache
from fab.kept import kept_interface_mesh
from fab.meshing.gyroid import InterfaceMesh, joint_band_mm, volume_above
from fab.meshing.mesh import from_manifold, mesh_sha256, part_tolerance_mm, tessellate, to_manifold
from fab.meshing.parts import PartMeshes
from fab.meshing.repair import without_crossings
from fab.packed import packed_group

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
        plain_shell: the shell before the gyroid's imprint, which nobody sees from outside.
        robot: what the arm adapter fits.
        uncrossed: SHA-256 of meshes that were searched for self-intersections while they were made, and have none.
    """

    layout: MoldLayout
    parts: dict[str, Part]
    meshes: dict[str, trimesh.Trimesh]
    gyroid: InterfaceMesh
    plain_shell: trimesh.Trimesh
    robot: str = DEFAULT_ROBOT
    uncrossed: frozenset[str] = frozenset()

    @property
    def params(self) -> EndcapParams:
        """The two numbers."""
        return self.layout.params

    @cached_property
    def solid_mm3(self) -> dict[str, float]:
        """Volume of each part's solid, by name: asked for by checks and manifest, integrated once."""
        return {name: float(part.solid.volume) for name, part in self.parts.items()}

    @property
    def mold(self) -> dict[str, trimesh.Trimesh]:
        """Meshes of cup, core and hanger."""
        return {name: self.meshes[name] for name in self.parts if name.startswith(("cup_", "core_", "hanger"))}


def build_core_solids(layout: MoldLayout, progress: Progress) -> list[Part]:
    """Build the core, and what shares its body or is soon made."""
    core = core_body(layout)
    parts = [*core_parts(layout, core), hanger_part(layout)]
    progress("shell, interface")
    return [*parts, shell_part(layout, core)]


def build_design(
    layout: MoldLayout,
    workers: Executor,
    progress: Progress,
    cache: Cache | None = None,
    robot: str = DEFAULT_ROBOT,
) -> Design:
    """Build solids and meshes.

    Args:
        layout: the two numbers and the joint clearance.
        workers: where gyroid, cup, hardware and imprint are made, while this process makes the core.
        progress: called with the name of each step as it begins.
        cache: where what does not change with the clearance is kept from run to run.
        robot: pattern of ``cad/robot_sides.csv``.
    """
    cup = workers.submit(packed_group, "cup", layout, cache, robot)
    hardware = workers.submit(packed_group, "hardware", layout, cache, robot)
    progress("core")
    interface = build_interface(layout.params)  # first: the gyroid's mesh waits for the flange, the imprint for that
    flange = tessellate(interface.solid)  # not of a copy, which the kernel triangulates otherwise
    pending = workers.submit(kept_interface_mesh, layout.params, cache, flange)
    parts = [*build_core_solids(layout, progress), interface]
    progress("meshes")
    maker, meshes = PartMeshes(part_tolerance_mm(layout.params.diameter_mm)), {}
    core, shell = parts[0], next(part for part in parts if part.name == "shell")
    for part in (core, shell):  # in this order: the core's body is meshed as a body before the shell takes it as a tool
        meshes[part.name] = maker.of(part)
    plain, gyroid = meshes["shell"], pending.result()
    imprint = workers.submit(imprinted, plain, gyroid.mesh, joint_band_mm(layout.params.flange_thickness_mm))
    meshes |= {part.name: maker.of(part) for part in parts if part.name not in (core.name, "shell", "interface")}
    meshes["interface"] = gyroid.mesh
    progress("cup, gyroid, base, hardware")
    made, uncrossed = {}, set(maker.uncrossed)
    for group in (cup, hardware):
        unpacked = [packed.unpacked() for packed in group.result()]
        meshes |= {part.name: mesh for part, mesh in unpacked}
        uncrossed |= {mesh_sha256(meshes[packed.name]) for packed in group.result() if packed.uncrossed}
        made[group] = [part for part, _ in unpacked]
    progress("shell with the gyroid's imprint")
    meshes["shell"] = imprint.result()
    ordered = {part.name: part for part in (*made[cup], *parts, *made[hardware])}
    meshes = {name: meshes[name] for name in ordered}
    return Design(layout, ordered, meshes, gyroid, plain, robot, frozenset(uncrossed))


def imprinted(plain: trimesh.Trimesh, gyroid: trimesh.Trimesh, band_mm: tuple[float, float]) -> trimesh.Trimesh:
    """The shell's mesh with the gyroid's imprint, in another process while the core is meshed.

    Args:
        plain: mesh of the shell.
        gyroid: mesh of the interface.
        band_mm: heights between which faces may cross.
    """
    return without_crossings(from_manifold(to_manifold(plain) - to_manifold(gyroid)), band_mm)


def mesh_volume_mm3(design: Design, name: str) -> float:
    """Volume that a part's mesh should have, from its solid; for the shell, less the gyroid that it flows round."""
    volume = design.solid_mm3[name]
    if name == "shell":
        volume -= volume_above(design.meshes["interface"], design.params.flange_thickness_mm)
    return volume
