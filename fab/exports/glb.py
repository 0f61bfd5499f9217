"""Meshes as one GLB (glTF 2.0) with names and colours, in metres with y up, as the standard requires.

The meshes are those of the files, so that the interface includes its gyroid, which as a solid would have a hundred
thousand faces; the STEP assemblies contain its flange and the gyroid's envelope instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import trimesh

from cad.whole_file import replace_file
from fab.design import Design
from fab.exports.preview import METRE, Y_UP, linear_color


def write_glb(
    design: Design, names: Sequence[str], offsets: Mapping[str, tuple[float, float, float]], path: Path
) -> None:
    """Write parts of a design in place, or displaced.

    Args:
        design: design with parts and meshes.
        names: names of the parts to write.
        offsets: displacement (x, y, z) of parts by name, endcap frame, mm; the others stay in place.
        path: the file.

    Raises:
        FileError: the file could not be written.
    """
    scene = trimesh.Scene()
    for name in names:
        mesh = design.meshes[name]
        points = METRE * (np.asarray(mesh.vertices) + np.array(offsets.get(name, (0.0, 0.0, 0.0)))) @ Y_UP.T
        copy = trimesh.Trimesh(points, mesh.faces, process=False, validate=False)
        color = [*(linear_color(np.array(design.parts[name].color)).tolist()), 1.0]
        material = trimesh.visual.material.PBRMaterial(
            name=name, baseColorFactor=color, metallicFactor=0.0, roughnessFactor=0.7, doubleSided=False
        )
        copy.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(copy, node_name=name, geom_name=name)
    replace_file(path, scene.export(file_type="glb"), "choose a folder with room")
