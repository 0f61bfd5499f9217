"""Shared sizes of the mold's cup, core and hanger (standard library only).

The mold is described in the endcap frame, in its position round the finished part. It is used dome-down: +z points to
the floor while silicone is poured, and "below the equator" in the workshop is z > seam here.

    bowl    lower half, z from the equator seam to the foot; a dam stands above the seam and holds the silicone that
            rises in the last millimetres of closing
    collar  upper half, from the equator seam to the mating plane; slides into the dam like a piston
    hanger  plate on the collar that carries TPU interface and core
    core    seven pieces: a centre with three jigsaw tabs, three keys with parallel sides, three tapered wedges

Bowl segments are removed toward the dome, collar segments toward the rim. Both narrow away from the equator, so that
neither has an undercut, although the shell is wider at its equator than at its rim.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cad import feasible, leak
from cad.errors import ParameterError
from cad.materials import DEFAULT_SILICONE, silicone, silicones
from cad.params import EndcapParams
from cad.plain_numbers import plain

JOINT_CLEARANCE_MM = 0.15  # E: gap on each side of a printed joint; the fit coupon shows the printer's own
JOINT_CLEARANCE_RANGE_MM = (0.05, 0.30)  # the steps of the fit coupon (cad.coupons)
NECK_FILLET_MM = 0.6  # E: rounds the inner corners of drafted tabs
TAB_BEYOND_RATIO = 0.62  # E: distance of a core tab's centre beyond the edge, over its radius: locks, and prints
CORE_NECK_HALF_MM = 1.6  # E: half the least neck of a core tab: eight lines of a 0.4 mm nozzle across it
PILOT_RADIUS_MM = 1.3  # S: hole for an M3 screw that cuts its thread in PLA
CORE_SCREW_INSIDE_MM = PILOT_RADIUS_MM + 1.5  # E: of axes inside the exit circle: 2 mm of PLA to the cavity
CORE_SCREW_TURNS_DEG = (-8.0, 0.0, 8.0)  # E: of pieces 1, 2, 3, whose bumps differ; >= 4.9 mm: none fits elsewhere
FLANGE_TAB_OFFSET_MM = 13.7  # outward from the outer sphere; clear of the dam, of which a tab would take a sliver
FLANGE_TAB_RADIUS_MM, FLANGE_TAB_BEYOND_MM = 3.5, 2.2  # the jigsaw tab in the bolt flanges of bowl and collar
COLLAR_TIP_MM, TIP_HOLE_DEPTH_MM = 9.0, 1.0  # least collar that holds its screws' tips; holes below a lower one
PIN_SOCKET_RADIUS_MM = 3.0  # the hanger's pins are smaller by the joint clearance
LEAST_WALL_MM = 1.2  # E: PLA between pin socket and cavity, and beyond a screw: three lines of a 0.4 mm nozzle
PIN_DEPTH_MM, PIN_PLAY_MM = 4.5, 0.5  # depth of the sockets for the hanger's pins; play at a pin's end
LEAST_STEP_MM = 2.0  # E: a lower step would leave a film of PLA over the bolts' spot faces


@dataclass(frozen=True)
class MoldLayout:
    """Derived sizes of the mold for one endcap (mm, endcap frame).

    Attributes:
        params: parameters of the endcap.
        joint_clearance_mm: gap on each side of a joint, mm.
        silicone: row of ``cad/materials.csv``; one of lower viscosity needs tighter joints and a thicker bowl.

    Raises:
        ParameterError: the silicone is not in the table, or the joint clearance lies outside
            :func:`joint_clearance_range_mm`.
    """

    params: EndcapParams
    joint_clearance_mm: float = JOINT_CLEARANCE_MM
    silicone: str = DEFAULT_SILICONE

    def __post_init__(self) -> None:
        row = silicone(self.silicone)
        gap = feasible.real_number("joint_clearance", self.joint_clearance_mm, "millimetres a side, for example 0.15")
        object.__setattr__(self, "joint_clearance_mm", gap)
        low, high = joint_clearance_range_mm(self.params, row.name)
        if not low <= self.joint_clearance_mm <= high:
            where = f"D={plain(self.params.diameter_mm)} T={plain(self.params.wall_mm)} in {row.name}"
            if high < low:
                raise ParameterError(_no_joint_message(self.params, where, high), name="material", value=row.name)
            raise ParameterError(
                f"joint_clearance={plain(self.joint_clearance_mm)} outside {low:g}..{high:g} mm a side at {where} "
                f"({row.viscosity_pa_s:g} Pa s): tighter joints fuse in print, looser ones leak more than 1 % of the "
                f"silicone; nearest valid choice joint_clearance={min(max(low, self.joint_clearance_mm), high):g}; "
                "measure yours with the fit coupon (make coupons); where it needs a wider one, correct the slicer's "
                "horizontal expansion and print the coupon again",
                name="joint_clearance",
                value=self.joint_clearance_mm,
            )

    # --- cup --------------------------------------------------------------------------------------------------
    @property
    def seam_height_mm(self) -> float:
        """Height of the seam of bowl and collar: the equator, the widest section, so that neither has an undercut."""
        return self.params.centre_height_mm

    @property
    def dam_top_mm(self) -> float:
        """Height z of the dam's edge: closing stroke and margin from the seam toward the rim (lower z)."""
        return self.seam_height_mm - feasible.dam_height_mm(self.params.diameter_mm, self.params.wall_mm)

    @property
    def bolt_flange_mm(self) -> float:
        """Thickness of each bolt flange."""
        return feasible.BOLT_FLANGE_MM

    @property
    def collar_flange_top_mm(self) -> float:
        """Height of the collar flange's upper side; 0, the mating plane, where it comes nearer than a step to it."""
        top = self.dam_top_mm - self.bolt_flange_mm
        return top if top > LEAST_STEP_MM else 0.0

    @property
    def piston_radius_mm(self) -> float:
        """Outer radius of the collar where it slides into the dam: 5 mm of PLA outside the silicone."""
        return self.params.outer_radius_mm + 5.0

    @property
    def dam_radius_mm(self) -> float:
        """Outer radius of the dam."""
        return self.params.outer_radius_mm + 10.0

    @property
    def bolt_circle_radius_mm(self) -> float:
        """Radius of the circle of the six M4 bolts: an 11 mm spot face clears the dam by half a mm."""
        return self.params.outer_radius_mm + 16.0

    @property
    def flange_radius_mm(self) -> float:
        """Outer radius of the bolt flanges: 2.75 mm of PLA outside the bolt holes."""
        return self.params.outer_radius_mm + 21.0

    @property
    def bolt_azimuths_deg(self) -> tuple[float, ...]:
        """Azimuths of the six bolts, two per segment of bowl and collar, which tie it to two of the other half."""
        return tuple(30.0 + 60.0 * k for k in range(6))

    @property
    def bowl_wall_mm(self) -> float:
        """Thickness of the bowl outside the silicone: the length of the leakage path through a joint."""
        return leak.bowl_wall_mm(self.params, silicone(self.silicone), self.joint_clearance_mm)

    @property
    def stand_height_mm(self) -> float:
        """Height z of the plane on which the mold stands: 2 mm beyond the bowl's own wall."""
        return self.params.tip_height_mm + self.bowl_wall_mm + 2.0

    @property
    def foot_radius_mm(self) -> float:
        """Radius of the foot: there the bowl's outside would begin to overhang by more than 45 degrees when printed."""
        return (self.params.outer_radius_mm + self.bowl_wall_mm) * math.sin(math.radians(45.0))

    @property
    def bowl_seams_deg(self) -> tuple[float, float, float]:
        """Azimuths of the bowl's three jigsaw seams."""
        return (0.0, 120.0, 240.0)

    @property
    def collar_seams_deg(self) -> tuple[float, float, float]:
        """Azimuths of the collar's seams, staggered so that bolts connect each segment to two of the other half."""
        return (60.0, 180.0, 300.0)

    # --- hanger -----------------------------------------------------------------------------------------------
    @property
    def collar_screw_depth_mm(self) -> float:
        """Depth of the pilot holes for the M3 screws from hanger to collar; they go through a low collar."""
        roof = self.seam_height_mm - LEAST_WALL_MM
        return min(12.0, roof) if roof >= COLLAR_TIP_MM else 12.0

    @property
    def collar_screw_circle_radius_mm(self) -> float:
        """Radius of the circle of these screws: 1.7 mm of PLA to the cavity at the bottom of the pilot (radius 1.3).

        In a collar lower than the pilot, the middle of the piston's 5 mm: 1.2 mm of PLA on either side."""
        return min(self.params.outer_radius_at(self.collar_screw_depth_mm) + 3.0, self.params.outer_radius_mm + 2.5)

    @property
    def collar_tip_depth_mm(self) -> float:
        """Depth of the holes in the bowl's seat for the tips of these screws; 0 where the collar is high enough (the
        longest M3 x 16, the shortest size that holds, ends 8.75 mm above the hanger)."""
        return TIP_HOLE_DEPTH_MM if self.seam_height_mm < COLLAR_TIP_MM else 0.0

    @property
    def pin_circle_radius_mm(self) -> float:
        """Radius of the circle of the hanger's pins: that of the collar's screws; larger in a low collar (D < 103.7).

        There a pin's socket, which is wider than a pilot hole, would break into the cavity on the screws' circle.
        """
        cavity = self.params.outer_radius_at(PIN_DEPTH_MM)  # widest at the socket's floor
        return max(self.collar_screw_circle_radius_mm, cavity + LEAST_WALL_MM + PIN_SOCKET_RADIUS_MM)

    @property
    def hanger_radius_mm(self) -> float:
        """Outer radius of the hanger, which covers the heads of its screws and carries its pins."""
        return self.pin_circle_radius_mm + 4.5

    @property
    def hanger_thickness_mm(self) -> float:
        """Thickness (E): stiff against viscous silicone; a standard M3 x 12 holds all of the nut, ends in its hole."""
        return 7.6

    @property
    def vent_circle_radius_mm(self) -> float:
        """Radius of the circle of the vents, which continue the notches in the edge of the TPU flange."""
        return self.params.rim_radius_mm - 0.75

    @property
    def vent_azimuths_deg(self) -> tuple[float, ...]:
        """Azimuths of the vents, between the nuts."""
        return tuple(36.0 * k for k in range(10))

    # --- core -------------------------------------------------------------------------------------------------
    @property
    def neck_radius_mm(self) -> float:
        """Radius of the core in the bore of the TPU flange: the bore's less the joint clearance."""
        return self.params.bore_radius_mm - self.joint_clearance_mm

    @property
    def ramp_deg(self) -> float:
        """Slope of the silicone fillet from bore to inner sphere, which lets pieces start inward and upward."""
        return 30.0

    @property
    def exit_radius_mm(self) -> float:
        """Radius of the circle through which every core piece must pass: the narrowest opening less half a mm."""
        return min(self.neck_radius_mm, self.params.opening_radius_mm) - 0.5

    @property
    def centre_inradius_mm(self) -> float:
        """Distance of the keys' inner faces from the axis."""
        return 0.6 * self.exit_radius_mm

    @property
    def centre_short_inradius_mm(self) -> float:
        """Distance of the wedges' inner faces from the axis, which follows from the corners of the hexagon."""
        return 0.5 * self.centre_inradius_mm + math.sqrt(0.75) * self.key_half_width_mm

    @property
    def key_half_width_mm(self) -> float:
        """Half the width of a key: so wide that the wedges between the keys pass the opening."""
        return 0.58 * self.exit_radius_mm

    @property
    def core_tab_radius_mm(self) -> float:
        """Radius of the centre piece's jigsaw tabs, one into each key (the keys hold the wedges between them).

        The draft narrows a tab's neck toward the tip (by 8 mm at D=250). Between its fillets (radius f, centres at
        +-y) half a neck is y - f - taper, with y^2 = (r + f)^2 - (b r - f)^2 and b = :data:`TAB_BEYOND_RATIO`. Solved
        for r, so that :data:`CORE_NECK_HALF_MM` remain at the tip of every size; at least 4 mm.
        """
        y = CORE_NECK_HALF_MM + NECK_FILLET_MM + self._core_taper_mm
        a, half_b = 1 - TAB_BEYOND_RATIO**2, NECK_FILLET_MM * (1 + TAB_BEYOND_RATIO)
        return max(4.0, (math.sqrt(half_b**2 + a * y**2) - half_b) / a)

    @property
    def core_tab_beyond_mm(self) -> float:
        """Distance of a tab's centre beyond the long edge that carries it."""
        return TAB_BEYOND_RATIO * self.core_tab_radius_mm

    @property
    def _core_taper_mm(self) -> float:
        """Reduction of the centre piece's width on each side from the mating plane to the height of the tip."""
        return self.params.tip_height_mm * math.tan(math.radians(self.core_draft_deg))

    @property
    def core_draft_deg(self) -> float:
        """Draft of the centre piece: one degree, the least at which a long printed prism comes loose."""
        return 1.0

    @property
    def core_screws_mm(self) -> dict[str, tuple[tuple[float, float], ...]]:
        """Axes (x, y) of the M3 screws from hanger to core, by piece; a thick wall moves them inward."""
        farthest = self.exit_radius_mm - CORE_SCREW_INSIDE_MM
        key_x = min(farthest, (self.centre_inradius_mm + 2 * self.core_tab_radius_mm + self.neck_radius_mm) / 2)
        wedge_x = min(farthest, (self.centre_short_inradius_mm + self.neck_radius_mm) / 2)
        places: dict[str, tuple[tuple[float, float], ...]] = {"core_centre": ((10.0, 0.0), (-10.0, 0.0))}
        for k, (azimuth, turn) in enumerate(zip(self.key_azimuths_deg, CORE_SCREW_TURNS_DEG, strict=True), 1):
            places[f"core_key_{k}"] = (rotated((key_x, 0.0), azimuth + turn),)
            places[f"core_wedge_{k}"] = (rotated((wedge_x, 0.0), azimuth + turn + 60.0),)
        return places

    @property
    def key_azimuths_deg(self) -> tuple[float, float, float]:
        """Directions of the three keys; the wedges lie 60 degrees further."""
        return (0.0, 120.0, 240.0)


