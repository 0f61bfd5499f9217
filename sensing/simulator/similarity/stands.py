"""The simulated robot of any size: the scene of D=130 T=8 with all lengths scaled, its loads within the weights' range.

    scene, weight_n = robot_of(EndcapParams(180, 10), "Smooth-Sil 950")

The robot is a scaled copy: bars, rings and centre of mass scale with R, so that every endcap meets the ground at the
same tilt. Its weight scales with the endcaps' loads (:class:`LoadScale`), such that the largest load corresponds to the
released 35 N: the robot of 12 kg presses with up to 52 N.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cad.materials import silicone
from cad.params import EndcapParams
from sensing.simulator.levels import Simulator
from sensing.simulator.render.mesh import surface_mesh
from sensing.simulator.render.settings import RenderSettings
from sensing.simulator.robot import scene as released
from sensing.simulator.robot.scene import RobotScene, assemble_scene
from sensing.simulator.robot.statics import WEIGHT_N
from sensing.simulator.similarity.library import load_library
from sensing.simulator.similarity.paths import load_share, plan
from sensing.simulator.similarity.ratios import (
    REFERENCE_RADIUS_MM,
    LoadScale,
    ShellRatios,
    about,
    common_order,
    wrench_units,
)
from sensing.simulator.solid.element import Array
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import turn_wrench


def robot_of(params: EndcapParams, silicone_name: str) -> tuple[RobotScene, float]:
    """(scene of a robot of this size, its weight in N).

    Args:
        params: design of its six endcaps.
        silicone_name: row of cad/materials.csv.
    """
    geometry = shell_geometry(params.diameter_mm, params.wall_mm)
    law = silicone(silicone_name).neo_hooke()
    surface = Simulator(geometry, law).surface
    states = load_library().stands(ShellRatios.of(geometry))
    radius, units = geometry.outer_radius_mm, wrench_units(geometry.outer_radius_mm, law.shear_mpa)
    order = common_order(geometry, surface.position)
    nodes = surface_mesh(params, RenderSettings().at_level("draft").mesh).vertices_mm
    to_nodes = surface.interpolation(nodes)
    fields, wrenches = np.empty_like(states.surface), about(states.wrench * units, -np.array(geometry.centre_mm))
    fields[:, order] = states.surface * radius
    wrenches[:, 3:] /= 1000
    solved, count = {}, len(released.SHARES)
    for number, place in enumerate(plan().places()):
        rows = slice(number * count, (number + 1) * count)
        azimuth = plan().path(*place)[1]
        solved[place] = np.array([to_nodes @ field for field in fields[rows]]), turn_wrench(wrenches[rows], azimuth)
    placed = replace(plan(), T_robot_endcap=_screwed_on(params))
    weight_n = WEIGHT_N * load_share() * LoadScale.of(geometry, law.shear_mpa).force
    return assemble_scene(placed, solved), weight_n


def _screwed_on(params: EndcapParams) -> Array:
    """(6, 4, 4) T_robot_endcap of the scaled robot, mm: the spheres' centres scale with R."""
    poses = plan().T_robot_endcap.copy()
    outward = poses[:, :3, 2]
    centres = poses[:, :3, 3] + outward * released.PARAMS.centre_height_mm
    factor = params.outer_radius_mm / REFERENCE_RADIUS_MM
    poses[:, :3, 3] = factor * centres - outward * params.centre_height_mm
    return poses
