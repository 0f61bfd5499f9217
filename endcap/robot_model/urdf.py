"""The endcap as URDF (m, kg): shape, mass and a rigid collision sphere; URDF has no springs."""

from __future__ import annotations

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

from sensing.simulator.robot_model.mjcf import Inertial
from sensing.simulator.robot_model.model import RobotModel


def endcap_urdf(model: RobotModel, whole: Inertial, meshes: Mapping[str, str], title: str) -> str:
    """One link whose frame is the endcap's: origin at the centre of the mating plane, z to the tip.

    Args:
        model: sphere and friction.
        whole: mass and inertia of the endcap.
        meshes: files of the drawn bodies.
        title: name of the robot.
    """
    i, centre = whole.inertia_kg_m2, " ".join(f"{value:.7g}" for value in whole.centre_m)
    tensor = " ".join(
        f'{name}="{value:.7g}"'
        for name, value in (
            ("ixx", i[0, 0]), ("iyy", i[1, 1]), ("izz", i[2, 2]), ("ixy", i[0, 1]), ("ixz", i[0, 2]), ("iyz", i[1, 2]),
        )
    )  # fmt: skip
    drawn = "".join(
        f"<visual name={quoteattr(name)}><geometry><mesh filename={quoteattr(file)}/></geometry></visual>\n"
        for name, file in meshes.items()
    )
    return (
        f'<?xml version="1.0"?>\n<!-- Rigid: the springs of endcap.xml have no form in URDF. m, kg. -->\n'
        f'<robot name={quoteattr(title)}>\n<link name="endcap">\n<inertial><origin xyz="{centre}"/>'
        f'<mass value="{whole.mass_kg:.6g}"/><inertia {tensor}/></inertial>\n{drawn}'
        f'<collision name="sphere"><origin xyz="0 0 {model.centre_m:.6g}"/><geometry>'
        f'<sphere radius="{model.radius_m:.6g}"/></geometry></collision>\n</link>\n</robot>\n'
    )
