"""Masses, inertias and meshes of the finished endcap, from its CAD (kg, m, kg m2; endcap frame).

Volumes and moments are closed integrals over the parts' meshes (Mirtich 1996; trimesh). Densities: silicone of its row,
plastics of fab/slice/filaments.csv. A printed part is a skin and infill: its mass is that plastic, as the build sheet
estimates it, spread as the part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import trimesh

from cad.materials import silicone
from cad.mold.core import core_body
from cad.part import Part
from cad.shell import shell_part
from endcap.robot_model.fasteners import fasteners_inertial
from fab.build_sheet.plastic import estimated_part_g
from fab.cache import Cache
from fab.design_page.estimate import CAMERA_AND_RING_G
from fab.exports.preview_parts import simplified
from fab.kept import kept_interface_mesh
from fab.meshing.mesh import from_manifold, joined, tessellate, to_manifold
from fab.packed import packed_group
from fab.slice.filaments import filament
from fab.variant import Variant
from sensing.simulator.robot_model.mjcf import Bodies, Inertial
from sensing.simulator.robot_model.model import MOVING_SHARE

SHELL_TOLERANCE_MM = 0.05  # chord of the shell's mesh: its volume is then right to 0.1 %
DRAWN_TOLERANCE_MM = 0.4  # of the meshes that are drawn
M = 1e-3


@dataclass(frozen=True)
class EndcapParts:
    """What the endcap weighs and looks like.

    Attributes:
        by_part: mass, centre and inertia of each part.
        silicone: of the dome alone.
        drawn: meshes of ``base`` and ``shell``, m.
    """

    by_part: dict[str, Inertial]
    silicone: Inertial
    drawn: dict[str, trimesh.Trimesh]

    @property
    def bodies(self) -> Bodies:
        """What moves with the contact, and the rest."""
        shell = self.silicone.times(MOVING_SHARE)
        base = self.silicone.times(1 - MOVING_SHARE)
        for one in self.by_part.values():
            base = base + one
        return Bodies(base, shell)


def endcap_parts(variant: Variant, progress: Callable[[str], None]) -> EndcapParts:
    """Build or restore all parts of the finished endcap (20 seconds, most of it the gyroid; 10 once it is kept).

    Args:
        variant: the design.
        progress: called with the name of each step as it begins.
    """
    cache = Cache()
    progress("base, adapter, ring, camera")
    hardware = [part.unpacked() for part in packed_group("hardware", variant.layout, cache, variant.robot)]
    progress("shell")
    shell = tessellate(shell_part(variant.layout, core_body(variant.layout)).solid, SHELL_TOLERANCE_MM)
    progress("interface")
    interface = kept_interface_mesh(variant.params, cache).mesh
    progress("masses")
    density = silicone(variant.silicone).density_g_cm3
    gyroid, flange = to_manifold(interface).split_by_plane((0.0, 0.0, 1.0), variant.params.flange_thickness_mm)
    dome = solid_inertial(shell, density) + solid_inertial(from_manifold(gyroid), density).times(-1)
    masses = {"interface": solid_inertial(interface, filament("TPU 95A").density_g_cm3)}
    masses |= _printed(hardware) | _bought(hardware)
    meshes = {part.name: mesh for part, mesh in hardware} | {"interface": interface}
    masses["fasteners"] = fasteners_inertial(variant.params, meshes)
    rigid = [*(mesh for _, mesh in hardware), from_manifold(flange)]
    drawn = {
        "base": joined([simplified(mesh, DRAWN_TOLERANCE_MM) for mesh in rigid]),
        "shell": simplified(shell, DRAWN_TOLERANCE_MM),
    }
    return EndcapParts(masses, dome, {name: _in_metres(mesh) for name, mesh in drawn.items()})


def solid_inertial(mesh: trimesh.Trimesh, density_g_cm3: float) -> Inertial:
    """Mass, centre and inertia of a closed mesh.

    Args:
        mesh: closed surface, mm.
        density_g_cm3: density of the body.
    """
    found = trimesh.Trimesh(mesh.vertices * M, mesh.faces, process=False, validate=False).mass_properties
    density = density_g_cm3 * 1000
    return Inertial(
        float(found["volume"]) * density, np.asarray(found["center_mass"]), np.asarray(found["inertia"]) * density
    )


def printed_inertial(part: Part, mesh: trimesh.Trimesh) -> Inertial:
    """Mass, centre and inertia of a printed part: the plastic of skin and infill, spread over its volume.

    Args:
        part: of the endcap.
        mesh: its closed surface in the endcap frame, mm.
    """
    plastic = estimated_part_g(part.name, part.material, mesh)
    return solid_inertial(mesh, plastic / (float(mesh.volume) / 1000))


def _printed(parts: list[tuple[Part, trimesh.Trimesh]]) -> dict[str, Inertial]:
    return {part.name: printed_inertial(part, mesh) for part, mesh in parts if part.role == "printed"}


def _bought(parts: list[tuple[Part, trimesh.Trimesh]]) -> dict[str, Inertial]:
    """Camera and ring, whose mass together is known to some grams: spread over their volume."""
    bought = {part.name: mesh for part, mesh in parts if part.role == "bought"}
    density = CAMERA_AND_RING_G * 1000 / sum(float(mesh.volume) for mesh in bought.values())
    return {name: solid_inertial(mesh, density) for name, mesh in bought.items()}


def _in_metres(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.asarray(mesh.vertices) * M, mesh.faces, process=False, validate=False)
