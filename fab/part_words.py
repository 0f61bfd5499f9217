"""Purposes of parts and joints in plain words, for the bill of materials and the build sheet."""

from __future__ import annotations

import re

from cad.params import EndcapParams

PARTS = {  # name without its number -> purpose
    "cup_bowl": "mold: outside of the dome, from the tip to its widest section",
    "cup_collar": "mold: outside of the dome, from its widest section to the rim",
    "core_centre": "mold: inside of the dome; the piece that comes out first",
    "core_key": "mold: inside of the dome; parallel sides, out second",
    "core_wedge": "mold: inside of the dome; tapered, out last",
    "hanger": "mold: holds core and interface in the cup",
    "interface": "endcap: joins dome and base; silicone fills its gyroid",
    "base": "endcap: carries camera and LED ring",
    "ring_spacer": "endcap: holds the LED ring in the base",
    "arm_adapter": "endcap: from the base to the robot",
    "camera": "sees the dots from inside the dome",
    "led_ring": "lights the dome from inside",
}
WORKSHOP = {  # things without a line in the bill, as named in the steps -> description
    "gyroid": "curved TPU sheet on the interface's flange; silicone runs through it and locks",
    "dam": "wall round the bowl above its seam; keeps in the silicone that rises while the mold closes",
    "piston": "end of the collar that slides into the dam, down to the bowl's seam",
    "seam": "where pieces of the mold meet; alone, that of bowl and collar",
    "vent": "hole through the hanger, through which air and surplus silicone leave",
    "well": "wider mouth of a vent on the hanger's outside; silicone in it shows that the mold is full",
    "upper half": "hanger, collar, interface and core, screwed together",
    "flash": "thin silicone that crept between pieces of the mold; it is cut off",
    "gore": "strip of the dome's inner surface, from the tip outward, drawn flat",
}


def part_words(name: str) -> str:
    """Purpose of a part; its name in plain words where the table does not have it.

    Args:
        name: of a part, such as ``core_key_2``.
    """
    return PARTS.get(re.sub(r"_\d+$", "", name), name.replace("_", " "))


def height_words(params: EndcapParams, unit: str = "") -> str:
    """Text on the height of the cast silicone, without and with the flange of the interface below it.

    Args:
        params: the design.
        unit: after each number.
    """
    flange, tip = params.flange_thickness_mm, params.tip_height_mm
    return f"{tip - flange:.1f}{unit} high as cast; {tip:.1f}{unit} with the interface's flange of {flange:g}{unit}"


def joint_words(name: str) -> str:
    """The two parts of a joint: ``hanger to core`` for ``hanger_to_core_key_1``, the same for all joints of a kind.

    Args:
        name: of the joint.
    """
    kind = re.sub(r"core_[a-z]+|cup_|_\d+", lambda match: "core" if match[0].startswith("core") else "", name)
    return kind.replace("_", " ")
