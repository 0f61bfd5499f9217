"""The endcap as USD (m, kg), where ``usd-core`` is installed: shape, mass and a rigid collision sphere."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import trimesh

from sensing.simulator.robot_model.mjcf import Inertial
from sensing.simulator.robot_model.model import RobotModel

MISSING = "usd-core is not installed: no endcap.usda (pip install usd-core writes it)"


def is_installed() -> bool:
    """Whether USD's Python modules are there."""
    return find_spec("pxr") is not None


def write_usd(path: Path, model: RobotModel, whole: Inertial, drawn: Mapping[str, trimesh.Trimesh]) -> None:
    """Write one rigid body whose frame is the endcap's.

    Args:
        path: file to write, ``.usda``.
        model: sphere and friction.
        whole: mass and inertia of the endcap.
        drawn: drawn meshes, m.
    """
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics, UsdShade, Vt

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    root = UsdGeom.Xform.Define(stage, "/endcap")
    stage.SetDefaultPrim(root.GetPrim())
    UsdPhysics.RigidBodyAPI.Apply(root.GetPrim())
    mass = UsdPhysics.MassAPI.Apply(root.GetPrim())
    moments, axes = np.linalg.eigh(whole.inertia_kg_m2)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    turn = Gf.Matrix3d(*axes.T.ravel().tolist()).ExtractRotation().GetQuat()  # rows are the axes: USD's are row vectors
    mass.CreateMassAttr(whole.mass_kg)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*whole.centre_m.tolist()))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
    mass.CreatePrincipalAxesAttr(Gf.Quatf(turn))
    for name, mesh in drawn.items():
        shape = UsdGeom.Mesh.Define(stage, f"/endcap/{name}")
        shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(np.asarray(mesh.vertices, np.float32)))
        shape.CreateFaceVertexCountsAttr([3] * len(mesh.faces))
        shape.CreateFaceVertexIndicesAttr(mesh.faces.ravel().tolist())
        shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    sphere = UsdGeom.Sphere.Define(stage, "/endcap/sphere")
    sphere.CreateRadiusAttr(model.radius_m)
    sphere.AddTranslateOp().Set(Gf.Vec3d(0, 0, model.centre_m))
    sphere.CreatePurposeAttr(UsdGeom.Tokens.guide)
    UsdPhysics.CollisionAPI.Apply(sphere.GetPrim())
    skin = UsdShade.Material.Define(stage, "/endcap/silicone")
    rub = UsdPhysics.MaterialAPI.Apply(skin.GetPrim())
    rub.CreateStaticFrictionAttr(model.friction)
    rub.CreateDynamicFrictionAttr(model.friction)
    UsdShade.MaterialBindingAPI.Apply(sphere.GetPrim()).Bind(skin, materialPurpose="physics")
    root.GetPrim().CreateAttribute("endcap:says", Sdf.ValueTypeNames.String).Set(
        "rigid: the springs of endcap.xml have no form here"
    )
    path.write_text(stage.GetRootLayer().ExportToString(), encoding="utf-8")
