"""Variant of a design: D and T, joint clearance of the printer, silicone, robot and camera.

The folder of a variant names everything that differs from the default, so no variant overwrites another.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from cad.data_table import file_name
from cad.lens import camera_module, camera_setting, other_module
from cad.materials import DEFAULT_SILICONE
from cad.mold.layout import JOINT_CLEARANCE_MM, MoldLayout
from cad.params import EndcapParams
from cad.plain_numbers import plain
from cad.robot_sides import DEFAULT_ROBOT, robot_side


@dataclass(frozen=True)
class Variant:
    """Variant that one export folder contains.

    Attributes:
        layout: design, joint clearance and silicone.
        robot: pattern of ``cad/robot_sides.csv`` that the arm adapter has.

    Raises:
        ParameterError: an unknown robot.
    """

    layout: MoldLayout
    robot: str = DEFAULT_ROBOT

    def __post_init__(self) -> None:
        robot_side(self.robot)

    @property
    def params(self) -> EndcapParams:
        """The design."""
        return self.layout.params

    @property
    def silicone(self) -> str:
        """Name of a row of ``cad/materials.csv``."""
        return self.layout.silicone

    @property
    def label(self) -> str:
        """Name of the folder: ``D130_T8``, ``D130_T8_c0.2``, ``D130_T8_Dragon-Skin-30``, ``D130_T8_blank``.

        The camera module named by the environment is part of it, too.
        """
        parts = [self.params.label]
        if self.layout.joint_clearance_mm != JOINT_CLEARANCE_MM:
            parts.append(f"c{plain(self.layout.joint_clearance_mm)}")
        if self.silicone != DEFAULT_SILICONE:
            parts.append(file_name(self.silicone))
        if self.robot != DEFAULT_ROBOT:
            parts.append(file_name(self.robot))
        return "_".join((*parts, *camera_words()))

    @property
    def identity(self) -> dict[str, Any]:
        """All parameters of the variant, for digests."""
        return {
            "design": self.params.digest,
            "joint_clearance_mm": self.layout.joint_clearance_mm,
            "silicone": self.silicone,
            "robot": self.robot,
            "camera": asdict(camera_module()),
        }

    @property
    def words(self) -> str:
        """The options that name this variant on a command line."""
        words = [size_words(self.params)]
        words += [f"{name}={value}" for name, value in self.params.option_words.items()]
        if self.layout.joint_clearance_mm != JOINT_CLEARANCE_MM:
            words.append(f"joint_clearance={plain(self.layout.joint_clearance_mm)}")
        if self.silicone != DEFAULT_SILICONE:
            words.append(f"material={shlex.quote(self.silicone)}")
        if self.robot != DEFAULT_ROBOT:
            words.append(f"robot={shlex.quote(self.robot)}")
        return " ".join(words)

    def command(self, target: str) -> str:
        """A command of make for the variant: ``make slice D=130 T=8``, with the camera module named by the environment.

        Args:
            target: of make.
        """
        return f"{camera_setting()}make {target} {self.words}"


def size_words(params: EndcapParams) -> str:
    """The options of diameter and wall: ``D=130 T=8``."""
    return f"D={plain(params.diameter_mm)} T={plain(params.wall_mm)}"


def coupons_command(silicone: str) -> str:
    """The command that makes the coupons, with the trays of a silicone's bond specimens.

    Args:
        silicone: name of a row of ``cad/materials.csv``.
    """
    return "make coupons" + ("" if silicone == DEFAULT_SILICONE else f" material={shlex.quote(silicone)}")


def printer_option(name: str) -> str:
    """The option of a printer, quoted for a shell.

    Args:
        name: of the printer.
    """
    return f"printer={shlex.quote(name)}"


def variant_of(params: EndcapParams, manifest: Mapping[str, Any]) -> Variant:
    """The variant of an export, from its manifest.

    Args:
        params: the design.
        manifest: as read; older ones name no robot, which then is the default.

    Raises:
        KeyError, TypeError, ValueError: the manifest is not one of an export.
        ParameterError: the variant cannot be made.
    """
    layout = MoldLayout(params, float(manifest["joint_clearance_mm"]), str(manifest["silicone"]))
    return Variant(layout, str(manifest.get("robot", DEFAULT_ROBOT)))


def camera_words() -> tuple[str, ...]:
    """Suffix of a folder's name for another camera module than the released one; empty for that one."""
    name = other_module()
    return (file_name(name),) if name else ()
