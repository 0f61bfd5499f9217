"""Pictures of the deformed inner surface as the endcap's camera takes them.

    renderer = DomeRenderer(EndcapParams(130, 8), nominal_mount(params), RenderSettings(seed=1))
    frame = renderer.render(displacement_mm)      # (n, 3) at renderer.surface_mm, or at your own surface nodes
    frame.image_bgr, frame.jpeg, frame.dots_px, frame.dots_visible

Input is a displacement field of the inner surface (mm, endcap frame) from any mechanics; this module computes none.
Left out: the parallax of a dent's 0.6 mm depth (up to 1 px at the rim, nearly constant under load), light through the
wall, and shadows of the surface on itself. Folds are hidden correctly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix

from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.camera.model import Array, monotonic_half_angle_deg
from sensing.camera.mount import MountedCamera
from sensing.camera.nominal import nominal_mount
from sensing.simulator.render.light import led_positions_mm, shade, tip_irradiance
from sensing.simulator.render.mesh import interpolation_matrix, surface_mesh, vertex_normals
from sensing.simulator.render.raster import draw, interpolate, rasterise
from sensing.simulator.render.sensor import (
    AMBIENT_TINT,
    BRONZE,
    Floats,
    Image,
    compress,
    defocus,
    develop,
    lens_transmission,
    pixel_angles,
    radiance_image,
    signal_of,
)
from sensing.simulator.render.settings import RenderSettings
from sensing.simulator.render.skin import paint_skin
from sensing.simulator.solid.surface import turn_about_axis

Interpolation = Callable[[Array], csr_matrix]
NOISE_TABLE = 1 << 23  # number of standard normals kept for frames without fresh noise
BEYOND_DEG = 12.0  # past the lens's edge, so that the cells at its edge have all their corners
KEPT_AZIMUTHS = 16  # number of dot interpolations that are kept
HIDDEN_MM = 1.0  # a dot this far behind the surface seen at its pixel is hidden


@dataclass(frozen=True)
class Frame:
    """A rendered frame with the true places of its dots.

    Attributes:
        pixels_bgr: (h, w, 3) 8-bit, before compression.
        jpeg: JPEG bytes that the camera sends; empty where ``jpeg_quality`` is 0.
        dots_px: (d, 2) image of each dot's ink centre, in the order of ``cad.dots.dot_pattern``; ``nan`` out of view.
        dots_visible: (d,) whether the dot is painted, inside the frame and not hidden by a fold.
    """

    pixels_bgr: Image
    jpeg: bytes
    dots_px: Array
    dots_visible: NDArray[np.bool_]

    @property
    def image_bgr(self) -> Image:
        """(h, w, 3) 8-bit as received: decoded from :attr:`jpeg` where there is one."""
        if not self.jpeg:
            return self.pixels_bgr
        return np.asarray(cv2.imdecode(np.frombuffer(self.jpeg, np.uint8), cv2.IMREAD_COLOR), dtype=np.uint8)


class DomeRenderer:
    """Renders frames of one endcap; everything that does not change with the displacement is prepared once.

    Args:
        params: the design.
        mounted: camera and pose.
        settings: look and quality of the frames.
        surface_mm: (n, 3) undeformed nodes of the inner surface for the displacements (any order, no connectivity);
            without it, those of the renderer's own mesh, :attr:`surface_mm`.
        interpolation: function from undeformed points (t, 3) to a sparse (t, n) matrix from those nodes, such as
            :meth:`sensing.simulator.solid.surface.InnerSurface.interpolation`; without it moving least squares, which
            needs nodes of even spacing.
    """

    def __init__(
        self,
        params: EndcapParams,
        mounted: MountedCamera | None = None,
        settings: RenderSettings | None = None,
        surface_mm: ArrayLike | None = None,
        interpolation: Interpolation | None = None,
    ) -> None:
        self.params = params
        self.settings = settings or RenderSettings()
        self.mounted = mounted or nominal_mount(params)
        self._mesh = surface_mesh(params, self.settings.mesh)
        rim = 0.99 * self._mesh.rim_polar
        self._inner = np.linalg.norm(self._mesh.disc, axis=1) < rim  # the outermost cells are narrow
        self._skin = paint_skin(params, self.settings.paint, self.settings.texels, self.settings.seed)
        self.surface_mm = self._mesh.vertices_mm if surface_mm is None else np.asarray(surface_mm, dtype=float)
        self._interpolation = interpolation or partial(interpolation_matrix, params, self.surface_mm)
        self._to_mesh = None if surface_mm is None else self._interpolation(self._mesh.vertices_mm)
        self._dot_matrices: dict[float, csr_matrix] = {}
        self._last: tuple[Array, float, tuple[Array, Array, bool]] | None = None  # the last deformed surface
        camera, factor = self.mounted.camera, self.settings.supersample
        fine = camera.resized(camera.width_px * factor, camera.height_px * factor)
        self._fine = MountedCamera(fine, self.mounted.T_camera_endcap)
        limit = min(camera.max_half_angle_deg + BEYOND_DEG, monotonic_half_angle_deg(camera.k))
        self._wide = MountedCamera(replace(fine, max_half_angle_deg=limit), self.mounted.T_camera_endcap)
        self._transmission = lens_transmission(fine, self.settings.optics)
        edge = np.nan_to_num(pixel_angles(camera) / (np.pi / 2), nan=1.0) ** 2
        self._edge_weight = np.clip(edge, 0, 1).astype(np.float32)
        self._noise = np.random.default_rng([self.settings.seed, 4]).standard_normal(NOISE_TABLE, np.float32)

    def render(
        self,
        displacement_mm: ArrayLike | None = None,
        *,
        start_mm: ArrayLike | None = None,
        azimuth_deg: float = 0.0,
        frame: int = 0,
        settings: RenderSettings | None = None,
    ) -> Frame:
        """Render one frame.

        Args:
            displacement_mm: (n, 3) at :attr:`surface_mm` at the end of the exposure; ``None`` for the undeformed dome.
            azimuth_deg: angle by which the displacement is first turned about the axis (paint and lamp are not).
            start_mm: (n, 3) at the beginning of the exposure, for motion blur; ``None`` for no motion.
            frame: number, 0 or more, that selects the noise; the same number gives the same bytes.
            settings: other lamp, optics or sensor for this frame; paint, mesh and texture stay those of the renderer.

        Raises:
            ParameterError: a displacement of the wrong shape, with numbers that are not finite or beyond the inner
                sphere's diameter, or a frame number under 0.
        """
        if frame < 0:
            raise ParameterError(
                f"frame={frame} is under 0: it numbers the noise; give 0 or more", name="frame", value=frame
            )
        settings = settings or self.settings
        end = self._displacement(displacement_mm)
        self._last = None
        radiance = self._light(end, start_mm, azimuth_deg, settings)
        sensor = settings.sensor
        signal = signal_of(
            radiance,
            self._normals(radiance.size, frame),
            sensor.exposure,
            sensor.gain,
            sensor.full_well_e,
            sensor.read_noise_e,
        )
        middle = end if start_mm is None else (end + self._displacement(start_mm)) / 2
        dots, visible = self._dots(middle, azimuth_deg)
        pixels = develop(signal, sensor)
        return Frame(pixels, compress(pixels, sensor), dots, visible)

    def radiance(
        self,
        displacement_mm: ArrayLike | None = None,
        *,
        start_mm: ArrayLike | None = None,
        azimuth_deg: float = 0.0,
        settings: RenderSettings | None = None,
    ) -> Floats:
        """The light (h, w, 3) that reaches the sensor, blurred by lens and motion, without noise; linear scale.

        Args:
            displacement_mm, start_mm, azimuth_deg, settings: arguments of :meth:`render`.
        """
        self._last = None  # the caller may have changed the same array
        return self._light(self._displacement(displacement_mm), start_mm, azimuth_deg, settings or self.settings)

    def _light(self, end: Array, start_mm: ArrayLike | None, azimuth_deg: float, settings: RenderSettings) -> Floats:
        if start_mm is None:
            light = self._sharp(end, azimuth_deg, settings)
        else:
            start, count = self._displacement(start_mm), self.settings.blur_frames
            shares = (np.arange(count) + 0.5) / count
            light = np.mean([self._sharp(start + t * (end - start), azimuth_deg, settings) for t in shares], axis=0)
        size = (self.mounted.camera.width_px, self.mounted.camera.height_px)
        if self.settings.supersample > 1:
            light = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA))
        return defocus(light, settings.optics, self._edge_weight)

    def _sharp(self, displacement: Array, azimuth_deg: float, settings: RenderSettings) -> Floats:
        """Light at the rasteriser's resolution, before the lens's blur."""
        lamp = settings.lamp
        vertices, normals, unfolded = self._deformed(displacement, azimuth_deg)
        leds, brightness = led_positions_mm(lamp)
        tip = tip_irradiance(lamp, self.params.centre_height_mm + self.params.inner_radius_mm)
        lit = shade(vertices, normals, self.mounted.pupil_endcap_mm, leds, brightness / tip)
        disc = self._mesh.disc @ turn_about_axis(azimuth_deg)[:2, :2].T
        values = np.concatenate([disc.astype(np.float32), lit], 1)
        ambient = float(brightness.sum()) * lamp.ambient * AMBIENT_TINT
        weights = np.stack([ambient, np.full(3, lamp.gloss), lamp.ink_gloss * BRONZE]).astype(np.float32)
        same = settings.optics == self.settings.optics
        passed = self._transmission if same else lens_transmission(self._fine.camera, settings.optics)
        skin, triangles = self._skin, self._mesh.triangles
        cell = self.settings.cell
        if cell > 1 and unfolded:
            height, width = passed.shape
            size = -(-height // cell) + 1, -(-width // cell) + 1
            depth = np.linalg.norm(vertices - self.mounted.pupil_endcap_mm, axis=1)
            owner, corners, _ = rasterise(self._wide.project(vertices) / cell, depth, triangles, *size)
            seen = interpolate(owner, corners, values, triangles)
            light, ends = draw(owner, seen, cell, skin.texture, skin.extent, passed, weights)
            if not ends:
                return light
        owner, corners, _ = self._trace(self._fine, vertices)
        seen = interpolate(owner, corners, values, triangles)
        return radiance_image(seen, skin.texture, skin.extent, np.where(owner >= 0, passed, np.float32(0)), weights)

    def _deformed(self, displacement: Array, azimuth_deg: float) -> tuple[Array, Array, bool]:
        """Vertices and normals, and whether all of the surface faces the camera, so that nothing is hidden.

        The whole mesh is turned with the displacement, so that one interpolation serves every azimuth.
        """
        if self._last is None or self._last[0] is not displacement or self._last[1] != azimuth_deg:
            moved = displacement if self._to_mesh is None else self._to_mesh @ displacement
            turn = turn_about_axis(azimuth_deg)
            vertices = np.ascontiguousarray((self._mesh.vertices_mm + moved) @ turn.T)
            normals = vertex_normals(vertices, self._mesh.triangles)
            facing = (normals * (self.mounted.pupil_endcap_mm - vertices)).sum(1) > 0
            unfolded = bool(facing[self._inner].all())
            self._last = (displacement, azimuth_deg, (vertices, normals, unfolded))
        return self._last[2]

    def _trace(self, mounted: MountedCamera, vertices: Array) -> tuple[NDArray[np.int32], Floats, Floats]:
        """For each pixel: the triangle that it sees, barycentric weights in it, and distance from the pupil."""
        depth = np.linalg.norm(vertices - mounted.pupil_endcap_mm, axis=1)
        size = mounted.camera.height_px, mounted.camera.width_px
        return rasterise(mounted.project(vertices), depth, self._mesh.triangles, *size)

    def _dots(self, displacement: Array, azimuth_deg: float) -> tuple[Array, NDArray[np.bool_]]:
        """Image points of the ink's centres, and whether they can be seen."""
        turn = turn_about_axis(azimuth_deg)
        points = self._skin.ink_mm + self._to_dots(azimuth_deg) @ displacement @ turn.T
        pixels, camera = self.mounted.project(points), self.mounted.camera
        inside = ((pixels > -0.5) & (pixels < [camera.width_px - 0.5, camera.height_px - 0.5])).all(1)
        visible = inside & self._skin.painted
        vertices, _, unfolded = self._deformed(displacement, azimuth_deg)
        if not unfolded:
            pupil = self.mounted.pupil_endcap_mm
            nearest = self._trace(self.mounted, vertices)[2]
            columns, rows = np.round(pixels[visible]).astype(int).T
            distance = np.linalg.norm(points[visible] - pupil, axis=1)
            visible[visible] = distance < nearest[rows, columns] + HIDDEN_MM
        return pixels, visible

    def _to_dots(self, azimuth_deg: float) -> csr_matrix:
        """Matrix from displacements of the nodes to those of the ink's centres, before the turn; cached by azimuth."""
        if azimuth_deg not in self._dot_matrices:
            if len(self._dot_matrices) >= KEPT_AZIMUTHS:
                del self._dot_matrices[next(iter(self._dot_matrices))]
            turned_back = self._skin.ink_mm @ turn_about_axis(azimuth_deg)
            self._dot_matrices[azimuth_deg] = self._interpolation(turned_back)
        return self._dot_matrices[azimuth_deg]

    def _displacement(self, displacement_mm: ArrayLike | None) -> Array:
        if displacement_mm is None:
            return np.zeros_like(self.surface_mm)
        array = np.asarray(displacement_mm, dtype=float)
        if array.shape != self.surface_mm.shape or not np.isfinite(array).all():
            raise ParameterError(
                f"displacement_mm of shape {array.shape}: need finite numbers of shape {self.surface_mm.shape}, one "
                f"row for each of the renderer's surface nodes",
                name="displacement_mm",
            )
        most, limit = float(np.abs(array).max(initial=0.0)), 2 * self.params.inner_radius_mm
        if most > limit:
            raise ParameterError(
                f"displacement_mm up to {most:.4g}, outside 0..{limit:g} (the inner sphere's diameter): no dome "
                "moves so far; give it in mm",
                name="displacement_mm",
                value=most,
            )
        return array

    def _normals(self, count: int, frame: int) -> Floats:
        rng = np.random.default_rng([self.settings.seed, 5, frame])
        if self.settings.fresh_noise or count > NOISE_TABLE:
            return rng.standard_normal(count, np.float32)
        start = int(rng.integers(0, NOISE_TABLE - count + 1))
        return self._noise[start : start + count]
