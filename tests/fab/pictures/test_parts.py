"""Pictures: something in the middle, nothing at the edges, the same twice, the right colours, clean failures."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image

from cad.errors import FileError, GeometryError
from fab.pictures import parts as render
from fab.pictures.parts import PictureItem, render_exploded, render_parts, render_section

RED, BLUE = (0.85, 0.10, 0.10), (0.10, 0.20, 0.85)


@pytest.fixture
def items() -> list[PictureItem]:
    can = trimesh.creation.annulus(8.0, 20.0, 30.0, sections=48)
    ball = trimesh.creation.icosphere(3, 7.0)
    return [PictureItem("can", can, RED, "printed"), PictureItem("ball", ball, BLUE, "bought", (0.0, 0.0, 40.0))]


def pixels(path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def share(image: np.ndarray, channel: int) -> float:
    """Share of pixels in which one channel leads the others clearly."""
    others = np.delete(image, channel, axis=2).max(axis=2)
    return float((image[..., channel] > others + 60).mean())


def edge_is_white(image: np.ndarray) -> bool:
    return all((side == 255).all() for side in (image[0], image[-1], image[:, 0], image[:, -1]))


@pytest.mark.parametrize("draw", [render_exploded, render_section, render_parts])
def test_picture_is_whole_and_repeats(draw, items, tmp_path):
    for name in ("a.png", "b.png"):
        draw(items, tmp_path / name, width_px=400)
    image = pixels(tmp_path / "a.png")
    assert image.shape[1] == 400
    assert share(image, 0) > 0.03 and share(image, 2) > 0.005
    assert edge_is_white(image)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_edge_check_notices_a_part_out_of_frame(items, tmp_path, monkeypatch):
    bounds = render._bounds
    monkeypatch.setattr(render, "_bounds", lambda *a: tuple(0.4 * np.asarray(side) for side in bounds(*a)))
    render_section(items, tmp_path / "a.png", width_px=400)
    assert not edge_is_white(pixels(tmp_path / "a.png"))


def test_section_is_capped_in_the_part_colour(items, tmp_path):
    """A solid ball cut in half shows its cut face: hollow, it would show the paler inside."""
    render_section(items[1:], tmp_path / "a.png", width_px=400, view=render.View.looking_from((0, -1, 0), (0, 0, 1)))
    image = pixels(tmp_path / "a.png")
    middle = image[image.shape[0] // 2 - 20 : image.shape[0] // 2 - 10, 195:205].reshape(-1, 3)
    assert np.ptp(middle, axis=0).max() <= 3  # one flat colour
    assert middle[0, 2] > 2.0 * middle[0, :2].max()


def test_exploded_offset_moves_the_part(items, tmp_path):
    still = PictureItem("ball", items[1].mesh, BLUE)
    render_exploded(items, tmp_path / "a.png", width_px=400)
    render_exploded([items[0], still], tmp_path / "b.png", width_px=400)
    assert share(pixels(tmp_path / "a.png"), 2) > 2 * share(pixels(tmp_path / "b.png"), 2)


def test_every_part_has_its_cell(items, tmp_path):
    render_parts(items * 3, tmp_path / "a.png", width_px=400, columns=4)
    image = pixels(tmp_path / "a.png")
    half = image.shape[0] // 2
    cells = [image[r * half : (r + 1) * half, c * 100 : (c + 1) * 100] for r in range(2) for c in range(4)]
    drawn = [share(cell, 0) > 0.05 or share(cell, 2) > 0.05 for cell in cells]
    assert drawn == [True] * 6 + [False] * 2


def test_bad_input_leaves_no_file(items, tmp_path):
    with pytest.raises(GeometryError, match="got none"):
        render_parts([], tmp_path / "a.png")
    opened = trimesh.Trimesh(items[0].mesh.vertices, items[0].mesh.faces[1:], process=False)
    with pytest.raises(GeometryError):
        render_section([PictureItem("can", opened, RED)], tmp_path / "a.png", width_px=200)
    with pytest.raises(GeometryError, match="y = 0"):
        far = items[1].mesh.copy().apply_translation((0.0, -50.0, 0.0))
        render_section([PictureItem("ball", far, RED)], tmp_path / "a.png", width_px=200)
    with pytest.raises(FileError, match="cannot be written"):
        render_parts(items, tmp_path / "gone" / "a.png", width_px=200)
    assert not list(tmp_path.iterdir())


def test_names_of_neighbours_do_not_run_into_one_another():
    names = ["camera", "ring spacer", "LED ring", "interface"]
    assert render.name_rows(names, [0.0, 200.0, 400.0, 600.0], 24) == [0, 0, 0, 0]
    assert render.name_rows(names, [0.0, 150.0, 200.0, 330.0], 24) == [0, 0, 1, 0]
    assert render.name_rows(names[::-1], [330.0, 200.0, 150.0, 0.0], 24) == [0, 1, 0, 0]  # in the order of places
