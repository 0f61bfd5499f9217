"""The pictures of the build sheet: the real parts in the state of each step, seen from where the step shows.

Endcap frame, millimetres. What stands dome-down in the workshop is drawn dome-down: -z is up in those pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from cad.bought import bought_mm
from cad.dots import DOT_RADIUS_MM, dot_pattern, dot_position_mm
from cad.fasteners import ScrewJoint
from cad.mold_core import REMOVAL_ORDER
from cad.mold_layout import MoldLayout
from fab.checks.extraction import core_path
from fab.checks.screw_fit import ScrewFit
from fab.meshing.mesh import from_manifold, joined, to_manifold
from fab.pictures.canvas import Canvas, Frame, Surface, View

WIDTH_PX, HEIGHT_PX = 900, 640
THUMB_PX = 240
STEEL = (0.62, 0.65, 0.69)
LIQUID = (0.35, 0.72, 0.68)
INK = (0.08, 0.09, 0.10)
UP = View.looking_from((0.55, -0.80, 0.62), up=(0.0, 0.0, 1.0))
UP_LOW = View.looking_from((0.50, -0.85, 0.30), up=(0.0, 0.0, 1.0))
DOME_DOWN = View.looking_from((0.55, -0.80, -0.62), up=(0.0, 0.0, -1.0))
DOME_DOWN_LOW = View.looking_from((0.50, -0.85, -0.30), up=(0.0, 0.0, -1.0))
INTO_DOME = View.looking_from((0.25, -0.45, -0.90), up=(0.0, 0.0, -1.0))


@dataclass(frozen=True)
class Thing:
    """Something in a picture."""

    mesh: trimesh.Trimesh
    color: tuple[float, float, float]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Workshop:
    """Everything that can be drawn.

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
        """A part, displaced."""
        return Thing(self.meshes[name], self.colors[name], (shift[0], shift[1], shift[2]) if shift else (0.0, 0.0, 0.0))

    def named(self, prefix: str, *shift: float) -> list[Thing]:
        """All parts whose names begin so."""
        return [self.part(name, *shift) for name in self.meshes if name.startswith(prefix)]

    def apart(self, prefix: str, radial: float, lift: float = 0.0) -> list[Thing]:
        """Parts pulled away from the axis, each in its own direction."""
        things = []
        for name in self.meshes:
            if name.startswith(prefix):
                x, y, _ = self.meshes[name].center_mass
                reach = math.hypot(x, y) or 1.0
                things.append(self.part(name, radial * x / reach, radial * y / reach, lift))
        return things

    def screws(self, prefix: str, back_mm: float = 0.0, lift: float = 0.0) -> list[Thing]:
        """The screws of joints whose names begin so, drawn back along their axes."""
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
    """All screws of a joint: shank and head, no thread."""
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
    """The ten square nuts, so far before their seats."""
    side, thick = bought_mm("nut_m3", "across_flats"), bought_mm("nut_m3", "thickness")
    params, nuts = layout.params, []
    for azimuth in params.screw_azimuths_deg:
        nut = trimesh.creation.box((side, side, thick))
        hole = trimesh.creation.cylinder(1.25, 3 * thick, sections=24)
        nut = from_manifold(to_manifold(nut) - to_manifold(hole))
        nut.apply_translation((params.screw_circle_radius_mm - inward_mm, 0.0, 2.2 + thick / 2))
        nut.apply_transform(trimesh.transformations.rotation_matrix(math.radians(azimuth), (0, 0, 1)))
        nuts.append(nut)
    return joined(nuts)


def fill_depth_mm(layout: MoldLayout, volume_mm3: float) -> float:
    """How far below the bowl's seam the poured silicone stands: solves pi h^2 (3 R - h) / 3 = volume for h."""
    radius = layout.params.outer_radius_mm
    low, high = 0.0, 2 * radius
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if math.pi * middle**2 * (3 * radius - middle) / 3 < volume_mm3 else (low, middle)
    return radius - low


