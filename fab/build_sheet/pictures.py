"""Pictures of the build sheet: the meshes of the parts in the state of each step, from the step's viewpoint.

Endcap frame, millimetres. Where the work is done dome-down, the picture shows it dome-down, with -z up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from cad.arm_adapter import arm_places_mm
from cad.base import ARM_INSERT_RADIUS_MM
from cad.bought import bought_mm
from cad.dots import dot_pattern, dot_position_mm
from cad.fasteners import ScrewJoint
from cad.interface import POCKET_FLOOR_MM
from cad.mold.layout import MoldLayout
from fab.checks.extraction import Leg
from fab.checks.screw_fit import ScrewFit
from fab.meshing.mesh import from_manifold, joined, to_manifold
from fab.pictures.canvas import Canvas, Frame, Surface, View
from fab.steps.record import Step

WIDTH_PX, HEIGHT_PX = 900, 640
THUMB_PX = 240
BRASS = (0.72, 0.58, 0.25)
STEEL = (0.62, 0.65, 0.69)
LIQUID = (0.35, 0.72, 0.68)
INK = (0.08, 0.09, 0.10)
UP = View.looking_from((0.55, -0.80, 0.62), up=(0.0, 0.0, 1.0))
UP_LOW = View.looking_from((0.50, -0.85, 0.30), up=(0.0, 0.0, 1.0))
DOME_DOWN = View.looking_from((0.55, -0.80, -0.62), up=(0.0, 0.0, -1.0))
DOME_DOWN_LOW = View.looking_from((0.50, -0.85, -0.30), up=(0.0, 0.0, -1.0))
INTO_DOME = View.looking_from((0.25, -0.45, -0.90), up=(0.0, 0.0, -1.0))
LOOKS = {
    "from above": UP,
    "from the side": UP_LOW,
    "dome down": DOME_DOWN,
    "dome down, from the side": DOME_DOWN_LOW,
    "into the dome": INTO_DOME,
}
SCREW_BACK_MM = 22.0  # distance of withdrawn screws from their place


@dataclass(frozen=True)
class Thing:
    """Something in a picture."""

    mesh: trimesh.Trimesh
    color: tuple[float, float, float]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Workshop:
    """Parts and screws that can be drawn.

    Attributes:
        layout: sizes.
        meshes: closed meshes by part.
        colors: of the parts.
        fits: screws.
    """

    layout: MoldLayout
    meshes: Mapping[str, trimesh.Trimesh]
    colors: Mapping[str, tuple[float, float, float]]
    fits: Sequence[ScrewFit]

    def part(self, name: str, *shift: float) -> Thing:
        """A part by its name, displaced by ``shift`` (x, y, z), mm."""
        return Thing(self.meshes[name], self.colors[name], (shift[0], shift[1], shift[2]) if shift else (0.0, 0.0, 0.0))

    def screws(self, prefix: str, back_mm: float = 0.0, lift: float = 0.0) -> list[Thing]:
        """The screws of some joints, drawn back along their axes.

        Args:
            prefix: beginning of the joints' names.
            back_mm: distance by which the screws are withdrawn, mm.
            lift: shift of joint and screw along z, mm.
        """
        things = []
        for fit in self.fits:
            if fit.joint.name.startswith(prefix):
                sign = 1.0 if fit.joint.up else -1.0
                mesh = screw_mesh(fit, self._seat(fit.joint))
                things.append(Thing(mesh, STEEL, (0.0, 0.0, lift - sign * back_mm)))
        return things

    def _seat(self, joint: ScrewJoint) -> float:
        """Height of the head's seat."""
        from fab.checks.screw_fit import screw_seat_mm

        return screw_seat_mm(joint, self.meshes)


def screw_mesh(fit: ScrewFit, seat_mm: float) -> trimesh.Trimesh:
    """Mesh of all screws of a joint: shank and head, no thread.

    Args:
        fit: joint with its screw.
        seat_mm: height of the seat of the head, mm.
    """
    joint = fit.joint
    radius, head = bought_mm(joint.thread, "thread") / 2, bought_mm(joint.thread, "head") / 2
    sign = 1.0 if joint.up else -1.0
    bodies = []
    for x, y in joint.places:
        for size, low, high in ((radius, 0.0, fit.length_mm), (head, -2 * radius, 0.0)):
            body = trimesh.creation.cylinder(size, high - low, sections=24)
            body.apply_translation((x, y, seat_mm + sign * (low + high) / 2))
            bodies.append(body)
    return joined(bodies)


