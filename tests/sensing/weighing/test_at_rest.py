"""What counts as standing still grows with the load; without its gain an endcap touches at another force."""

import contextlib
from types import SimpleNamespace

import numpy as np
import pytest

from sensing.live.core.config import EndcapConfig
from sensing.weighing import session
from sensing.weighing.at_rest import Rest, _rest, _Row, _still
from sensing.weighing.film import as_trained
from sensing.weighing.gain import fit_gain
from sensing.weighing.words import GRAVITY_M_S2, PoseRequest


@pytest.mark.parametrize(
    ("load_n", "creeps_n", "is_still"), [(1, 0.04, True), (1, 0.06, False), (20, 0.15, True), (20, 0.25, False)]
)
def test_a_load_may_creep_by_a_hundredth(load_n, creeps_n, is_still):
    forces = -load_n + np.repeat([0.0, creeps_n], 10)
    rows = [_Row(0.1 * k, np.array([0, 0, f, 0, 0, 0]), np.eye(6), True, frozenset(), "") for k, f in enumerate(forces)]
    rest = _rest(rows)
    assert rest.moved_n == pytest.approx(creeps_n) and _still(rows, rest) is is_still


@pytest.mark.parametrize(
    ("load_n", "scatter_n", "is_still"), [(1, 0.1, True), (1, 0.2, False), (20, 0.3, True), (20, 0.5, False)]
)
def test_a_load_may_scatter_by_a_fiftieth(load_n, scatter_n, is_still):
    rows = [
        _Row(0.1 * k, np.array([0, 0, -load_n + scatter_n * (-1) ** k, 0, 0, 0]), np.eye(6), True, frozenset(), "")
        for k in range(20)
    ]
    assert _still(rows, _rest(rows)) is is_still


def test_a_soft_dome_stands_still_by_its_own_forces():
    forces = -1.0 + np.repeat([0.0, 0.04], 10)
    rows = [_Row(0.1 * k, np.array([0, 0, f, 0, 0, 0]), np.eye(6), True, frozenset(), "") for k, f in enumerate(forces)]
    assert _still(rows, _rest(rows)) and not _still(rows, _rest(rows), load_scale=0.04)


def test_without_its_gain_an_endcap_touches_at_what_the_weights_would_say():
    soft = EndcapConfig("a", "0", gain=0.5, gain_sd=0.01, contact_on_n=0.4, contact_off_n=0.2)
    plain = as_trained(soft)
    assert (plain.gain, plain.gain_sd) == (1.0, 0.0)
    assert (plain.contact_on_n, plain.contact_off_n) == (0.8, 0.4)  # half as stiff: weights read twice its force


def test_what_the_untouched_endcap_reads_is_no_load(monkeypatch):
    """Lamp, mounting or a small turn since the reference leave up to 0.6 N that nothing flags."""
    loads = [PoseRequest(grams).load_n() for grams in (600.0, 1800.0)]
    forces = iter([np.zeros(3), *(load / 0.73 for load in loads)])
    answers = iter(["", "600", "", "1800", "", ""])

    def at_rest(*_):
        return Rest(np.concatenate([np.add(next(forces), (0.1, 0.0, -0.6)), np.zeros(3)]), 0.1**2 * np.eye(6), 0.0, 30)

    monkeypatch.setattr(session, "Engine", lambda *_: contextlib.nullcontext())
    monkeypatch.setattr(session, "_await", at_rest)
    endcap = SimpleNamespace(name="a", pipeline=SimpleNamespace(zero="", model=SimpleNamespace(load_scale=1.0)))
    terms = session.Terms(0.0, 0.0, 0.0, GRAVITY_M_S2)
    poses = session.weigh_live(endcap, terms, lambda _: next(answers), lambda _: "")
    assert fit_gain(poses).gain == pytest.approx(0.73, abs=1e-12)
