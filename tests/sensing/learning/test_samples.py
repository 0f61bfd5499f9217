"""Samples of pictures: made as live makes fields, kept, and made again when what they are made of changes."""

import inspect
import json
from pathlib import Path

import numpy as np
import pytest
from live_stand_in import stand_in
from long_cases import others_long
from pictured_set import write_set

from cad.dots import dot_pattern
from cad.errors import FileError
from cad.identity import identity
from cad.params import EndcapParams
from sensing.calibration.dots import find_blobs
from sensing.camera.mount import mount, rotation_matrix
from sensing.camera.nominal import nominal_lens
from sensing.code_digest import ROOT
from sensing.decode import decode_gray
from sensing.frames import wrench_adjoint
from sensing.learning import samples
from sensing.learning.found_camera import found_camera
from sensing.learning.samples import read_samples
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.pipeline import EndcapPipeline
from sensing.records_labelled import LabelledSet
from sensing.tracking.tracker import DotTracker
from sensing.tracking.zero import single_zero
from sensing.wrench.dot_noise import moved_part

pytestmark = pytest.mark.usefixtures("looked_for_once")


def test_samples_are_made_once_and_again_when_the_data_grow(folders, tmp_path):
    folder = write_set(tmp_path / "set", 2, 3)
    first = read_samples(folder)
    cache = folder / "fields_dots_16x16.npz"
    stamp = cache.stat().st_mtime_ns
    assert np.array_equal(read_samples(folder).fields, first.fields) and cache.stat().st_mtime_ns == stamp
    assert len(first) == 8 and set(first.path) == {"static-3-0", "static-3-1"}
    height_m = first.design.centre_height_mm / 1000
    lever = np.cross([0, 0, -height_m], first.wrenches[:, :3])
    assert np.allclose(first.wrenches[:, 3:], lever)  # labels about the endcap's origin, samples about the sphere's
    (folder / "shards" / "00001.npz").unlink()
    assert len(read_samples(folder)) == 4
    for damaged in (b"damaged", cache.read_bytes()[:-900], b"PK\x03\x04"):
        cache.write_bytes(damaged)
        assert len(read_samples(folder)) == 4


def test_samples_are_made_again_when_the_code_that_makes_fields_has_changed(tmp_path, monkeypatch):
    """Fields of a tracker of weeks ago were taken for today's: a number that somebody had to raise by hand said so."""
    folder = write_set(tmp_path / "set", 1, 3)
    read_samples(folder)
    cache = folder / "fields_dots_16x16.npz"
    first = cache.read_bytes()
    (tmp_path / "other.py").write_text("changed = False\n")
    monkeypatch.setattr(samples, "SOURCES", (*samples.SOURCES, str(tmp_path)))
    read_samples(folder)
    assert cache.read_bytes() != first
    changed = cache.stat().st_mtime_ns
    read_samples(folder)
    assert cache.stat().st_mtime_ns == changed
    (tmp_path / "other.py").write_text("changed = True\n")
    read_samples(folder)
    assert cache.stat().st_mtime_ns != changed


@pytest.mark.parametrize("made_by", [dot_pattern, decode_gray, find_blobs, DotTracker, moved_part, wrench_adjoint])
def test_code_that_makes_samples_is_part_of_their_stamp(made_by):
    """The law of the dots' noise and the change of the labels' frame were not: old samples outlived both."""
    file = Path(inspect.getsourcefile(inspect.unwrap(made_by)))
    assert any(file.is_relative_to(ROOT / name) for name in samples.SOURCES)


def test_samples_of_a_recording_are_made_again_when_its_camera_file_changes(tmp_path, capsys):
    """Fields are seen through that camera: those kept from before it was calibrated, or calibrated anew, are others. It
    is named where the untouched picture contradicts it, as live does."""
    folder = write_set(tmp_path / "set", 1, 3)
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["request"]["protocol"] = "recorded"
    (folder / "manifest.json").write_text(json.dumps(manifest))
    without = read_samples(folder).fields
    height_mm = EndcapParams(130, 8).camera_height_mm
    for turn_rad in (0.0, 0.1):
        mount(nominal_lens(), (0.0, 0.0, height_mm), rotation_matrix([0.0, 0.0, turn_rad])).save(folder / "camera.json")
        seen = read_samples(folder).fields
    assert np.abs(seen - without).max() > 0.1
    assert "the camera does not fit 1 reference(s), fields are off: camera turned by" in capsys.readouterr().err
    of_another = mount(nominal_lens(), (0.0, 0.0, height_mm))
    of_another.save(folder / "camera.json", identity(EndcapParams(140, 8)))
    with pytest.raises(FileError, match="calibrate this endcap's own"):  # as live refuses it
        read_samples(folder)


@pytest.mark.parametrize("mounted", others_long(["the found camera", "a recording's camera.json", "no file"]))
def test_live_computes_the_fields_that_training_computed(mounted, tmp_path):
    """To the bit: simulated frames with the camera a user finds, recordings with theirs, or without one. Specks on the
    lens are no dots: live left them out, training followed them."""
    folder = write_set(tmp_path / "set", 2, 3, specks=((447, 241), (328, 112), (218, 170)))
    design, camera = EndcapParams(130, 8), None
    if mounted == "the found camera":
        camera = tmp_path / "found.json"
        found_camera(LabelledSet(folder)).save(camera)
    else:
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest["request"]["protocol"] = "recorded"
        (folder / "manifest.json").write_text(json.dumps(manifest))
    if mounted == "a recording's camera.json":
        camera = folder / "camera.json"
        turned = rotation_matrix([0.02, -0.01, 0.03])
        mount(nominal_lens(), (0.4, -0.3, design.camera_height_mm + 0.3), turned).save(camera)
    trained = read_samples(folder)
    endcap = EndcapConfig("endcap_0", "test", camera=camera)
    pipe, live = None, []
    for item in LabelledSet(folder).frames():
        if item.frame.sequence == 0:
            pipe = EndcapPipeline(endcap, stand_in(), single_zero(item.reference))
        live.append(pipe.update(item.frame).field.channels)
    off = np.abs(np.array(live) - trained.fields).max()
    assert off == 0
    assert np.abs(trained.fields).max() > 1.0
