"""The GLB that turns and the page round it: what is read back by hand is what went in, small, and needs no network."""

from __future__ import annotations

import base64
import json
import re
import struct
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import trimesh

from cad.mold.layout import MoldLayout
from cad.params import EndcapParams
from fab.checks.check import Check
from fab.exports.index_page import PAGE, PREVIEW, SHARED, _next_steps, write_index
from fab.exports.preview import PreviewPart, clustered, glb
from fab.variant import Variant

SIZES = {5122: np.int16, 5123: np.uint16, 5125: np.uint32}


def read_glb(data: bytes) -> dict[str, tuple[np.ndarray, np.ndarray, dict]]:
    """Name -> (points in metres, faces, extras), read from the standard's own description."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON" and size % 4 == 0
    scene = json.loads(data[20 : 20 + size])
    rest, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0" and rest == scene["buffers"][0]["byteLength"]
    binary, found = data[28 + size :], {}
    for node in scene["nodes"]:
        shape = scene["meshes"][node["mesh"]]["primitives"][0]
        columns = []
        for number in (shape["attributes"]["POSITION"], shape["indices"]):
            accessor = scene["accessors"][number]
            view = scene["bufferViews"][accessor["bufferView"]]
            assert view["byteOffset"] % 4 == 0
            raw = np.frombuffer(binary, SIZES[accessor["componentType"]], offset=view["byteOffset"],
                                count=view["byteLength"] // SIZES[accessor["componentType"]]().itemsize)  # fmt: skip
            columns.append((raw.reshape(-1, 4)[:, :3] if view.get("byteStride") else raw, accessor))
        (shorts, accessor), (faces, _) = columns
        assert accessor["min"] == shorts.min(axis=0).tolist() and accessor["max"] == shorts.max(axis=0).tolist()
        points = np.maximum(shorts / 32767, -1) * node["scale"] + node["translation"]
        key = f"{node['extras']['group']}/{node['name']}"
        found[key] = points, faces.reshape(-1, 3), node["extras"]
    assert scene["extensionsRequired"] == ["KHR_mesh_quantization"]
    return found


def test_a_glb_holds_every_part_in_metres_with_y_up_to_a_thirty_thousandth_of_its_size():
    ball = trimesh.creation.icosphere(3, 40.0)
    ball.apply_translation((10.0, 20.0, 30.0))
    lid = trimesh.creation.box((5.0, 6.0, 7.0))
    data = glb([
        PreviewPart("ball", "endcap", ball, (0.2, 0.4, 0.6), (0.0, 0.0, 50.0)),
        PreviewPart("lid", "mold", lid, (1.0, 0.0, 0.0)),
    ])  # fmt: skip
    found = read_glb(data)
    points, faces, extras = found["endcap/ball"]
    wanted = ball.vertices[:, [0, 2, 1]] * (1, 1, -1) / 1000
    assert np.abs(points - wanted).max() < 0.04 / 32767
    assert trimesh.Trimesh(points * 1000, faces, process=False).volume == pytest.approx(ball.volume, rel=1e-3)
    assert extras == {"group": "endcap", "apart": [0.0, 0.05, 0.0]} and found["mold/lid"][2]["apart"] == [0, 0, 0]
    assert data == glb([
        PreviewPart("ball", "endcap", ball, (0.2, 0.4, 0.6), (0.0, 0.0, 50.0)),
        PreviewPart("lid", "mold", lid, (1.0, 0.0, 0.0)),
    ])  # fmt: skip


def test_a_sheet_thinner_than_a_cell_becomes_one_layer_near_its_place():
    sheet = trimesh.creation.box((60.0, 60.0, 0.4)).subdivide_to_size(2.0)
    sheet.apply_translation((0.0, 0.0, 1.0))
    found = clustered(sheet, 3.0)
    assert len(found.faces) < len(sheet.faces) / 4
    assert found.area == pytest.approx(60 * 60, rel=0.12)
    assert np.abs(found.vertices[:, 2] - 1.0).max() < 0.21


class Page(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.links += [value for name, value in attrs if name in ("href", "src")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("D150_T9_c0.2")
    box = [[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]]
    parts = []
    for name, role in (("shell", "cast"), ("base", "printed"), ("camera", "bought")):
        files = [] if role == "bought" else [f"{name}.stl"]
        for file in files:
            (folder / file).write_bytes(b"0" * 2000)
        parts.append({"name": name, "role": role, "material": "PLA", "quantity": 1, "volume_mm3": {"mesh": 8000.0},
                      "bounding_box_mm": box, "files": dict.fromkeys(files, "0")})  # fmt: skip
    for name in SHARED:
        (folder / name).write_bytes(b"0")
    variant = Variant(MoldLayout(EndcapParams(150.0, 9.0), 0.1, "Dragon Skin 30"))
    manifest = {"parts": parts, "gyroid": {"period_mm": 14.0, "density": 0.1}}
    preview = glb([PreviewPart("shell", "endcap", trimesh.creation.icosphere(2, 60.0), (0.3, 0.7, 0.6))])
    write_index(variant, manifest, [Check("base.overlap_mm3", 0.0, high=1.0)], preview, folder)
    return folder


def test_the_page_names_every_file_and_the_next_commands_of_this_very_variant(folder):
    text = (folder / PAGE).read_text()
    variant = "D=150 T=9 joint_clearance=0.1 material=&#x27;Dragon Skin 30&#x27;"
    for target in ("slice", "sheet", "molds"):
        assert f"make {target} {variant}" in text
    assert "<code>make coupons material=&#x27;Dragon Skin 30&#x27;</code>" in text
    assert "make ring D=150 T=9 " in text and "All 1 checks passed" in text
    page = Page()
    page.feed(text)
    later = {"sheet/build_sheet.html", "slice/"}
    files = {path.name for path in folder.iterdir()} - {PAGE}
    assert files <= set(page.links) and set(page.links) <= files | later


def test_the_page_remembers_the_printer_that_was_asked_for():
    variant = Variant(MoldLayout(EndcapParams(142.0, 7.5)))
    text = _next_steps(variant, {"printer": "mk4"})
    assert "make slice D=142 T=7.5 printer=mk4" in text and "make molds D=142 T=7.5 printer=mk4" in text
    assert "Original Prusa MK4" in text and "256" not in text
    assert "make slice D=142 T=7.5  #" in re.sub(" +#", "  #", _next_steps(variant, {}))


def test_the_page_needs_no_network_and_holds_the_same_glb_as_the_folder(folder):
    text = (folder / PAGE).read_text()
    assert not re.search(r"https?://|//[a-z]+\.[a-z]|fetch\(|import\(", text)
    held = base64.b64decode(re.search(r'<script id="glb"[^>]*>([^<]+)<', text)[1])
    assert held == (folder / PREVIEW).read_bytes()
    assert list(read_glb(held)) == ["endcap/shell"]
