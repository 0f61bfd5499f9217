"""What a file depends on: every change that changes a result is seen, and named."""

import json
import math
from dataclasses import replace

import pytest

import cad.dots
import cad.identity
import cad.materials
import cad.pattern
import cad.scaling
from cad.dots import Dot
from cad.errors import FileError
from cad.identity import RELEASED, differing, identity, label_of, recorded, released, require_same
from cad.lens import camera_module
from cad.params import EndcapParams

PARAMS = EndcapParams(130, 8)
SMOOTH = "Smooth-Sil 950"
MODULE = camera_module()


@pytest.mark.parametrize("size", [(130, 8), (98.9, 6.5), (120, 10), (150, 10), (250, 20), (187.3, 9.1)])
def test_what_ships_is_the_released_pattern_camera_and_silicone_at_every_size(size):
    here, before = identity(EndcapParams(*size), SMOOTH), released(EndcapParams(*size))
    assert here.aspects == before.aspects and differing(here, before) == []
    assert label_of(here, "dots") == label_of(here, "camera") == RELEASED


def test_a_record_comes_back_from_a_file_and_is_refused_when_a_value_was_changed():
    here = identity(PARAMS, SMOOTH, (6, 9, 1))
    record = json.loads(json.dumps(here.record()))
    assert recorded(record, EndcapParams(150, 8)).record() == here.record()
    record["dots"]["dot_radius_mm"] = 3.0
    with pytest.raises(ValueError, match="does not match its digest"):
        recorded(record, PARAMS)


def test_a_record_of_before_means_the_released_one_whatever_the_toolkit_has_become(monkeypatch):
    before = recorded(None, PARAMS)
    monkeypatch.setattr(cad.dots, "MERIDIAN_DEG", 5.0)
    monkeypatch.setattr(cad.identity, "camera_module", lambda: replace(MODULE, focal_per_row=0.6))
    assert recorded(None, PARAMS) == before == recorded({}, PARAMS)
    assert differing(before, identity(PARAMS, "Dragon Skin 30")) == ["dots", "camera", "silicone"]


def moved(params):
    return (*_pattern(params)[:-1], Dot(7, 19, 7 * 180 / 13, 343.0))


_pattern = cad.dots.dot_pattern


@pytest.mark.parametrize(
    ("module", "name", "value", "said"),
    [
        (cad.pattern, "DENT_DEPTH_MM", 0.5, "dent_depth_mm=0.5, here 0.6"),
        (cad.dots, "step_deg", lambda rings: 13.0, "the dot pattern "),
        (cad.dots, "MERIDIAN_DEG", 5.0, "other places"),
        (cad.dots, "dot_pattern", moved, "other places"),
        (cad.identity, "camera_module", lambda: replace(MODULE, focal_per_row=0.6), "focal_per_row=0.6"),
        (cad.identity, "camera_module", lambda: replace(MODULE, k=(0.0, 0.0, 0.0, 0.0)), "the camera "),
        (cad.scaling, "camera_module", lambda: replace(MODULE, stack_mm=19.0), "pupil_height_mm=18.0, here 17.0"),
    ],
)
def test_every_number_that_changes_a_picture_is_seen_and_named(monkeypatch, module, name, value, said):
    here = identity(PARAMS, SMOOTH)
    with monkeypatch.context() as patch:
        patch.setattr(module, name, value)
        other = identity(PARAMS, SMOOTH)
    assert other.digest != here.digest
    with pytest.raises(FileError, match="weights for the ") as caught:
        require_same("w.safetensors", "weights", other, here, "train again")
    assert said in str(caught.value) and str(caught.value).endswith(": train again")


@pytest.mark.parametrize(
    ("options", "label"),
    [({"dot_rings": (1, 8, 10, 12, 16, 18, 20)}, "dots1-8-10-12-16-18-20"), ({"dot_mm": 3.5}, "dot_mm3.5")],
)
def test_dots_that_were_chosen_are_another_design_that_no_file_of_the_released_one_fits(options, label):
    here, other = identity(PARAMS, SMOOTH), identity(EndcapParams(130, 8, **options), SMOOTH)
    assert differing(other, here) == ["design", "dots"]
    with pytest.raises(FileError, match=f"for the design D130_T8_{label}, this endcap has the design D130_T8: "):
        require_same("w.safetensors", "weights", other, here, "train again")
    assert recorded(json.loads(json.dumps(other.record())), PARAMS).record() == other.record()


def test_silicone_mesh_and_design_are_seen_and_what_does_not_matter_is_not():
    here = identity(PARAMS, SMOOTH, (6, 9, 1))
    with pytest.raises(FileError, match="the silicone Dragon Skin 30, this endcap has the silicone Smooth-Sil 950"):
        require_same("f", "weights", identity(PARAMS, "Dragon Skin 30"), here, "train")
    with pytest.raises(FileError, match=r"core_rings_layers=\[8, 13, 1\], here \[6, 9, 1\]"):
        require_same("f", "a set", identity(PARAMS, SMOOTH, (8, 13, 1)), here, "choose an empty folder")
    with pytest.raises(FileError, match="for the design D150_T8, this endcap has the design D130_T8"):
        require_same("f", "a set", identity(EndcapParams(150, 8), SMOOTH), here, "choose an empty folder")
    assert differing(identity(PARAMS), here) == []  # neither silicone nor mesh matter to a picture at rest
    assert differing(here.without("dots"), recorded(None, PARAMS)) == []


def test_a_changed_row_of_the_table_is_another_silicone(monkeypatch):
    here, row = identity(PARAMS, SMOOTH), cad.materials.silicone(SMOOTH)
    changed = cad.materials.Silicone(**{**vars(row), "neo_hooke_c10_mpa": 0.35})
    monkeypatch.setattr("cad.identity.silicone_named", lambda name: changed)
    assert differing(here, identity(PARAMS, SMOOTH)) == ["silicone"]
    assert not math.isclose(0.35, here.aspects["silicone"]["c10_mpa"])
