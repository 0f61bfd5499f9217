"""The guide of ``sensing.weigh`` when its user errs: no refusal ends it, and a wrong weight can be taken out."""

import contextlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cad.errors import ParameterError
from sensing.live.core.endcap_config import EndcapConfig
from sensing.records import Wrench
from sensing.weighing import session
from sensing.weighing.at_rest import Rest, RestWatch
from sensing.weighing.gain import WeighingError, fit_gain
from sensing.weighing.words import GRAVITY_M_S2, PoseRequest

GAIN = 0.73
UNTOUCHED = "untouched"


class Bench:
    """A user and the endcap: each answer is a word, and under ``(word, grams)`` so many grams stand on the dome."""

    def __init__(self, monkeypatch, *answers):
        self.answers, self.asked, self.said, self.grams, self.zeroed = iter(answers), [], [], 0.0, 0
        monkeypatch.setattr(session, "Engine", lambda *_: contextlib.nullcontext())
        monkeypatch.setattr(session, "_await_reference", lambda _: None)
        monkeypatch.setattr(session, "_await", self.rest)

    def rest(self, _endcap, _listener, _what, where):
        self.zeroed += where == UNTOUCHED
        force_n = PoseRequest(self.grams).load_n() / GAIN if self.grams else np.zeros(3)
        return Rest(np.concatenate([force_n, np.zeros(3)]), 0.05**2 * np.eye(6), 0.0, 30)

    def ask(self, text):
        self.asked.append(text)
        answer = next(self.answers)
        word, self.grams = answer if isinstance(answer, tuple) else (answer, 0.0)
        return word

    def weigh(self):
        pipeline = SimpleNamespace(model=SimpleNamespace(load_scale=1.0), endcap=EndcapConfig("a", "0"))
        endcap = SimpleNamespace(name="a", pipeline=pipeline)
        terms = session.Terms(0.0, 0.0, 0.0, GRAVITY_M_S2)
        return session.weigh_live(endcap, terms, self.ask, lambda text: self.said.append(text) or "")

    @property
    def text(self):
        return "\n".join(self.said)


def names(poses):
    return [pose.name for pose in poses]


def test_a_first_weight_that_was_typed_wrong_is_taken_out_by_the_third(monkeypatch):
    """Every right weight was refused after it, and Enter ended the session with nothing stored."""
    bench = Bench(monkeypatch, "", "800", ("", 500), "1000", ("", 1000), "", "1500", ("", 1500), "500", ("", 500), "")
    poses = bench.weigh()
    assert names(poses) == ["1000 g", "1500 g", "500 g"]
    assert fit_gain(poses).gain == pytest.approx(GAIN, abs=1e-9)
    assert bench.text.count("refused: the weights contradict one another") == 3  # the pair, Enter, and the third
    assert "kept: 800 g, 1000 g" in bench.text and "kept: 1000 g, 1500 g" in bench.text


def test_a_newest_weight_that_contradicts_is_left_out_as_before(monkeypatch):
    bench = Bench(monkeypatch, "", "500", ("", 500), "1000", ("", 1000), "2000", ("", 1500), "")
    assert names(bench.weigh()) == ["500 g", "1000 g"] and "kept: 500 g, 1000 g" in bench.text
    assert "gain 0.973" not in bench.text  # its own, which would look like an accepted one


def test_the_last_weight_can_be_taken_back(monkeypatch):
    bench = Bench(
        monkeypatch, "", "undo", "550", ("", 500), " Undo ", "500", ("", 500), "1000", ("", 1000), ""
    )  # fmt: skip
    assert names(bench.weigh()) == ["500 g", "1000 g"] and "550 g: taken back" in bench.text
    assert "'undo' is no weight" in bench.text and "undo" not in bench.asked[1] and "undo" in bench.asked[4]


def test_equal_weights_do_not_end_the_guide(monkeypatch):
    bench = Bench(monkeypatch, "", "500", ("", 500), "500", ("", 500), "", "1000", ("", 1000), "")
    assert names(bench.weigh()) == ["500 g", "500 g", "1000 g"] and "differ by a factor" in bench.text


def test_a_weight_typed_where_enter_is_asked_is_not_taken_for_it(monkeypatch):
    bench = Bench(monkeypatch, "", "600", ("500", 500), "500", ("", 500), "1000", ("", 1000), "")
    assert names(bench.weigh()) == ["500 g", "1000 g"] and "'500' instead of Enter: nothing was weighed" in bench.text


