"""The hanger: a plate on the collar that holds TPU interface and core concentric with the interface's ten screws.

It is on top while the silicone is poured dome-down. Its holes over the flange's notches are vents; silicone in the ten
wells round them shows that the mold is full. Millimetres, endcap frame, casting position.
"""

from __future__ import annotations

from cad.fasteners import ScrewJoint
from cad.mold.cup import BOWL
from cad.mold.layout import PIN_DEPTH_MM, PIN_PLAY_MM, PIN_SOCKET_RADIUS_MM, MoldLayout, rotated
from cad.part import Part
from cad.solids import cut_holes, drill, fused, one_solid

SCREW_HOLE_RADIUS_MM = 1.7  # S: M3 clearance, as in the base
VENT_RADIUS_MM = 1.75  # of the holes over the flange's notches
WELL_RADIUS_MM = 3.5  # of a vent's wider mouth
WELL_DEPTH_MM = 4.0  # of that mouth, from the hanger's outside
CAP_SCREW = "ISO 4762 cap screw, steel"
COLOR = (0.55, 0.75, 0.45)  # RGB, 0..1


def screw_joints(layout: MoldLayout) -> tuple[ScrewJoint, ...]:
    """Screw joints of the hanger: ten screws into the interface's nuts, six into the collar, eight into the core."""
    params = layout.params
    circle = tuple(rotated((params.screw_circle_radius_mm, 0), a) for a in params.screw_azimuths_deg)
    collar = {
        f"cup_collar_{k + 1}": tuple(
            rotated((layout.collar_screw_circle_radius_mm, 0), a)
            for a in layout.bolt_azimuths_deg
            if (a - seam) % 360.0 < 120.0
        )
        for k, seam in enumerate(layout.collar_seams_deg)
    }
    held = {"interface": circle} | collar | layout.core_screws_mm
    return tuple(_joint(anchor, places) for anchor, places in held.items())


def _joint(anchor: str, places: tuple[tuple[float, float], ...]) -> ScrewJoint:
    return ScrewJoint(
        name=f"hanger_to_{anchor}",
        owner="hanger",
        thread="screw_m3",
        standard=CAP_SCREW,
        step="casting",
        places=places,
        up=True,
        seat="hanger",
        through=("hanger",),
        anchor=anchor,
        holder="captured nut" if anchor == "interface" else "plastic",
        beyond=BOWL if anchor.startswith("cup_") else (),
    )


def hanger_part(layout: MoldLayout) -> Part:
    """Build the hanger."""
    params, bottom = layout.params, -layout.hanger_thickness_mm
    plate = drill((0, 0), layout.hanger_radius_mm, bottom, 0.0)
    pins = [
        drill(
            rotated((layout.pin_circle_radius_mm, 0), azimuth),
            PIN_SOCKET_RADIUS_MM - layout.joint_clearance_mm,
            -1.0,
            PIN_DEPTH_MM - PIN_PLAY_MM,
        )
        for azimuth in layout.bowl_seams_deg
    ]
    places = [rotated((params.screw_circle_radius_mm, 0), a) for a in params.screw_azimuths_deg]
    places += [rotated((layout.collar_screw_circle_radius_mm, 0), a) for a in layout.bolt_azimuths_deg]
    places += [place for piece in layout.core_screws_mm.values() for place in piece]
    holes = [drill(place, SCREW_HOLE_RADIUS_MM, bottom - 1, 1.0) for place in places]
    for azimuth in layout.vent_azimuths_deg:
        place = rotated((layout.vent_circle_radius_mm, 0), azimuth)
        holes.append(drill(place, VENT_RADIUS_MM, bottom - 1, 1.0))
        holes.append(drill(place, WELL_RADIUS_MM, bottom - 1, bottom + WELL_DEPTH_MM))
    solid = one_solid(cut_holes(fused(plate, pins), holes), "hanger")
    return Part("hanger", "printed", "PLA", solid, COLOR)