def poured_mesh(layout: MoldLayout, depth_mm: float) -> trimesh.Trimesh:
    """The silicone in the open bowl."""
    params = layout.params
    ball = trimesh.creation.icosphere(subdivisions=5, radius=params.outer_radius_mm - 0.05)
    ball.apply_translation((0.0, 0.0, params.centre_height_mm))
    return from_manifold(to_manifold(ball).trim_by_plane((0.0, 0.0, 1.0), params.centre_height_mm + depth_mm))


def dots_mesh(layout: MoldLayout) -> trimesh.Trimesh:
    """The painted dots, as flat discs on the inner surface."""
    discs = []
    for dot in dot_pattern(layout.params):
        disc = trimesh.creation.cylinder(DOT_RADIUS_MM, 1.6, sections=24)
        align = trimesh.geometry.align_vectors((0, 0, 1), dot.direction)
        disc.apply_transform(align)
        disc.apply_translation(dot_position_mm(layout.params, dot))
        discs.append(disc)
    return joined(discs)


def draw(things: Sequence[Thing], view: View, path: Path, width: int = WIDTH_PX, height: int = HEIGHT_PX) -> Path:
    """Draw things as they are, filling the picture."""
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
    """The halves y > 0 of things, so that one sees inside."""
    halves = []
    for thing in things:
        half = to_manifold(thing.mesh).trim_by_plane((0.0, 1.0, 0.0), 0.0)
        if not half.is_empty():
            halves.append(Thing(from_manifold(half), thing.color, thing.shift))
    return halves


def step_pictures(shop: Workshop, depth_mm: float, folder: Path, progress: Callable[[str], None]) -> dict[str, Path]:
    """Every step's picture, name -> file.

    Args:
        shop: what can be drawn.
        depth_mm: how far below the seam the poured silicone stands.
        folder: receives ``<name>.jpg``.
        progress: called with the name of each picture as it begins.
    """
    pictures = {}
    for name, (view, things) in {**_casting(shop, depth_mm), **_demolding(shop), **_assembling(shop)}.items():
        progress(f"picture: {name}")
        pictures[name] = draw(things(), view, folder / f"{name}.jpg")
    return pictures


def thumbnails(shop: Workshop, folder: Path) -> dict[str, Path]:
    """A small picture of every part."""
    return {name: draw([shop.part(name)], UP, folder / f"thumb_{name}.jpg", THUMB_PX, THUMB_PX) for name in shop.meshes}


Scenes = dict[str, tuple[View, Callable[[], list[Thing]]]]


def _upper_half(shop: Workshop, lift: float = 0.0) -> list[Thing]:
    """Hanger, interface, core and collar, as one."""
    names = ("hanger", "interface", "core_", "cup_collar")
    return [thing for name in names for thing in shop.named(name, 0.0, 0.0, lift)]


def _casting(shop: Workshop, depth_mm: float) -> Scenes:
    layout = shop.layout
    tall = layout.params.tip_height_mm
    core = [name for name in REMOVAL_ORDER]
    return {
        "nuts": (UP, lambda: [shop.part("interface"), Thing(nuts_mesh(layout, 16.0), STEEL)]),
        "core": (UP_LOW, lambda: [
            shop.part("core_centre"), *shop.apart("core_wide", 55.0), *shop.apart("core_key", 18.0, 0.75 * tall)
        ]),
        "interface_on_hanger": (UP_LOW, lambda: [
            shop.part("hanger"), shop.part("interface", 0, 0, 30.0), *shop.screws("hanger_to_interface", 22.0)
        ]),
        "core_on_hanger": (UP_LOW, lambda: [
            shop.part("hanger"), shop.part("interface"), *(shop.part(name, 0, 0, 0.75 * tall) for name in core),
            *shop.screws("hanger_to_core", 22.0),
        ]),
        "core_inside": (DOME_DOWN, lambda: [
            *halved([shop.part("interface")]), *_core_state(shop, 1)
        ]),
        "core_held": (UP_LOW, lambda: [
            shop.part("hanger"), shop.part("interface"), *shop.named("core_"), *shop.screws("hanger_to_core", 22.0)
        ]),
        "collar": (UP_LOW, lambda: [
            shop.part("hanger"), shop.part("interface"), *shop.named("core_"), *shop.apart("cup_collar", 45.0, 12.0),
            *shop.screws("hanger_to_cup", 22.0),
        ]),
        "bowl": (DOME_DOWN, lambda: shop.apart("cup_bowl", 35.0)),
        "pour": (DOME_DOWN, lambda: [*shop.named("cup_bowl"), Thing(poured_mesh(layout, depth_mm), LIQUID)]),
        "close": (DOME_DOWN_LOW, lambda: [*shop.named("cup_bowl"), *_upper_half(shop, -0.8 * tall)]),
        "closed": (DOME_DOWN_LOW, lambda: halved([*shop.named("cup_"), *shop.named("core_"), shop.part("hanger"),
                                                  shop.part("interface"), shop.part("shell")])),
    }  # fmt: skip


