"""The renderer against geometry, light and statistics that it does not compute itself."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cad.dots import dot_pattern
from cad.errors import ParameterError
from cad.params import EndcapParams
from sensing.camera.mount import mount, rotation_matrix
from sensing.camera.nominal import nominal_lens, nominal_mount
from sensing.simulator.render.cli import main
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.render.light import led_positions_mm, shade, tip_irradiance
from sensing.simulator.render.mesh import interpolation_matrix, sphere_points, surface_mesh, vertex_normals
from sensing.simulator.render.raster import interpolate, rasterise
from sensing.simulator.render.sensor import pixel_values, signal_of, tone_table
from sensing.simulator.render.settings import Lamp, Optics, Paint, RenderSettings, Sensor

PARAMS = EndcapParams(130, 8)
ROUND = {"smeared": 0, "roughness": 0, "unevenness": 0, "overflow": 0, "radius_scale": 1, "size_spread": 0}
CLEAN = Paint(specks=0, jitter_mm=0, seams=False, clouds=0, **ROUND)
PLAIN = RenderSettings(seed=3, mesh=64, texels=1024, paint=CLEAN)


@pytest.fixture(scope="module")
def renderer() -> DomeRenderer:
    return DomeRenderer(PARAMS, nominal_mount(PARAMS), PLAIN)


def bulge(points_mm: np.ndarray, depth_mm: float = 6.0) -> np.ndarray:
    """A smooth inward displacement field with a tangential part."""
    top = np.array([20.0, 12.0, 38.37 + 50.0])
    share = np.exp(-((np.linalg.norm(points_mm - top, axis=1) / 18) ** 2))
    return share[:, None] * depth_mm * np.array([-0.2, -0.5, -0.8])


def measured_centres(dotted: np.ndarray, blank: np.ndarray, near_px: np.ndarray, reach: int = 12) -> np.ndarray:
    """Centroids of what the ink darkens, in windows round ``near_px``."""
    dark = (blank - dotted).sum(-1)
    centres = []
    for x, y in np.round(near_px).astype(int):
        window = dark[y - reach : y + reach + 1, x - reach : x + reach + 1]
        rows, columns = np.mgrid[y - reach : y + reach + 1, x - reach : x + reach + 1]
        centres.append([(window * columns).sum() / window.sum(), (window * rows).sum() / window.sum()])
    return np.array(centres)


@pytest.mark.parametrize("depth_mm", [0.0, 6.0])
def test_rendered_dots_lie_where_the_camera_model_says(depth_mm: float) -> None:
    mounted = mount(nominal_lens(), (0.5, -0.3, 17.0), rotation_matrix([0.03, -0.02, 0.4]))
    settings = replace(PLAIN, lamp=Lamp(gloss=0, ink_gloss=0))
    with_ink = DomeRenderer(PARAMS, mounted, settings)
    dents = replace(settings, paint=replace(CLEAN, unpainted=1.0))
    field = bulge(with_ink.surface_mm, depth_mm)
    light, blank = with_ink.radiance(field), DomeRenderer(PARAMS, mounted, dents).radiance(field)
    frame = with_ink.render(field)
    inner = np.array([dot.ring <= 5 for dot in dot_pattern(PARAMS)]) & frame.dots_visible
    inner &= ((frame.dots_px > 15) & (frame.dots_px < [625, 465])).all(1)
    error = measured_centres(light, blank, frame.dots_px[inner]) - frame.dots_px[inner]
    assert inner.sum() > 55
    assert np.sqrt((error**2).sum(1).mean()) < 0.07  # shading across a dot and its curvature: 0.03 to 0.04
    if depth_mm:
        assert np.linalg.norm(frame.dots_px - with_ink.render().dots_px, axis=1)[inner].max() > 5


def test_zero_displacement_is_the_reference_and_same_numbers_same_bytes(renderer: DomeRenderer) -> None:
    zero = np.zeros_like(renderer.surface_mm)
    first, again = renderer.render(frame=7), renderer.render(zero, frame=7)
    assert np.array_equal(first.image_bgr, again.image_bgr)
    assert not np.array_equal(first.image_bgr, renderer.render(frame=8).image_bgr)
    twin = DomeRenderer(PARAMS, nominal_mount(PARAMS), PLAIN)
    assert np.array_equal(first.image_bgr, twin.render(frame=7).image_bgr)
    other = DomeRenderer(PARAMS, nominal_mount(PARAMS), replace(PLAIN, seed=4))
    assert not np.array_equal(first.image_bgr, other.render(frame=7).image_bgr)


def test_turning_camera_and_load_turns_the_picture() -> None:
    """Half a turn maps pattern and lamp (ten LEDs) onto themselves; the image comes out turned by 180 degrees."""
    settings = replace(PLAIN, lamp=Lamp(count=10))
    straight = DomeRenderer(PARAMS, nominal_mount(PARAMS), settings)
    turn = rotation_matrix([0, 0, np.pi])
    field = bulge(straight.surface_mm)
    turned_field = bulge(straight.surface_mm @ turn.T) @ turn
    a, b = straight.radiance(field), straight.radiance(turned_field)[::-1, ::-1]
    assert np.abs(a - b).mean() < 1e-4 < 1e-2 * a.mean()
    assert np.abs(a - straight.radiance()).mean() > 50 * np.abs(a - b).mean()


def test_projection_follows_own_nodes_as_well_as_the_mesh(renderer: DomeRenderer) -> None:
    rng = np.random.default_rng(0)
    disc = rng.uniform(-2.15, 2.15, (6000, 2))
    nodes = sphere_points(PARAMS, disc[np.linalg.norm(disc, axis=1) < 2.15])
    own = DomeRenderer(PARAMS, nominal_mount(PARAMS), PLAIN, nodes)
    a, b = own.render(bulge(nodes)), renderer.render(bulge(renderer.surface_mm))
    seen = a.dots_visible & b.dots_visible
    assert np.abs(a.dots_px - b.dots_px)[seen].max() < 0.1


def test_interpolation_is_third_order() -> None:
    targets = sphere_points(PARAMS, np.random.default_rng(1).uniform(-1, 1, (300, 2)))
    errors = []
    for cells in (24, 48, 96):
        nodes = surface_mesh(PARAMS, cells).vertices_mm
        matrix = interpolation_matrix(PARAMS, nodes, targets)
        assert np.allclose(matrix.sum(1), 1)
        errors.append(np.abs(matrix @ np.sin(nodes / 15) - np.sin(targets / 15)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 2.6).all()


@pytest.mark.long
def test_tracing_in_cells_costs_little_and_the_lens_edge_is_whole() -> None:
    exact = DomeRenderer(PARAMS, nominal_mount(PARAMS), replace(PLAIN, mesh=96, cell=1))
    truth = exact.radiance(bulge(exact.surface_mm))
    errors = []
    for cell in (2, 4, 8, 32):
        made = DomeRenderer(PARAMS, nominal_mount(PARAMS), replace(PLAIN, mesh=96, cell=cell))
        errors.append(np.sqrt(((made.radiance(bulge(made.surface_mm)) - truth) ** 2).mean()) / np.median(truth))
    assert 0 < errors[0] < errors[1] < errors[2] < 2e-3  # not zero: the cells were used
    assert errors[2] > 2 * errors[1] > 4 * errors[0]
    assert errors[3] == 0  # the surface ends inside such cells: traced at every pixel instead


def test_a_turned_load_is_the_load_at_another_azimuth(renderer: DomeRenderer) -> None:
    """Turning the displacement by the renderer against giving it the field of the turned bulge."""
    for azimuth in (37.0, 200.0):
        turn = rotation_matrix([0, 0, np.radians(azimuth)])
        direct = bulge(renderer.surface_mm @ turn) @ turn.T
        a, b = renderer.render(bulge(renderer.surface_mm), azimuth_deg=azimuth), renderer.render(direct)
        assert np.abs(a.dots_px - b.dots_px)[a.dots_visible].max() < 0.02
        gap = np.abs(a.pixels_bgr.astype(int) - b.pixels_bgr).mean()
        still = renderer.render(bulge(renderer.surface_mm))
        assert np.abs(a.pixels_bgr.astype(int) - still.pixels_bgr).mean() > 4 * gap  # measured: 0.91 against 0.12
    moved = bulge(renderer.surface_mm)
    first = renderer.render(moved).dots_px
    moved *= 0.5  # the same array, changed: nothing stale may come back
    assert np.nanmax(np.abs(renderer.render(moved).dots_px - first)) > 1


def test_light_is_linear_and_adds_up(renderer: DomeRenderer) -> None:
    base = renderer.radiance()
    twice = renderer.radiance(settings=replace(PLAIN, lamp=Lamp(brightness=2.0)))
    assert np.allclose(twice, 2 * base, rtol=2e-5, atol=1e-6)
    odd, even = (tuple(range(start, 9, 2)) for start in (1, 0))
    parts = [renderer.radiance(settings=replace(PLAIN, lamp=Lamp(dead=dead))) for dead in (odd, even)]
    assert np.allclose(parts[0] + parts[1], base, rtol=1e-3, atol=1e-5)


def test_irradiance_matches_closed_form_and_sphere_theorem() -> None:
    """On the axis of a ring: h^2 / (h^2 + r^2)^2. A Lambertian point source on a sphere lights all of it evenly."""
    lamp = Lamp(count=24, radius_mm=25, height_mm=10)
    leds, brightness = led_positions_mm(lamp)
    tip = np.array([[0, 0, 95.0]])
    lit = shade(tip, np.array([[0, 0, -1.0]]), np.zeros(3), leds, brightness)
    assert lit[0, 0] == pytest.approx(tip_irradiance(lamp, 95.0), rel=1e-6)
    mesh = surface_mesh(PARAMS, 64)
    inward = -(mesh.vertices_mm - [0, 0, PARAMS.centre_height_mm]) / PARAMS.inner_radius_mm
    bottom = np.array([[0, 0, PARAMS.centre_height_mm - PARAMS.inner_radius_mm]])
    even = shade(mesh.vertices_mm, inward, np.zeros(3), bottom, np.ones(1))[:, 0]
    assert np.allclose(even, 1 / (4 * PARAMS.inner_radius_mm**2), rtol=1e-5)
    assert np.allclose(vertex_normals(mesh.vertices_mm, mesh.triangles)[2000], inward[2000], atol=2e-3)


def test_noise_statistics() -> None:
    light = np.full((200, 200, 3), 0.3, np.float32)
    normals = np.random.default_rng(0).standard_normal(light.size, np.float32)
    signal = signal_of(light, normals, 1.5, 2.0, 5000.0, 20.0)
    expected = 2.0 * np.sqrt(0.45 / 5000 + (20 / 5000) ** 2)
    assert signal.mean() == pytest.approx(0.9, abs=4 * expected / np.sqrt(light.size))
    assert signal.std() == pytest.approx(expected, rel=0.01)
    assert np.array_equal(signal_of(light, 0 * normals, 1.5, 2.0, 5000.0, 20.0), np.float32(3.0) * light)


def test_tone_curve_inverts_to_the_signal() -> None:
    signal = np.linspace(0.01, 1, 5000, dtype=np.float32).reshape(50, 100, 1)
    sensor = Sensor(black=0, gamma=2.2)
    values = pixel_values(signal, tone_table(sensor))
    assert np.abs(255 * signal ** (1 / 2.2) - values).max() <= 0.53


def test_exposure_brightens_and_motion_smears(renderer: DomeRenderer) -> None:
    dim = renderer.render(settings=replace(PLAIN, sensor=Sensor(exposure=0.5))).image_bgr
    assert dim.mean() < 0.8 * renderer.render().image_bgr.mean()
    end = np.tile([2.0, 0, 0], (len(renderer.surface_mm), 1))
    moving, still = renderer.radiance(end, start_mm=-end), renderer.radiance(0 * end)
    sharpness = [np.square(cv2.Sobel(image[100:380, 180:460], cv2.CV_32F, 1, 0)).mean() for image in (moving, still)]
    assert sharpness[0] < 0.5 * sharpness[1]
    frame = renderer.render(end, start_mm=-end)
    assert np.allclose(frame.dots_px, renderer.render().dots_px, equal_nan=True, atol=1e-9)


@pytest.mark.long
def test_paint_options_show_and_are_reported() -> None:
    def ink(paint: Paint) -> tuple[float, int]:
        made = DomeRenderer(PARAMS, nominal_mount(PARAMS), replace(PLAIN, paint=paint))
        return float(made._skin.texture[..., 3].mean()), int(made.render().dots_visible.sum())

    full, seen = ink(CLEAN)
    for paint, share in ((replace(CLEAN, unpainted=0.4), 0.6), (replace(CLEAN, missing=0.4), 0.6)):
        amount, visible = ink(paint)
        assert amount / full == pytest.approx(share, abs=0.15)
        assert visible / seen == pytest.approx(share, abs=0.15)
    more, still_seen = ink(replace(CLEAN, extra=20, digit="4"))
    assert more > 1.1 * full and still_seen == seen


def test_fold_hides_dots() -> None:
    """A deep bulge on the side comes between the pupil and dots behind it."""
    renderer = DomeRenderer(PARAMS, nominal_mount(PARAMS), PLAIN)
    top = np.array([57.0, 0, 38.37])
    share = np.exp(-((np.linalg.norm(renderer.surface_mm - top, axis=1) / 10) ** 2))
    frame = renderer.render(share[:, None] * np.array([-45.0, 0, -10.0]))
    assert frame.dots_visible.sum() < renderer.render().dots_visible.sum()


def test_rasteriser_covers_every_pixel_once_and_keeps_the_nearest() -> None:
    square = np.array([[0.0, 0], [9, 0], [9, 9], [0, 9]])
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    values = np.zeros((4, 5), np.float32)
    values[:, :2] = square
    owner, weights, depth = rasterise(square, np.full(4, 2.0), triangles, 10, 10)
    image = interpolate(owner, weights, values, triangles)
    rows, columns = np.mgrid[:10, :10]
    assert np.allclose(image[0], columns, atol=1e-5) and np.allclose(image[1], rows, atol=1e-5)
    assert np.allclose(depth, 2) and not np.isnan(image).any()
    both, depths = np.vstack([square, square]), np.repeat([5.0, 1.0], 4)
    far_then_near = np.vstack([triangles, triangles + 4]).astype(np.int32)
    for order in (far_then_near, far_then_near[::-1].copy()):
        assert np.allclose(rasterise(both, depths, order, 10, 10)[2], 1)
    owner, _, depth = rasterise(np.full((4, 2), np.nan), np.ones(4), triangles, 10, 10)
    assert np.isinf(depth).all() and (owner == -1).all()


def test_rasteriser_leaves_no_hole_and_agrees_with_point_in_triangle() -> None:
    """Random triangles against a direct evaluation at every pixel."""
    rng = np.random.default_rng(8)
    corners, depths = rng.uniform(-10, 50, (60, 2)), rng.uniform(1, 5, 60)
    triangles = np.arange(60, dtype=np.int32).reshape(20, 3)
    owner, _, depth = rasterise(corners, depths, triangles, 40, 40)
    y, x = np.mgrid[:40, :40]
    best = np.full((40, 40), np.inf)
    for i, j, k in triangles:
        system = np.vstack([corners[[i, j, k]].T, np.ones(3)])
        weights = np.einsum("ab,bhw->ahw", np.linalg.inv(system), np.stack([x, y, np.ones_like(x)]))
        inside = (weights >= -1e-9).all(0)
        best = np.where(inside, np.minimum(best, np.einsum("a,ahw->hw", depths[[i, j, k]], weights)), best)
    assert np.allclose(depth, best, rtol=1e-5) and ((owner >= 0) == np.isfinite(best)).all()


def test_command_line(tmp_path, capsys) -> None:
    out = tmp_path / "a.png"
    assert main(["--out", str(out), "--level", "draft", "--bulge", "5"]) == 0
    assert cv2.imread(str(out)).shape == (480, 640, 3)
    beside = tmp_path / "b.png"
    assert main(["--out", str(beside), "--level", "draft", "--beside", str(out)]) == 0
    assert cv2.imread(str(beside)).shape == (480, 1280, 3)
    disc = np.random.default_rng(0).uniform(-1.5, 1.5, (2000, 2))
    nodes = sphere_points(PARAMS, disc)
    np.savez(tmp_path / "u.npz", surface_mm=nodes, displacement_mm=bulge(nodes))
    moved = tmp_path / "c.png"
    assert main(["--out", str(moved), "--level", "draft", "--displacement", str(tmp_path / "u.npz")]) == 0
    assert np.abs(cv2.imread(str(moved)).astype(int) - cv2.imread(str(out))).mean() > 0.3
    for arguments, words in (
        (["--out", str(tmp_path / "a.tiff"), "--level", "draft"], "end the name in .png"),
        (["--out", str(out), "--beside", "none.jpg"], "none.jpg: missing"),
        (["--out", str(out), "--diameter", "5"], "diameter_mm=5"),
        (["--out", str(out), "--gradient", "3"], "Lamp.gradient=3.0 outside -1..1"),
        (["--out", str(out), "--displacement", "none.npz"], "none.npz: cannot read"),
    ):
        assert main(arguments) == 2
        error = capsys.readouterr().err
        assert words in error and error.count("\n") == 1


def test_bad_input_is_refused(renderer: DomeRenderer) -> None:
    with pytest.raises(ParameterError, match="displacement_mm of shape"):
        renderer.render(np.zeros((3, 3)))
    with pytest.raises(ParameterError, match="finite"):
        renderer.render(np.full_like(renderer.surface_mm, np.nan))
    with pytest.raises(ParameterError, match="off the inner sphere"):
        DomeRenderer(PARAMS, None, PLAIN, renderer.surface_mm * 1000)
    with pytest.raises(ParameterError, match="level='best' unknown"):
        PLAIN.at_level("best")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="over 1"):
        RenderSettings(paint=Paint(unpainted=0.7, missing=0.7))
    with pytest.raises(ParameterError, match=r"Optics\.defocus_px=nan"):
        RenderSettings(optics=Optics(defocus_px=float("nan")))