def nuts_mesh(layout: MoldLayout, inward_mm: float) -> trimesh.Trimesh:
    """Mesh of the ten square nuts, ``inward_mm`` from their seats toward the axis."""
    side, thick = bought_mm("nut_m3", "across_flats"), bought_mm("nut_m3", "thickness")
    params, nuts = layout.params, []
    for azimuth in params.screw_azimuths_deg:
        nut = trimesh.creation.box((side, side, thick))
        hole = trimesh.creation.cylinder(1.25, 3 * thick, sections=24)
        nut = from_manifold(to_manifold(nut) - to_manifold(hole))
        nut.apply_translation((params.screw_circle_radius_mm - inward_mm, 0.0, POCKET_FLOOR_MM + thick / 2))
        nut.apply_transform(trimesh.transformations.rotation_matrix(math.radians(azimuth), (0, 0, 1)))
        nuts.append(nut)
    return joined(nuts)


def inserts_mesh(layout: MoldLayout, below_mm: float) -> trimesh.Trimesh:
    """Mesh of the five heat-set inserts, ``below_mm`` below their seats."""
    length, inserts = bought_mm("insert_m4", "length"), []
    for x, y in arm_places_mm(layout.params):
        insert = trimesh.creation.annulus(bought_mm("screw_m4", "thread") / 2, ARM_INSERT_RADIUS_MM, length)
        insert.apply_translation((x, y, length / 2 - layout.params.base_thickness_mm - below_mm))
        inserts.append(insert)
    return joined(inserts)


def fill_depth_mm(layout: MoldLayout, volume_mm3: float) -> float:
    """Depth of the poured silicone's surface below the bowl's seam: solves pi h^2 (3 R - h) / 3 = volume for h, mm."""
    radius = layout.params.outer_radius_mm
    low, high = 0.0, 2 * radius
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if math.pi * middle**2 * (3 * radius - middle) / 3 < volume_mm3 else (low, middle)
    return radius - low


def poured_mesh(layout: MoldLayout, depth_mm: float) -> trimesh.Trimesh:
    """Mesh of the silicone in the open bowl, its surface ``depth_mm`` below the seam."""
    params = layout.params
    ball = trimesh.creation.icosphere(subdivisions=5, radius=params.outer_radius_mm - 0.05)
    ball.apply_translation((0.0, 0.0, params.centre_height_mm))
    return from_manifold(to_manifold(ball).trim_by_plane((0.0, 0.0, 1.0), params.centre_height_mm + depth_mm))


def dots_mesh(layout: MoldLayout) -> trimesh.Trimesh:
    """Mesh of the painted dots, as flat discs on the inner surface."""
    discs = []
    for dot in dot_pattern(layout.params):
        disc = trimesh.creation.cylinder(layout.params.dot_radius_mm, 1.6, sections=24)
        align = trimesh.geometry.align_vectors((0, 0, 1), dot.direction)
        disc.apply_transform(align)
        disc.apply_translation(dot_position_mm(layout.params, dot))
        discs.append(disc)
    return joined(discs)


def draw(things: Sequence[Thing], view: View, path: Path, width: int = WIDTH_PX, height: int = HEIGHT_PX) -> Path:
    """Draw things and write the picture.

    Args:
        things: what is drawn; they fill the picture.
        view: direction of view.
        path: of the file.
        width: of the picture, px.
        height: of the picture, px.
    """
    places = [thing.mesh.vertices + np.array(thing.shift) for thing in things]
    flat = [view.project(points) for points in places]
    low, high = np.min([p.min(axis=0) for p in flat], axis=0), np.max([p.max(axis=0) for p in flat], axis=0)
    scale = 0.95 * min(width / (high[0] - low[0]), height / (high[1] - low[1]))
    frame = Frame(view, (0, 0, width, height), ((low + high) / 2)[:2].tolist(), float(scale))
    canvas = Canvas(width, height)
    canvas.panel(frame, [Surface(p, t.mesh.faces, np.array(t.color)) for p, t in zip(places, things, strict=True)])
    from PIL import Image

    Image.fromarray(np.ascontiguousarray(canvas.image())).save(path, quality=86)
    return path


