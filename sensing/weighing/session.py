"""Guided weighing of a running endcap: prompts, readings and refusals. N, g, s.

    poses = weigh_live(endcap, Terms(tilt_deg=0.0), ask, say)

``ask`` shows a line and waits for Enter or a word, ``say`` shows a line; tests give their own. No refusal ends the
guide: of weights that contradict one another the one that does not agree with the others is taken out, and two alone
stay until a third shows which of them is wrong.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cad.errors import EndcapError, ParameterError
from cad.messages import transient
from sensing.calibration.command_for import zero_command
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.first_reference import without_reference
from sensing.live.core.reading import EndcapReading
from sensing.weighing.at_rest import Rest, RestWatch
from sensing.weighing.gain import (
    ContradictionError,
    Pose,
    WeighingError,
    agreed_gain,
    fit_gain,
    pose_gain,
    require_unit,
)
from sensing.weighing.words import MOST_G, PoseRequest, parse_weight_g

REST_S = 15.0  # longest wait for rest
POLL_S = 0.1  # s between looks at the readings
GRAVITIES_M_S2 = (9.76, 9.84)  # range of gravity on the Earth's surface
FRESH_S = 600.0  # E: for so long the untouched reading holds; lamp and mounting drift by up to 0.6 N over hours
UNDO = "undo"  # typed instead of a weight: takes the last one back
Ask = Callable[[str], str]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Terms:
    """Conditions of all poses of a session.

    Attributes:
        tilt_deg, azimuth_deg: attitude, degrees.
        sd_g: standard deviation of the scale, g; 0 for the usual one.
        gravity_m_s2: local gravity, m/s2.

    Raises:
        ParameterError: a gravity that no place on Earth has, an attitude or a scale that no pose can have.
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
        PoseRequest(MOST_G, self.tilt_deg, self.azimuth_deg, self.sd_g)  # refused before anything is asked

    def request(self, words: str) -> PoseRequest:
        """The pose with the weight that the user typed."""
        return PoseRequest(parse_weight_g(words, self.gravity_m_s2), self.tilt_deg, self.azimuth_deg, self.sd_g)


class Listener:
    """Output that passes readings to a watch while a question waits for its answer, and drops them otherwise.

    Args:
        load_scale: scale of the endcap's forces (:class:`RestWatch`).
    """

    def __init__(self, load_scale: float) -> None:
        self._load_scale = load_scale
        self._watch: RestWatch | None = None
        self._lock = threading.Lock()

    def put(self, reading: EndcapReading) -> None:
        """Take a reading, in the loop's thread."""
        with self._lock:
            if self._watch is not None:
                self._watch.add(reading)

    def begin(self) -> None:
        """Listen from now on."""
        with self._lock:
            self._watch = RestWatch(self._load_scale)

    def end(self) -> None:
        """Drop all readings, and those to come: a user may take hours for an answer."""
        with self._lock:
            self._watch = None

    def ask(self, what: Callable[[RestWatch], Rest]) -> Rest:
        """Result of a question to the watch."""
        with self._lock:
            return what(self._watch or RestWatch(self._load_scale))

    def newest(self) -> tuple[float, float]:
        """(newest force, its change), N, as in :meth:`RestWatch.newest`."""
        with self._lock:
            return (self._watch or RestWatch()).newest()


def weigh_live(endcap: LiveEndcap, terms: Terms, ask: Ask, say: Say) -> list[Pose]:
    """Guide the user through any number of poses that agree; a refused one can be repeated.

    Args:
        endcap: endcap that is not yet started, without a gain.
        terms: conditions of the session.
        ask, say: functions that ask for a line, and show one.

    Raises:
        EndcapError: no reference, or a load while the endcap should be untouched at the start.
    """
    listener = Listener(endcap.pipeline.model.load_scale)
    ask(f"{endcap.name}: leave it untouched, at the attitude in which it will be loaded, then press Enter ")
    with Engine([endcap], [listener]):
        _await_reference(endcap)
        return _Guide(endcap, listener, terms, ask, say).poses()


