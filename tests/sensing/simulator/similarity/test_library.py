"""The library: its blend of nodes, what it gives at and between them, and the sets that are written from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cad.errors import FileError, ParameterError
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.materials import silicone
from cad.params import EndcapParams
from sensing.records_labelled import LabelledSet
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.protocols.scaled import scaled
from sensing.simulator.similarity import solve
from sensing.simulator.similarity.labelled import library_source, shell_of, with_azimuths, write_labelled
from sensing.simulator.similarity.library import (
    FILE,
    LEAST_COUNT,
    load_library,
    save_library,
    solved_node,
)
from sensing.simulator.similarity.node import read_node, save_node
from sensing.simulator.similarity.paths import library_paths, path_digest, stand_paths, touching_steps
from sensing.simulator.similarity.ratios import LoadScale, ShellRatios, common_order
from sensing.simulator.similarity.surface_modes import modes_at
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import dot_directions


def ratios(node: int) -> ShellRatios:
    return ShellRatios(*(float(value) for value in load_library().ratios[node]))


def test_every_corner_of_the_valid_region_is_inside_the_library():
    low, high = diameter_range_mm()
    for diameter in np.linspace(low + 0.01, high, 12):
        for wall in wall_range_mm(diameter):
            weights = load_library().blend(ShellRatios.of(shell_geometry(diameter, wall)))
            assert weights.sum() == pytest.approx(1.0) and np.abs(weights).max() < 2


def test_a_node_is_given_back_and_a_linear_law_is_exact_between_nodes():
    library = load_library()
    for node in range(len(library.ratios)):
        assert library.blend(ratios(node)) == pytest.approx(np.eye(len(library.ratios))[node], abs=1e-7)
    between = ShellRatios(0.12, 0.5)
    weights = library.blend(between)
    assert weights @ np.sqrt(library.ratios[:, 0]) == pytest.approx(np.sqrt(0.12))
    assert weights @ np.arccos(library.ratios[:, 1]) == pytest.approx(np.arccos(0.5))


@pytest.mark.long
def test_a_node_comes_out_of_the_library_as_its_own_states():
    library = load_library()
    for number in (1, int(library.ratios[:, 0].argmin())):  # the second has some of the paths only
        node, states = solved_node(library, number, standing=False), library.states(ratios(number))
        solved = np.isfinite(node.wrench).all(axis=1)
        assert (solved == states.known).all() and solved.sum() > 100 and np.isnan(node.surface[~solved]).all()
        for mine, given in ((node.surface, states.surface), (node.wrench, states.wrench), (node.labels, states.labels)):
            assert mine[solved] == pytest.approx(given[solved], abs=1e-6 * np.abs(given[solved]).max())
        given = library.capacity(ratios(number))
        assert np.allclose(node.capacity, given, atol=1e-6 * np.nanmax(np.abs(given)), equal_nan=True)


def test_the_library_stays_small_and_covers_the_small_sizes():
    """Node left out: under 2.5 % wherever others surround it (bench/library.csv)."""
    assert FILE.stat().st_size < 2.5e6
    library = load_library()
    for design in ((104.0, 6.5), (110.0, 8.5), (165.0, 11.0)):
        here = ShellRatios.of(shell_geometry(*design))
        number = int(np.flatnonzero(np.isclose(library.ratios, [here.wall, here.clamp]).all(axis=1))[0])
        others = np.arange(len(library.ratios)) != number
        weights = np.where(library.travel.solved.all(axis=1) & others, 1, 0).astype(bool)
        blend = library.blend(here, weights)
        own = library.travel.coefficients[number].astype(float)
        guess = np.einsum("k,ksm->sm", blend, np.nan_to_num(library.travel.coefficients.astype(float)))
        apart = np.linalg.norm(guess - own, axis=1) / np.linalg.norm(own, axis=1)
        assert np.median(apart) < 0.025


def test_a_shell_outside_is_refused_with_the_range():
    with pytest.raises(ParameterError, match=r"T/R=0\.5.*outside the library"):
        load_library().blend(ShellRatios(0.5, 0.5))


def test_states_obey_statics_at_a_shell_that_was_never_solved():
    """The normal force that a path asks for is the one in the wrench."""
    geometry = shell_geometry(180, 12)
    states, row = load_library().states(ShellRatios.of(geometry)), 0
    scale = LoadScale.of(geometry, 0.68)
    unit = 0.68 * geometry.outer_radius_mm**2
    worst, seen = 0.0, 0
    for path in library_paths():
        outward = np.array([np.sin(np.radians(path.tilt_deg)), 0.0, np.cos(np.radians(path.tilt_deg))])
        for step in touching_steps(path):
            wanted = scaled(path, scale).waypoints[step].target.normal_n
            if states.known[row]:
                found = -states.wrench[row, :3] @ outward * unit
                worst, seen = max(worst, abs(found - wanted) / wanted), seen + 1
            row += 1
    assert row == len(states.known) and seen > 100 and worst < 2e-3


def test_states_that_a_node_lacks_are_left_out_only_where_it_counts():
    library = load_library()
    node = int(library.ratios[:, 0].argmin())  # the thinnest
    lacking = replace(library.travel, wrench=library.travel.wrench.copy())
    lacking.wrench[node, :5] = np.nan
    far = ShellRatios(0.19, 0.5)
    assert abs(library.blend(far)[node]) < LEAST_COUNT
    _, near_known = library.state_weights(lacking, ratios(node))
    weights, far_known = library.state_weights(lacking, far)
    assert not near_known[:5].any() and far_known[:5].all()
    assert weights[node, :5] == pytest.approx(0.0) and weights[:, 0].sum() == pytest.approx(1.0)


def test_modes_at_the_dots_are_those_of_the_mesh():
    library, geometry = load_library(), shell_geometry(180, 12)
    simulator, _ = shell_of(DataRequest(1, 180.0, 12.0))
    directions, azimuth = dot_directions(geometry), 37.0
    field = np.empty((len(library.modes[0]), 3))
    field[common_order(geometry, simulator.surface.position)] = library.modes[2].astype(float)
    exact = simulator.surface.sampler(directions, azimuth).sample(field)
    quick = modes_at(library, geometry, directions, azimuth)[2]
    assert np.abs(quick - exact).max() < 2e-3 * np.abs(exact).max()


def test_a_labelled_set_of_another_size_and_silicone_is_one_like_every_other(tmp_path):
    request = DataRequest(1, 200.0, 14.0, "Dragon Skin 20", azimuths=2, render="off", lamp="steady")
    shell = shell_of(request)
    paths = with_azimuths(library_paths()[9:10], 2)
    count = write_labelled(request, paths, library_source(shell[0]), tmp_path / "set", shell)
    data = LabelledSet(tmp_path / "set")
    assert data.params == EndcapParams(200, 14) and not data.has_pictures and len(data.column("path")) == count
    assert data.identity.aspects["silicone"]["name"] == "Dragon Skin 20"
    force, normal = data.column("force_n"), data.column("normal_n")
    top = LoadScale.of(shell_geometry(200, 14), silicone("Dragon Skin 20").neo_hooke().shear_mpa).top_n
    assert 0.2 * top < normal.max() < 1.2 * top
    touching = data.column("contact")
    assert np.abs(np.linalg.norm(force[touching], axis=1) / normal[touching]).min() > 0.99
    turned = data.column("azimuth_deg")
    half = len(force) // 2  # the same states at two azimuths: the same forces along the axis, turned across it
    assert force[:half, 2] == pytest.approx(force[half:, 2]) and turned[half] == pytest.approx((turned[0] + 180) % 360)
    assert force[:half, :2] == pytest.approx(-force[half:, :2])


def test_a_damaged_or_outdated_library_is_reported(tmp_path):
    with pytest.raises(FileError, match=r"no library of states"):
        load_library(tmp_path / "library.npz")
    (tmp_path / "half.npz").write_bytes(b"PK\x03\x04 not much")
    with pytest.raises(FileError, match=r"no library of states"):
        load_library(tmp_path / "half.npz")
    save_library(replace(load_library(), paths="others"), tmp_path / "old.npz")
    with pytest.raises(FileError, match=r"along other paths"):
        load_library(tmp_path / "old.npz")


def test_a_solved_shell_of_other_paths_is_no_part_of_a_library(tmp_path, monkeypatch):
    """The library says of all its states along which paths they were solved: a node that was kept must be of those."""
    node, file = solved_node(load_library(), 0, standing=True), tmp_path / "stands_D250_T6.5.npz"
    save_node(node, file)
    assert np.array_equal(read_node(file).wrench, node.wrench, equal_nan=True)
    moved = [replace(path, tilt_deg=path.tilt_deg + 1) for path in library_paths()]
    monkeypatch.setattr("sensing.simulator.similarity.paths.library_paths", lambda: moved)
    with pytest.raises(FileError, match=r"along other paths"):
        read_node(file)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(FileError, match=r"no solved shell"):
        read_node(file)


@pytest.mark.parametrize(("nudge", "same"), [(4e-14, True), (1e-5, False)])
def test_another_processors_last_bits_make_no_other_paths(nudge, same, monkeypatch):
    """Most by which vector units and linear algebra libraries were seen to differ, and a path that is another one."""
    shipped = load_library().paths
    moved = [replace(path, friction=path.friction + nudge, tilt_deg=path.tilt_deg - nudge) for path in library_paths()]
    monkeypatch.setattr("sensing.simulator.similarity.paths.library_paths", lambda: moved)
    assert (path_digest() == shipped) is same


def test_paths_are_those_of_no_protocol_and_press_to_the_range():
    numbers = [path.number for path in [*library_paths(), *stand_paths()]]
    assert len(set(numbers)) == len(numbers)
    loads = [p.target.normal_n for path in stand_paths() for p in path.waypoints]
    assert max(loads) == pytest.approx(35.0)


def test_no_place_for_a_library_is_one_line_before_an_hour_is_spent(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(solve, "_solve", lambda *_: pytest.fail("solved, and nowhere to put it"))
    (file := tmp_path / "file").write_text("no folder")
    assert solve.main(["--out", str(file)]) == 2
    assert solve.main(["--out", str(tmp_path / "nodes"), "--library", str(tmp_path / "none" / "library.npz")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and f"{file}: " in said[0] and "none/library.npz: " in said[1]
