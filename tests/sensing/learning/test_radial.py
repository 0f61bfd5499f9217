"""The map from a field to the skin's radial displacement: known maps, explicit copies, and the weights that ship."""

import numpy as np
from pictured_set import write_set

from cad.params import EndcapParams
from sensing.camera.nominal import nominal_mount
from sensing.design.weights import DesignRequest
from sensing.learning import radial
from sensing.learning.marker_fields import PLAIN, MarkerSensor
from sensing.learning.symmetry import COUNT, disc_cells, moved_inputs, symmetric_cell_moments
from sensing.records_labelled import LabelledSet, read_shard
from sensing.simulator.similarity.labelled import library_source, shell_of, with_azimuths, write_labelled
from sensing.simulator.similarity.paths import library_paths
from sensing.wrench.model import load_wrench_model
from sensing.wrench.tensors import radial_of

PARAMS, SHAPE = EndcapParams(130, 8), (16, 16)


def test_moments_of_copies_are_those_of_copies_made_one_by_one():
    """The length of the displacement in a cell is a number that goes with the field."""
    rng, side = np.random.default_rng(0), 6
    fields = rng.standard_normal((40, 2 * side * side))

    def cells(x):
        return np.hypot(*np.split(x, 2, axis=1))

    copies = [moved_inputs(fields, number, side) for number in range(COUNT)]
    expected = sum(copy.T @ cells(copy) for copy in copies)
    assert np.allclose(symmetric_cell_moments(fields.T @ cells(fields), side), expected)


def test_a_linear_map_of_low_rank_is_found_again():
    rng = np.random.default_rng(1)
    truth = rng.standard_normal((40, 20)) @ rng.standard_normal((20, 80))
    fields = rng.standard_normal((5000, 80))
    found = radial_of(radial._ranked(fields.T @ fields, fields.T @ (fields @ truth.T)))
    assert np.abs(found - truth).max() < 0.01 * np.abs(truth).max()
    assert radial._ranked(np.zeros((80, 80)), np.zeros((80, 40))) == {} and radial_of({}) is None


def test_a_set_says_how_its_skin_moves(tmp_path):
    """Both tensors, in the field's shape."""
    tensors = radial.radial_tensors([write_set(tmp_path / "set", 6, 1)], SHAPE)
    assert {name: value.shape for name, value in tensors.items()} == {
        "radial.parts": (32, 512), "radial.cells": (256, 32)
    }  # fmt: skip
    assert np.isfinite(radial_of(tensors)).all()


def test_the_weights_that_ship_see_how_far_dots_move_toward_the_camera(tmp_path):
    """States of the library, which training has not seen: the cell at each dot against that dot's own motion."""
    request = DesignRequest(PARAMS, numbers=(library_paths()[3].number,))
    data = request.data("off", 1)
    shell = shell_of(data)
    write_labelled(data, with_azimuths(request.paths, 1), library_source(shell[0]), tmp_path / "states", shell)
    sensor, centre = MarkerSensor(PARAMS, SHAPE, PLAIN, np.random.default_rng(0)), (0, 0, PARAMS.centre_height_mm)
    arrays = [read_shard(file, {"dots_mm"})["dots_mm"] for file in LabelledSet(tmp_path / "states").shards]
    moved = np.concatenate(arrays).astype(float)
    raised = np.linalg.norm(sensor.rest_mm + moved - centre, axis=2) - PARAMS.inner_radius_mm
    fields = (sensor.fields(moved) * disc_cells(SHAPE)).reshape(len(moved), -1)
    found = fields @ load_wrench_model(PARAMS).radial.T
    place = nominal_mount(PARAMS, 640, 480).project(sensor.rest_mm)
    cell = np.floor((place - [80, 0]) / 30).astype(int)
    inside = ((cell >= 1) & (cell < 15)).all(axis=1)
    off = found[:, cell[inside, 1] * 16 + cell[inside, 0]] - raised[:, inside]
    assert inside.sum() > 60 and np.abs(raised).max() > 3
    assert np.sqrt((off**2).mean()) < 0.2 * np.sqrt((raised[:, inside] ** 2).mean())