def halved(things: Sequence[Thing]) -> list[Thing]:
    """The halves y > 0 of things, which show their inside."""
    halves = []
    for thing in things:
        half = to_manifold(thing.mesh).trim_by_plane((0.0, 1.0, 0.0), 0.0)
        if not half.is_empty():
            halves.append(Thing(from_manifold(half), thing.color, thing.shift))
    return halves


def step_pictures(
    shop: Workshop, steps: Sequence[Step], depth_mm: float, folder: Path, progress: Callable[[str], None]
) -> dict[str, Path]:
    """Draw the picture of each step, key -> file, from the same records as its sweep and its text.

    Args:
        shop: what can be drawn.
        steps: of the whole work.
        depth_mm: depth of the poured silicone's surface below the seam, mm.
        folder: receives ``<key>.jpg``.
        progress: called with the name of each picture as it begins.
    """
    pictures = {}
    for step in steps:
        things = step_things(shop, step, depth_mm)
        if things:
            progress(f"picture: {step.key}")
            pictures[step.key] = draw(things, LOOKS[step.look], folder / f"{step.key}.jpg")
    progress("picture: dots")
    dots = [shop.part("shell"), shop.part("interface"), Thing(dots_mesh(shop.layout), INK)]
    pictures["dots"] = draw(dots, LOOKS["into the dome"], folder / "dots.jpg")
    return pictures


def step_things(shop: Workshop, step: Step, depth_mm: float) -> list[Thing]:
    """Things in the picture of a step: parts in place, parts on their way, withdrawn screws, and extras.

    Args:
        shop: what can be drawn.
        step: of the work.
        depth_mm: depth of the poured silicone's surface below the seam, mm.
    """
    things = [*_drawn(shop, step, step.in_place, np.zeros(3))]
    shifts = [np.zeros(3)]
    for number, move in enumerate(step.moves):
        order = number + 1 if step.enters else len(step.moves) - number
        shift = place_on_way(move.way_out, step.drawn_mm * order / len(step.moves))
        shifts.append(shift)
        things += _drawn(shop, step, move.parts, shift)
    moved = {name for move in step.moves for name in move.parts}
    lift = shifts[-1][2] if moved & {"hanger", "camera", "base"} else 0.0  # of the screws, with the part that they hold
    for joint in step.screws:
        things += shop.screws(joint, SCREW_BACK_MM, lift)
    if "nuts" in step.extras:
        things.append(Thing(nuts_mesh(shop.layout, 16.0), STEEL))
    if "inserts" in step.extras:
        things.append(Thing(inserts_mesh(shop.layout, 22.0), BRASS))
    if "silicone" in step.extras:
        things.append(Thing(poured_mesh(shop.layout, depth_mm), LIQUID))
    return things


def place_on_way(legs: Sequence[Leg], travel_mm: float) -> np.ndarray:
    """Displacement (3,) after some travel along a way, mm; with several legs, at least to the start of the last.

    Args:
        legs: of the way.
        travel_mm: length travelled, mm.
    """
    corner = np.zeros(3)
    for leg in legs[:-1]:
        corner = corner + leg.length_mm * np.array(leg.direction)
    return corner + min(travel_mm, legs[-1].length_mm) * np.array(legs[-1].direction)


def _drawn(shop: Workshop, step: Step, names: Sequence[str], shift: np.ndarray) -> list[Thing]:
    """Parts as drawn in the picture of a step: whole, or cut in half."""
    things = [shop.part(name, *shift.tolist()) for name in names]
    return [
        thing
        for name, whole in zip(names, things, strict=True)
        for thing in (halved([whole]) if name in step.cut else [whole])
    ]


def thumbnails(shop: Workshop, folder: Path) -> dict[str, Path]:
    """Draw a small picture of each part; name of the part -> file."""
    return {name: draw([shop.part(name)], UP, folder / f"thumb_{name}.jpg", THUMB_PX, THUMB_PX) for name in shop.meshes}
