"""Parts as bytes: made in another process, or kept in the cache, with their meshes.

Kernel objects cannot be pickled (they hold the history of their booleans); OCCT's own binary format of the shape can.
Every part of a group goes this way, whichever process made it, so its files are the same to the byte.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from io import BytesIO
from typing import Literal

import numpy as np
import trimesh

from cad.arm_adapter import adapter_part
from cad.base import base_part
from cad.camera import camera_part
from cad.led_ring.board import led_ring_part
from cad.lens import camera_module
from cad.mold.cup import cup_parts
from cad.mold.layout import MoldLayout
from cad.part import Part, Role
from cad.ring_spacer import ring_spacer_part
from cad.robot_sides import DEFAULT_ROBOT
from fab.cache import Cache
from fab.meshing.mesh import mesh_sha256, part_tolerance_mm
from fab.meshing.parts import PartMeshes

Group = Literal["cup", "hardware"]


@dataclass(frozen=True)
class PackedPart:
    """A part and its mesh.

    Attributes:
        name, role, material, color, quantity: those of :class:`cad.part.Part`.
        shape: the solid in OCCT's binary format.
        vertices: (n, 3) mm.
        faces: (m, 3).
        uncrossed: whether this mesh was searched for self-intersections while it was made, and has none.
    """

    name: str
    role: Role
    material: str
    color: tuple[float, float, float]
    quantity: int
    shape: bytes
    vertices: np.ndarray
    faces: np.ndarray
    uncrossed: bool

    def unpacked(self) -> tuple[Part, trimesh.Trimesh]:
        """The part, without its recipe, and its mesh."""
        from build123d import Solid
        from build123d.persistence import deserialize_shape

        solid = Solid(deserialize_shape(self.shape))
        part = Part(self.name, self.role, self.material, solid, self.color, self.quantity)
        return part, trimesh.Trimesh(self.vertices, self.faces, process=False, validate=False)


def packed_group(group: Group, layout: MoldLayout, cache: Cache | None, robot: str = DEFAULT_ROBOT) -> list[PackedPart]:
    """Make a group of parts and their meshes; those that do not change with the clearance are kept.

    Args:
        group: which.
        layout: mold sizes.
        cache: where hardware, the same at every joint clearance, is kept; ``None`` makes it anew.
        robot: what the arm adapter fits.
    """
    tolerance_mm = part_tolerance_mm(layout.params.diameter_mm)
    if group == "cup":
        return _packed(cup_parts(layout), tolerance_mm)

    def make() -> list[PackedPart]:
        params = layout.params
        made = [base_part(params), ring_spacer_part(params), adapter_part(params, robot)]
        return _packed([*made, led_ring_part(params), camera_part(params)], tolerance_mm)

    if cache is None:
        return make()
    depends_on = {"design": layout.params.digest, "tolerance_mm": tolerance_mm, "robot": robot}
    depends_on["camera"] = asdict(camera_module())
    return _kept(cache, cache.key(group, depends_on), make)


def _packed(parts: Sequence[Part], tolerance_mm: float) -> list[PackedPart]:
    from build123d.persistence import serialize_shape
    from OCP.BRepTools import BRepTools

    maker, packed = PartMeshes(tolerance_mm), []
    for part in parts:
        mesh = maker.of(part)
        BRepTools.Clean_s(part.solid.wrapped)  # the kernel's own triangles need not travel
        shape = serialize_shape(part.solid.wrapped) or b""
        points, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        uncrossed = mesh_sha256(mesh) in maker.uncrossed
        texts = part.name, part.role, part.material
        packed.append(PackedPart(*texts, part.color, part.quantity, shape, points, faces, uncrossed))
    return packed


def _kept(cache: Cache, key: str, make: Callable[[], list[PackedPart]]) -> list[PackedPart]:
    """From the cache, or made and kept there."""
    if (entry := cache.read(key)) is not None:
        files, values = entry
        return [_read(files, record) for record in values["parts"]]
    parts, files, records = make(), {}, []
    for part in parts:
        arrays = BytesIO()  # not a temporary folder: that may be full, and a killed worker would leave it behind
        np.savez(arrays, vertices=part.vertices, faces=part.faces)
        files |= {f"{part.name}.brep": part.shape, f"{part.name}.npz": arrays.getvalue()}
        texts = {"name": part.name, "role": part.role, "material": part.material}
        numbers = {"color": list(part.color), "quantity": part.quantity, "uncrossed": part.uncrossed}
        records.append(texts | numbers)
    cache.keep(key, files, {"parts": records})
    return parts


def _read(files: Mapping[str, bytes], record: dict[str, object]) -> PackedPart:
    name = str(record["name"])
    with np.load(BytesIO(files[f"{name}.npz"]), allow_pickle=False) as data:
        vertices, faces = data["vertices"], data["faces"]
    shape = files[f"{name}.brep"]
    return PackedPart(**{**record, "color": tuple(record["color"])}, shape=shape, vertices=vertices, faces=faces)  # type: ignore[arg-type]
