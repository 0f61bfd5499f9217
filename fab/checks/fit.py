"""Checks of fit: screw axes, joint clearances, and the printer's limits on overhangs and on the bed.

Screw axes are read from the cylinders of the solids, which show the actual position of a hole. Millimetres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, cKDTree

from cad.mold.layout import MoldLayout
from cad.part import Part
from cad.solids import drill, intersected
from fab.checks.cavity import cavity_faces
from fab.checks.check import Check

if TYPE_CHECKING:
    from build123d import Solid

AXIS_MM = 0.05  # accuracy to which the released patterns are known
CLEARANCE_MM = 0.001  # largest accepted deviation of a joint clearance
MOST_EDGE_MM = 0.005  # largest accepted tolerance of the kernel's edges
ROUNDING_MM = 1e-7  # of the kernel's points
BED_MM = 256.0  # side of the print bed
MAX_OVERHANG_DEG = 45.0  # printed without support


def screw_axis_checks(parts: Sequence[Part], layout: MoldLayout) -> list[Check]:
    """Check of each part's ten screw axes: largest distance from the nominal ones; a missing hole gives a large one."""
    params = layout.params
    angles = np.radians(params.screw_azimuths_deg)
    wanted = params.screw_circle_radius_mm * np.column_stack([np.cos(angles), np.sin(angles)])
    checks = []
    for part in parts:
        axes = upright_axes(part.solid, 1.7)
        worst = float(cKDTree(axes).query(wanted)[0].max()) if len(axes) else float("inf")
        checks.append(Check(f"{part.name}.screw_axis_error_mm", worst, high=AXIS_MM))
    return checks


def upright_axes(solid: Solid, radius_mm: float) -> np.ndarray:
    """Axes (n, 2) of the cylindrical faces of a radius that are parallel to z, mm."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_Cylinder

    axes = []
    for face in solid.faces():
        surface = BRepAdaptor_Surface(face.wrapped)
        if surface.GetType() != GeomAbs_Cylinder or abs(surface.Cylinder().Radius() - radius_mm) > 1e-6:
            continue
        axis = surface.Cylinder().Axis()
        if abs(axis.Direction().Z()) > 1 - 1e-9:
            axes.append((axis.Location().X(), axis.Location().Y()))
    return np.array(axes).reshape(-1, 2)


def clearance_checks(layout: MoldLayout, solids: Mapping[str, Solid]) -> list[Check]:
    """Checks of the least gap between the solids of mated printed pieces, against the joint clearance.

    Where the gap ends on an edge, the edge's tolerance is allowed in addition: the kernel's curve of intersection of a
    cone and a sphere deviates from both by up to its tolerance, 0.001 mm at D=126.92, although the gap between the
    surfaces is exact.
    """
    nominal, flange = layout.joint_clearance_mm, layout.params.flange_thickness_mm
    below = drill((0.0, 0.0), 2 * layout.params.outer_radius_mm, 0.0, flange - 0.5)  # above it, the ramp is nearer
    neck, bore = (intersected(solids[name], below, name) for name in ("core_key_1", "interface"))
    pairs = {
        "bowl": (solids["cup_bowl_1"], solids["cup_bowl_2"]),
        "collar": (solids["cup_collar_1"], solids["cup_collar_2"]),
        "core_key": (solids["core_centre"], solids["core_key_1"]),
        "core_wedge": (solids["core_centre"], solids["core_wedge_1"]),
        "core_side": (solids["core_key_1"], solids["core_wedge_1"]),
        "core_bore": (neck, bore),
    }
    checks = []
    for name, (first, second) in pairs.items():
        gap, edge = _gap_mm(first, second)
        allowed = CLEARANCE_MM + min(edge, MOST_EDGE_MM)
        checks.append(Check(f"joint_{name}.gap_mm", gap, nominal - allowed, nominal + allowed))
    return checks


def _gap_mm(first: Solid, second: Solid) -> tuple[float, float]:
    """Least distance, and the tolerance of the edges and corners between which it lies (0 between faces), mm.

    It is measured between the surfaces, which takes half of the time that the kernel needs for the same distance
    between solids: there it also asks of every corner whether it lies in the other solid. Of surfaces that do not meet
    one corner each is enough (:func:`_one_in_other`).
    """
    from build123d import Compound
    from OCP.BRep import BRep_Tool
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopoDS import TopoDS

    as_its_kind = {TopAbs_ShapeEnum.TopAbs_EDGE: TopoDS.Edge_s, TopAbs_ShapeEnum.TopAbs_VERTEX: TopoDS.Vertex_s}
    surfaces = (Compound(solid.shells()).wrapped for solid in (first, second))
    found = BRepExtrema_DistShapeShape(*surfaces)
    allowed = 0.0
    for number in range(1, found.NbSolution() + 1):
        ends = found.SupportOnShape1(number), found.SupportOnShape2(number)
        bounds = [as_its_kind[end.ShapeType()](end) for end in ends if end.ShapeType() in as_its_kind]
        allowed = max(allowed, sum(BRep_Tool.Tolerance_s(bound) for bound in bounds))
    nested = found.Value() > 0 and (_one_in_other(first, second) or _one_in_other(second, first))
    return 0.0 if nested else found.Value(), allowed


def _one_in_other(first: Solid, second: Solid) -> bool:
    """Whether a shell of the first solid lies in the second one; their surfaces do not meet."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.TopAbs import TopAbs_State

    classify = BRepClass3d_SolidClassifier(second.wrapped)
    for shell in first.shells():
        classify.Perform(BRep_Tool.Pnt_s(shell.vertices()[0].wrapped), ROUNDING_MM)
        if classify.State() == TopAbs_State.TopAbs_IN:
            return True
    return False


def bed_check(name: str, mesh: trimesh.Trimesh) -> Check:
    """Check of the smallest square bed for the part, turned about z, and of its height, against the printer's room."""
    plan = np.asarray(mesh.vertices)[:, :2]
    corners = plan[ConvexHull(plan).vertices]  # the hull of the body in space takes ten times as long
    angles = np.radians(np.arange(0.0, 90.0, 1.0))
    turned = np.stack([np.cos(angles), np.sin(angles)])
    across = corners @ turned
    along = corners @ np.stack([-turned[1], turned[0]])
    side = np.maximum(np.ptp(across, axis=0), np.ptp(along, axis=0)).min()
    return Check(f"{name}.bed_mm", float(max(side, np.ptp(mesh.vertices[:, 2]))), high=BED_MM)


def overhang_check(layout: MoldLayout, name: str, mesh: trimesh.Trimesh) -> Check:
    """Check of the steepest overhang in the cavity of a cup segment in its printing pose.

    Bowl segments are printed dome-down on their foot, collar segments on the mating plane.

    Args:
        layout: mold sizes.
        name: name of the segment.
        mesh: mesh of the segment, endcap frame, mm.
    """
    up = -1.0 if name.startswith("cup_bowl") else 1.0
    down = -up * mesh.face_normals[cavity_faces(layout, mesh), 2]
    return Check(
        f"{name}.overhang_deg", float(np.degrees(np.arcsin(np.clip(down.max(), -1, 1)))), high=MAX_OVERHANG_DEG
    )
