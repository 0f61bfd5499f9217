"""Meshes as one GLB (glTF 2.0): named, coloured, in metres with y up, as the standard asks.

The meshes are those of the files, so the interface comes with its gyroid, which as a solid would have a hundred
thousand faces; the STEP assemblies hold its flange and the gyroid's envelope instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import trimesh

from cad.whole_file import replace_file
from fab.design import Design

METRE = 1e-3
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # endcap's z becomes glTF's y


def write_glb(
    design: Design, names: Sequence[str], offsets: Mapping[str, tuple[float, float, float]], path: Path
) -> None:
    """Write parts of a design in place, or displaced by offsets (mm).

    Raises:
        FileError: the file could not be written.
    """
    scene = trimesh.Scene()
    for name in names:
        mesh = design.meshes[name]
        points = METRE * (np.asarray(mesh.vertices) + np.array(offsets.get(name, (0.0, 0.0, 0.0)))) @ Y_UP.T
        copy = trimesh.Trimesh(points, mesh.faces, process=False, validate=False)
        color = [*(_linear(np.array(design.parts[name].color)).tolist()), 1.0]
        material = trimesh.visual.material.PBRMaterial(
            name=name, baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.7, doubleSided=False
        )
        copy.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(copy, node_name=name, geom_name=name)
    replace_file(path, scene.export(file_type="glb"), "choose a folder with room")


def _linear(color: np.ndarray) -> np.ndarray:
    """A colour as shown on a screen (sRGB, IEC 61966-2-1) to the linear one that glTF holds."""
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
