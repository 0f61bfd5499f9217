"""One variant of a design: the two numbers, the joint clearance of your printer, and the silicone.

The folder of a variant names everything that differs from the default, so no variant overwrites another.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass

from cad.materials import DEFAULT_SILICONE
from cad.mold_layout import JOINT_CLEARANCE_MM, MoldLayout
from cad.params import EndcapParams
from cad.plain_numbers import plain


@dataclass(frozen=True)
class Variant:
    """What one export folder holds.

    Attributes:
        layout: the two numbers and the joint clearance.
        silicone: name of a row of ``cad/materials.csv``.
    """

    layout: MoldLayout
    silicone: str = DEFAULT_SILICONE

    @property
    def params(self) -> EndcapParams:
        """The two numbers."""
        return self.layout.params

    @property
    def label(self) -> str:
        """Name of the folder: ``D130_T8``, ``D130_T8_c0.2``, ``D130_T8_Dragon-Skin-30``."""
        parts = [self.params.label]
        if self.layout.joint_clearance_mm != JOINT_CLEARANCE_MM:
            parts.append(f"c{plain(self.layout.joint_clearance_mm)}")
        if self.silicone != DEFAULT_SILICONE:
            parts.append(file_name(self.silicone))
        return "_".join(parts)

    @property
    def identity(self) -> dict[str, float | str]:
        """Everything that makes this variant what it is, for digests."""
        return {
            "design": self.params.digest,
            "joint_clearance_mm": self.layout.joint_clearance_mm,
            "silicone": self.silicone,
        }

    @property
    def words(self) -> str:
        """The options that name this variant on a command line."""
        words = [f"D={plain(self.params.diameter_mm)}", f"T={plain(self.params.wall_mm)}"]
        if self.layout.joint_clearance_mm != JOINT_CLEARANCE_MM:
            words.append(f"joint_clearance={plain(self.layout.joint_clearance_mm)}")
        if self.silicone != DEFAULT_SILICONE:
            words.append(f"material={shlex.quote(self.silicone)}")
        return " ".join(words)


def file_name(text: str) -> str:
    """Words as part of a file name."""
    return re.sub(r"[^A-Za-z0-9.-]+", "-", text)