def joint_clearance_range_mm(params: EndcapParams, material: str = DEFAULT_SILICONE) -> tuple[float, float]:
    """Range of joint clearances of a size, mm on each side: the fit coupon's, limited by the leak of the bowl.

    The upper limit is below the lower one where even the tightest joint that a printer can separate leaks too much.
    """
    low, high = JOINT_CLEARANCE_RANGE_MM
    return low, min(high, math.floor(leak.widest_joint_mm(params, silicone(material)) * 1000) / 1000)


def _no_joint_message(params: EndcapParams, where: str, widest_mm: float) -> str:
    """Message for a size at which no joint that a printer can separate is tight enough for the silicone."""
    low = JOINT_CLEARANCE_RANGE_MM[0]
    holding = [name for name in silicones() if joint_clearance_range_mm(params, name)[1] >= low]
    return (
        f"{where}: joints would have to be {widest_mm:g} mm, below the {low:g} that a printer can part; choose a "
        f"smaller D or material={' or '.join(repr(name) for name in holding) or 'a thicker one'}"
    )


def rotated(point: tuple[float, float], azimuth_deg: float) -> tuple[float, float]:
    """Rotate a point (x, y) about the axis, counter-clockwise seen from +z."""
    c, s = math.cos(math.radians(azimuth_deg)), math.sin(math.radians(azimuth_deg))
    return (c * point[0] - s * point[1], s * point[0] + c * point[1])
