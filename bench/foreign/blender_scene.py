"""Run by an interpreter that has ``bpy`` (Blender as a Python module): render shapes of the dome that lie in a file.

    python blender_scene.py scene.npz folder

``scene.npz`` holds vertices (f, n, 3) in mm, triangles (t, 3), uv (n, 2), camera and lamp; pictures become
``folder/00000.png`` and so on, without any tone curve but sRGB. This file knows nothing of the project: it must run
where the project is not installed.
"""

import sys
from pathlib import Path

import bpy  # isort: split

import addon_utils  # only there once bpy is
import mathutils
import numpy as np

MM = 0.1  # Blender units a mm: lamps and offsets of rays want sizes near 1
SENSOR_MM = 36.0


def main() -> None:
    """Render everything."""
    with np.load(sys.argv[1]) as found:
        scene = {name: found[name] for name in found.files}
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    addon_utils.enable("cycles")
    settings(scene)
    camera(scene)
    lamps(scene)
    mesh = dome(scene)
    for number, vertices in enumerate(scene["vertices"]):
        picture = folder / f"{number:05d}.png"
        if picture.exists():
            continue
        mesh.vertices.foreach_set("co", (MM * vertices).astype(np.float32).ravel())
        mesh.update()
        bpy.context.scene.cycles.seed, bpy.context.scene.cycles.samples = number, int(scene["samples"][number])
        bpy.context.scene.render.filepath = str(picture)
        bpy.ops.render.render(write_still=True)


def settings(scene) -> None:
    """Renderer, size, colours."""
    world = bpy.data.worlds.new("dark")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0, 0, 0, 1)
    here = bpy.context.scene
    here.world = world
    here.render.engine = "CYCLES"
    here.cycles.device = "CPU"
    here.cycles.use_denoising = False
    here.cycles.use_adaptive_sampling = False
    here.cycles.max_bounces, here.cycles.diffuse_bounces, here.cycles.glossy_bounces = 2, 2, 1
    here.cycles.sample_clamp_indirect = 3.0
    here.render.threads_mode, here.render.threads = "FIXED", int(scene["threads"])
    here.render.resolution_x, here.render.resolution_y = (int(size) for size in scene["size"])
    here.render.resolution_percentage = 100
    here.render.image_settings.file_format, here.render.image_settings.color_mode = "PNG", "BW"
    here.view_settings.view_transform, here.view_settings.look = "Standard", "None"
    here.view_settings.exposure = float(scene["exposure"])
    here.render.use_persistent_data = True


def camera(scene) -> None:
    """A fisheye at the pupil; the matrix takes camera axes (right, up, back) to the endcap's."""
    made = bpy.data.cameras.new("camera")
    made.type, made.sensor_width, made.clip_start = "PANO", SENSOR_MM, 0.01
    made.sensor_fit = "HORIZONTAL"
    mm_px = SENSOR_MM / float(scene["size"][0])
    made.fisheye_fov = np.radians(190)
    if str(scene["law"]) == "equisolid":
        made.panorama_type = "FISHEYE_EQUISOLID"
        made.fisheye_lens = float(scene["focal_px"]) * mm_px
    else:  # equidistant: the angle from the axis is the radius over the focal length
        made.panorama_type = "FISHEYE_LENS_POLYNOMIAL"
        made.fisheye_polynomial_k0, made.fisheye_polynomial_k1 = 0.0, -1 / (float(scene["focal_px"]) * mm_px)
        made.fisheye_polynomial_k2 = made.fisheye_polynomial_k3 = made.fisheye_polynomial_k4 = 0.0
    place = bpy.data.objects.new("camera", made)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scene["axes"], MM * scene["pupil_mm"]
    place.matrix_world = mathutils.Matrix(matrix.tolist())
    bpy.context.collection.objects.link(place)
    bpy.context.scene.camera = place


def lamps(scene) -> None:
    """Small discs that look up."""
    for at, watts in zip(scene["lamps_mm"], scene["lamps_w"], strict=True):
        lamp = bpy.data.lights.new("lamp", "AREA")
        lamp.shape, lamp.size, lamp.energy = "DISK", MM * float(scene["lamp_size_mm"]), float(watts)
        place = bpy.data.objects.new("lamp", lamp)
        place.location, place.rotation_euler = (MM * at).tolist(), (np.pi, 0, 0)
        bpy.context.collection.objects.link(place)


def dome(scene):
    """The inner surface with its texture; returns its mesh."""
    mesh = bpy.data.meshes.new("dome")
    triangles = scene["triangles"]
    mesh.from_pydata((MM * scene["vertices"][0]).tolist(), [], triangles.tolist())
    mesh.uv_layers.new(name="map").data.foreach_set("uv", scene["uv"][triangles.ravel()].astype(np.float32).ravel())
    mesh.polygons.foreach_set("use_smooth", np.ones(len(triangles), bool))
    material = bpy.data.materials.new("skin")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    surface = nodes["Principled BSDF"]
    gray, ink = (image(nodes, scene[name]) for name in ("gray", "ink"))
    links.new(gray.outputs["Color"], surface.inputs["Base Color"])
    rough = nodes.new("ShaderNodeMapRange")
    rough.inputs["To Min"].default_value, rough.inputs["To Max"].default_value = scene["roughness"].tolist()
    links.new(ink.outputs["Color"], rough.inputs["Value"])
    links.new(rough.outputs["Result"], surface.inputs["Roughness"])
    surface.inputs["Specular IOR Level"].default_value = float(scene["specular"])
    mesh.materials.append(material)
    bpy.context.collection.objects.link(bpy.data.objects.new("dome", mesh))
    return mesh


def image(nodes, values):
    """A texture node of linear values (n, n), row 0 at v = 0."""
    n = len(values)
    made = bpy.data.images.new("map", n, n, float_buffer=True, is_data=True)
    pixels = np.ones((n, n, 4), np.float32)
    pixels[..., :3] = values[..., None]
    made.pixels.foreach_set(pixels.ravel())
    node = nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = made, "Linear"
    return node


if __name__ == "__main__":
    main()