def test_after_a_break_the_untouched_endcap_is_measured_again(monkeypatch):
    clock = iter([0.0, 595.0, 605.0, 615.0])  # at rest; first weight; second; at rest again
    monkeypatch.setattr(session, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    bench = Bench(monkeypatch, "", "500", ("", 500), "1000", "", ("", 1000), "")
    assert names(bench.weigh()) == ["500 g", "1000 g"] and bench.zeroed == 2
    assert "untouched 10 minutes ago: take everything off" in bench.asked[4]


def test_nothing_is_kept_while_the_user_is_away():
    """The readings of a night at 30 a second were a gigabyte."""
    listener = session.Listener(1.0)

    def reading(number):
        wrench = Wrench(number / 30, np.zeros(3), np.zeros(3), "endcap", np.eye(6), frozenset())
        contact = SimpleNamespace(touching=False)
        return SimpleNamespace(valid=True, estimate=wrench, tracks=None, contact=contact, reason="")

    for number in range(40):
        listener.put(reading(number))
    assert listener.newest()[0] != listener.newest()[0]
    listener.begin()
    for number in range(40, 80):
        listener.put(reading(number))
    assert listener.ask(RestWatch.untouched).readings == 31
    listener.end()
    assert listener.newest()[0] != listener.newest()[0]


def test_a_reference_with_which_no_weight_would_count_is_named_before_the_first_weight():
    check = SimpleNamespace(doubt="74 of the 91 dots are in the rest picture")
    endcap = SimpleNamespace(name="a", pipeline=SimpleNamespace(zero="", check=check))
    with pytest.raises(WeighingError, match="a: no weight would count, every reading is flagged: 74 of the 91 dots"):
        session._await_reference(endcap)
    check.doubt = ""
    session._await_reference(endcap)


def test_an_endcap_that_is_not_untouched_names_the_command_that_zeroes_it(monkeypatch, capsys):
    """The advice was sensing.setup, which refuses where endcaps.toml is: gain and relaxation would have to go."""
    listener = session.Listener(1.0)
    monkeypatch.setattr(session, "REST_S", 0.0)
    monkeypatch.setattr(session, "POLL_S", 0.0)

    def pressed():
        for number in range(40):
            wrench = Wrench(
                number / 30, np.array([0.0, 0.2, 0.0]), np.zeros(3), "endcap", np.eye(6), frozenset({"moved"})
            )
            yield SimpleNamespace(
                valid=True, estimate=wrench, tracks=None, contact=SimpleNamespace(touching=True), reason=""
            )

    monkeypatch.setattr(listener, "end", lambda: None)
    begin = listener.begin
    monkeypatch.setattr(listener, "begin", lambda: (begin(), [listener.put(each) for each in pressed()]))
    endcap = EndcapConfig("a", "http://bob:secret@10.0.0.7/", Path("a.npz"), 142.0, 9.6)
    live = SimpleNamespace(pipeline=SimpleNamespace(endcap=endcap), health=SimpleNamespace(valid=True))
    with pytest.raises(WeighingError) as refused:
        session._Guide(live, listener, None, None, print).poses()
    said = str(refused.value)
    assert "0.20 N (moved) while it should be untouched" in said and "secret" not in said
    assert said.endswith(
        "sensing.zero take --source http://***@10.0.0.7/ --sensor a --diameter 142 --wall 9.6 --out a.npz"
    )
    assert session._again(EndcapConfig("a", "0")) == "start again"


@pytest.mark.parametrize(("terms", "said"), [((95.0, 0.0, 0.0), "tilt_deg=95"), ((0.0, 0.0, -1.0), "sd_g=-1")])
def test_an_attitude_that_no_pose_has_is_refused_before_anything_is_asked(terms, said):
    with pytest.raises(ParameterError, match=said):
        session.Terms(*terms, GRAVITY_M_S2)


def test_gravity_is_that_of_a_place_on_earth():
    """Huascaran has 9.764 m/s2, the Arctic Ocean 9.834 (Hirt and others 2013, doi:10.1002/grl.50838)."""
    assert [session.Terms(0.0, 0.0, 0.0, gravity).gravity_m_s2 for gravity in (9.764, 9.834)] == [9.764, 9.834]
    for gravity in (9.75, 9.85, float("nan")):
        with pytest.raises(ParameterError, match="what the Earth's surface has"):
            session.Terms(0.0, 0.0, 0.0, gravity)


def test_of_an_interval_at_rest_a_pose_takes_the_force_and_its_covariance():
    covariance = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    pose = session.made_pose(PoseRequest(500.0), Rest(np.arange(6.0), covariance, 0.0, 30), GRAVITY_M_S2)
    assert pose.force_n.tolist() == [0.0, 1.0, 2.0] and np.diag(pose.covariance).tolist() == [1.0, 2.0, 3.0]
