"""The shell: the silicone body as cast, the reference for volume and mechanics.

The solid is the envelope of the cast with its dents, without the TPU flange. The gyroid inside the wall is a mesh, so
that its TPU is subtracted from the shell's mesh (:mod:`fab.design`). Millimetres, endcap frame.
"""

from __future__ import annotations

from build123d import Plane, Solid

from cad.mold.layout import MoldLayout
from cad.part import Part, Recipe
from cad.solids import copied, cut_holes, drill, one_solid

COLOR = (0.35, 0.72, 0.68)  # RGB, 0..1


def shell_part(layout: MoldLayout, core: Solid) -> Part:
    """Build the shell round the mold core.

    Args:
        layout: mold sizes.
        core: the whole core with bumps (:func:`cad.mold.core.core_body`).
    """
    params = layout.params
    sphere = Solid.make_sphere(params.outer_radius_mm, Plane(origin=(0, 0, params.centre_height_mm)), -90, 90, 360)
    below = drill((0, 0), 2 * params.outer_radius_mm, -2 * params.outer_radius_mm, params.flange_thickness_mm)
    solid = one_solid(cut_holes(copied(sphere), (below, core)), "shell")
    return Part("shell", "cast", "silicone", solid, COLOR, recipe=Recipe(sphere, less=(below, core)))