def _demolding(shop: Workshop) -> Scenes:
    rest = ("shell", "interface")
    return {
        "bowl_off": (DOME_DOWN_LOW, lambda: [
            *_upper_half(shop), shop.part("shell"), *shop.apart("cup_bowl", 40.0, 55.0),
            *shop.screws("cup_collar", 30.0),
        ]),
        "hanger_off": (DOME_DOWN_LOW, lambda: [
            *(shop.part(name) for name in rest), *shop.named("cup_collar"), *shop.named("core_"),
            shop.part("hanger", 0, 0, -40.0), *shop.screws("hanger_to", 25.0, -40.0),
        ]),
        "collar_off": (DOME_DOWN_LOW, lambda: [
            *(shop.part(name) for name in rest), *shop.named("core_"), *shop.apart("cup_collar", 25.0, -55.0)
        ]),
        "centre_out": (DOME_DOWN, lambda: [*_cast(shop), *_core_state(shop, 0)]),
        "keys_out": (DOME_DOWN, lambda: [*_cast(shop), *_core_state(shop, 2)]),
        "wides_out": (DOME_DOWN, lambda: [*_cast(shop), *_core_state(shop, 5)]),
    }  # fmt: skip


def _cast(shop: Workshop) -> list[Thing]:
    return halved([shop.part("shell"), shop.part("interface")])


def _core_state(shop: Workshop, leaving: int) -> list[Thing]:
    """The core while one piece leaves: those before it are gone, it stands at the end of its path's last leg."""
    things = []
    for number, name in enumerate(REMOVAL_ORDER):
        if number > leaving:
            things.append(shop.part(name))
        elif number == leaving:
            legs = core_path(shop.layout, name, shop.meshes[name])
            shift = sum((np.array(leg.direction) * leg.length_mm for leg in legs[:-1]), np.zeros(3))
            shift = shift + 0.75 * legs[-1].length_mm * np.array(legs[-1].direction)
            things.append(shop.part(name, *shift.tolist()))
    return things


def _assembling(shop: Workshop) -> Scenes:
    return {
        "dots": (INTO_DOME, lambda: [shop.part("shell"), shop.part("interface"), Thing(dots_mesh(shop.layout), INK)]),
        "camera": (UP, lambda: [
            shop.part("base"), shop.part("camera", 0, 0, 25.0), *shop.screws("camera_to_base", 18.0, 25.0)
        ]),
        "ring": (UP, lambda: [
            shop.part("base"), shop.part("camera"), shop.part("ring_spacer", 0, 0, 22.0),
            shop.part("led_ring", 0, 0, 40.0),
        ]),
        "base": (UP_LOW, lambda: [
            shop.part("shell", 0, 0, 55.0), shop.part("interface", 0, 0, 30.0), shop.part("base"), shop.part("camera"),
            shop.part("ring_spacer"), shop.part("led_ring"), *shop.screws("base_to_interface", 25.0),
        ]),
    }  # fmt: skip
