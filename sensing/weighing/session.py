"""Guided weighing of a running endcap: prompts, readings and refusals. N, g, s.

    poses = weigh_live(endcap, Terms(tilt_deg=0.0), ask, say)

``ask`` shows a line and waits for Enter or a word, ``say`` shows a line; tests give their own.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cad.errors import EndcapError, ParameterError
from cad.messages import transient
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.first_reference import without_reference
from sensing.live.core.reading import EndcapReading
from sensing.weighing.at_rest import Rest, RestWatch
from sensing.weighing.gain import Pose, WeighingError, fit_gain, pose_gain, require_unit
from sensing.weighing.words import PoseRequest, parse_weight_g

REST_S = 15.0  # longest wait for rest
POLL_S = 0.1  # s between looks at the readings
GRAVITIES_M_S2 = (9.76, 9.84)  # range of gravity on the Earth's surface
Ask = Callable[[str], str]


@dataclass(frozen=True)
class Terms:
    """Conditions of all poses of a session.

    Attributes:
        tilt_deg, azimuth_deg: attitude, degrees.
        sd_g: standard deviation of the scale, g; 0 for the usual one.
        gravity_m_s2: local gravity, m/s2.

    Raises:
        ParameterError: a gravity that no place on Earth has.
    """

    tilt_deg: float
    azimuth_deg: float
    sd_g: float
    gravity_m_s2: float

    def __post_init__(self) -> None:
        low, high = GRAVITIES_M_S2
        if not low <= self.gravity_m_s2 <= high:
            raise ParameterError(
                f"gravity={self.gravity_m_s2:g} outside {low:g}..{high:g} m/s2, what the Earth's surface has",
                name="gravity",
                value=self.gravity_m_s2,
            )

    def request(self, words: str) -> PoseRequest:
        """The pose with the weight that the user typed."""
        return PoseRequest(parse_weight_g(words, self.gravity_m_s2), self.tilt_deg, self.azimuth_deg, self.sd_g)


class Listener:
    """Output that passes every reading to the current watch.

    Args:
        load_scale: scale of the endcap's forces (:class:`RestWatch`).
    """

    def __init__(self, load_scale: float) -> None:
        self._load_scale = load_scale
        self._watch = RestWatch(load_scale)
        self._lock = threading.Lock()

    def put(self, reading: EndcapReading) -> None:
        """Take a reading, in the loop's thread."""
        with self._lock:
            self._watch.add(reading)

    def anew(self) -> None:
        """Drop all readings."""
        with self._lock:
            self._watch = RestWatch(self._load_scale)

    def ask(self, what: Callable[[RestWatch], Rest]) -> Rest:
        """Result of a question to the watch."""
        with self._lock:
            return what(self._watch)

    def newest(self) -> tuple[float, float]:
        """(newest force, its change), N, as in :meth:`RestWatch.newest`."""
        with self._lock:
            return self._watch.newest()


def weigh_live(endcap: LiveEndcap, terms: Terms, ask: Ask, say: Ask) -> list[Pose]:
    """Guide the user through any number of poses; a refused one can be repeated.

    Args:
        endcap: endcap that is not yet started, without a gain.
        terms: conditions of the session.
        ask, say: functions that ask for a line, and show one.

    Raises:
        EndcapError: no reference, or a load while the endcap should be untouched.
    """
    listener, poses = Listener(endcap.pipeline.model.load_scale), list[Pose]()
    ask(f"{endcap.name}: leave it untouched, at the attitude in which it will be loaded, then press Enter ")
    with Engine([endcap], [listener]):
        _await_reference(endcap)
        untouched = _await(endcap, listener, RestWatch.untouched, "untouched")
        say(f"  untouched: {np.linalg.norm(untouched.wrench[:3]):.2f} N, no contact; taken out of what follows")
        while True:
            more = "" if len(poses) < 2 else ", or Enter to finish"
            word = ask(f"weight {len(poses) + 1}: what presses on the dome, everything included, in g{more}: ").strip()
            if not word and more:
                return poses
            try:
                request = terms.request(word)
                ask(f"  load it with {request.name}, let it stand still, then press Enter ")
                listener.anew()
                pressed = _await(endcap, listener, RestWatch.pressed, "under the load")
                pose = made_pose(request, pressed.less(untouched), terms.gravity_m_s2)
                require_unit(pose)
                if len(poses) > 1:
                    fit_gain([*poses, pose])
            except EndcapError as error:
                say(f"  refused: {error}")
                continue
            poses.append(pose)
            gain, sd = pose_gain(pose)
            say(
                f"  the endcap reads {pose.reading_n:.2f} N, {pose.weight_n:.2f} N press: gain {gain:.3f} ± {sd:.3f}"
                f"{pressed.note}"
            )


def made_pose(request: PoseRequest, rest: Rest, gravity_m_s2: float) -> Pose:
    """Load and reading of one pose.

    Args:
        request: weight and attitude.
        rest: the interval at rest under it.
        gravity_m_s2: local gravity, m/s2.

    Raises:
        WeighingError: a model that gives no covariance.
    """
    covariance = rest.covariance[:3, :3]
    if not np.isfinite(covariance).all():
        raise WeighingError("this model gives no covariance: weigh with the default model")
    return Pose(
        request.name, request.load_n(gravity_m_s2), request.load_sd_n(gravity_m_s2), rest.wrench[:3], covariance
    )


def _await_reference(endcap: LiveEndcap) -> None:
    why = without_reference(endcap)
    if why:
        raise WeighingError(f"{endcap.name}: {why}")


def _await(endcap: LiveEndcap, listener: Listener, what: Callable[[RestWatch], Rest], where: str) -> Rest:
    """Wait for an interval at rest; a terminal shows the reason of the wait, a refusal that of the endcap, too."""
    end_s = time.monotonic() + REST_S
    while True:
        time.sleep(POLL_S)
        try:
            found = listener.ask(what)
            _show("")
            return found
        except WeighingError as error:
            force, moved = listener.newest()
            if force == force:
                _show(f"  {where}: {force:.2f} N, moved by {moved:.2f} N in the last second")
            if time.monotonic() > end_s:
                _show("")
                if endcap.health.valid:
                    raise
                condition = endcap.machine.condition
                raise WeighingError(f"{error}; now {condition.state}: {condition.reason}") from None


def _show(text: str) -> None:
    transient(text)