class _Guide:
    """The questions of a session, from the untouched endcap to the last weight."""

    def __init__(self, endcap: LiveEndcap, listener: Listener, terms: Terms, ask: Ask, say: Say) -> None:
        self._endcap, self._listener, self._terms, self._ask, self._say = endcap, listener, terms, ask, say
        self._poses: list[Pose] = []

    def poses(self) -> list[Pose]:
        """Ask until the user has no other weight and all agree."""
        self._rest()
        while True:
            more = ("", f", or {UNDO}", f", {UNDO} or Enter to finish")[min(len(self._poses), 2)]
            word = self._ask(
                f"weight {len(self._poses) + 1}: what presses on the dome, everything included, in g{more}: "
            ).strip()
            try:
                if not word and len(self._poses) > 1:
                    fit_gain(self._poses)
                    return self._poses
                if word.lower() == UNDO and self._poses:
                    self._say(f"  {self._poses.pop().name}: taken back")
                else:
                    self._weigh(word)
            except EndcapError as error:
                self._say(f"  refused: {error}")
                if isinstance(error, ContradictionError):
                    self._say(f"  kept: {', '.join(pose.name for pose in self._poses)}")

    def _rest(self) -> None:
        """Measure the untouched endcap."""
        again = _again(self._endcap.pipeline.endcap)
        self._untouched = _await(self._endcap, self._listener, lambda watch: watch.untouched(again), "untouched")
        self._untouched_s = time.monotonic()
        left_n = np.linalg.norm(self._untouched.wrench[:3])
        self._say(f"  untouched: {left_n:.2f} N, no contact; taken out of what follows")

    def _weigh(self, word: str) -> None:
        """Weigh with what the user typed.

        Raises:
            EndcapError: no weight, nothing at rest under it, a wrong unit, or a weight that contradicts the others.
        """
        request = self._terms.request(word)
        passed_s = time.monotonic() - self._untouched_s
        if passed_s > FRESH_S:
            self._ask(f"  untouched {passed_s / 60:.0f} minutes ago: take everything off again, then press Enter ")
            self._rest()
        typed = self._ask(f"  load it with {request.name}, let it stand still, then press Enter ").strip()
        if typed:
            raise WeighingError(f"{typed[:40]!r} instead of Enter: nothing was weighed, give the weight again")
        pressed = _await(self._endcap, self._listener, RestWatch.pressed, "under the load")
        pose = made_pose(request, pressed.less(self._untouched), self._terms.gravity_m_s2)
        require_unit(pose)
        gain, sd = pose_gain(pose)
        read = f"the endcap reads {pose.reading_n:.2f} N, {pose.weight_n:.2f} N press: gain {gain:.3f} ± {sd:.3f}"
        self._take(pose, f"  {read}{pressed.note}")

    def _take(self, pose: Pose, read: str) -> None:
        """Add a pose to the others, and take out the one that contradicts the others.

        Raises:
            WeighingError: poses contradict one another; two are kept, because only a third shows which one is wrong.
        """
        together = [*self._poses, pose]
        try:
            if len(together) > 1:
                agreed_gain(together)
        except ContradictionError as error:
            if error.worst is not None or len(together) == 2:
                self._poses = [each for k, each in enumerate(together) if k != error.worst]
                if error.worst != len(together) - 1:
                    self._say(read)
            raise
        self._poses = together
        self._say(read)


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


def _again(endcap: EndcapConfig) -> str:
    """How an endcap is zeroed again: by itself at the next start, or with a command that replaces its file."""
    if endcap.zero is None:
        return "start again"
    return zero_command(endcap.params, endcap.source, endcap.name, endcap.zero)


def _await_reference(endcap: LiveEndcap) -> None:
    why, check = without_reference(endcap), endcap.pipeline.check
    if why:
        raise WeighingError(f"{endcap.name}: {why}")
    if check is not None and check.doubt:
        raise WeighingError(f"{endcap.name}: no weight would count, every reading is flagged: {check.doubt}")


def _await(endcap: LiveEndcap, listener: Listener, what: Callable[[RestWatch], Rest], where: str) -> Rest:
    """Listen until an interval is at rest; a terminal shows why it waits, a refusal names the endcap's state."""
    end_s = time.monotonic() + REST_S
    listener.begin()
    try:
        while True:
            time.sleep(POLL_S)
            try:
                return listener.ask(what)
            except WeighingError as error:
                force, moved = listener.newest()
                if force == force:
                    transient(f"  {where}: {force:.2f} N, moved by {moved:.2f} N in the last second")
                if time.monotonic() > end_s:
                    if endcap.health.valid:
                        raise
                    condition = endcap.machine.condition
                    raise WeighingError(f"{error}; now {condition.state}: {condition.reason}") from None
    finally:
        transient()
        listener.end()
