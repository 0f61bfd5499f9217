"""Results that do not depend on the joint clearance, read from the cache when only the clearance has changed.

The interface's mesh depends on the two numbers alone. Checks of one part depend on its files as written, so their key
includes the files' SHA-256: an unchanged part is not checked again. The key of a file that is made from a mesh alone
includes the mesh's SHA-256.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from cad.params import EndcapParams
from fab.cache import Cache
from fab.checks.check import Check
from fab.meshing.gyroid import InterfaceMesh, interface_mesh
from fab.meshing.mesh import mesh_sha256

MESH_FILE = "mesh.npz"
SAME_AT_EVERY_CLEARANCE = ("interface", "base", "ring_spacer", "arm_adapter")


def kept_interface_mesh(
    params: EndcapParams, cache: Cache | None, flange: trimesh.Trimesh | None = None
) -> InterfaceMesh:
    """Mesh of the interface, from the cache or made and stored there.

    Args:
        params: the design.
        cache: that may hold it; ``None`` makes it again.
        flange: mesh of its flange, if that is made already.
    """
    if cache is None:
        return interface_mesh(params, flange=flange)
    key = cache.key("interface mesh", {"design": params.digest})
    if (entry := cache.read(key)) is not None:
        files, values = entry
        with np.load(BytesIO(files[MESH_FILE]), allow_pickle=False) as data:
            vertices, faces = data["vertices"].astype(np.float64), data["faces"].astype(np.int64)
        return InterfaceMesh(trimesh.Trimesh(vertices, faces, process=False, validate=False), **values)
    made = interface_mesh(params, flange=flange)
    vertices, faces = np.asarray(made.mesh.vertices), np.asarray(made.mesh.faces)
    numbers = {name: value for name, value in vars(made).items() if name != "mesh"}
    arrays = BytesIO()  # not a temporary folder: that may be full, and a killed worker would leave it behind
    np.savez(arrays, vertices=vertices, faces=faces.astype(np.int32))
    cache.keep(key, {MESH_FILE: arrays.getvalue()}, numbers)
    return made


def kept_checks(
    cache: Cache | None, what: str, inputs: Mapping[str, Any], make: Callable[[], list[Check]]
) -> list[Check]:
    """Results of checks, from the cache or made and stored there.

    Args:
        cache: that may hold them; ``None`` makes them again.
        what: name of these checks.
        inputs: all that they depend on besides the code: digests of files, numbers.
        make: makes the checks.
    """
    if cache is None:
        return make()
    key = cache.key(what, inputs)
    if (values := cache.restore(key, Path())) is not None:
        return [Check(**record) for record in values["checks"]]
    checks = make()
    cache.store(key, Path(), [], {"checks": [asdict(check) for check in checks]})
    return checks


def kept_file(
    cache: Cache | None,
    what: str,
    mesh: trimesh.Trimesh,
    path: Path,
    make: Callable[[trimesh.Trimesh, str, Path], None],
) -> None:
    """Restore a file of one mesh from the cache, or write and store it; its stem is the part's name.

    Args:
        cache: that may hold it; ``None`` writes it again.
        what: kind of file.
        mesh: of the part, mm.
        path: of the file.
        make: writes it, from the mesh, the part's name and the path.

    Raises:
        OSError: the file cannot be written.
    """
    if cache is None:
        make(mesh, path.stem, path)
        return
    key = cache.key(what, {"name": path.name, "mesh": mesh_sha256(mesh)})
    if cache.restore(key, path.parent) is None:
        make(mesh, path.stem, path)
        cache.store(key, path.parent, [path.name], {})
