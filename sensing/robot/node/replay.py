"""A recording as a source: its samples in their order, and a comparison of its estimates to the bit."""

from __future__ import annotations

import hashlib
import math
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata

from cad.errors import FileError, printable
from sensing.live.mcap_records import CutError, DamagedError, read_records
from sensing.live.outputs.ros import types as ros
from sensing.robot.estimator import RobotEstimator
from sensing.robot.node import messages
from sensing.robot.node.record import estimate_text
from sensing.robot.node.recorder import DESCRIPTION, ESTIMATE, FORMAT, LENGTHS, METADATA
from sensing.robot.node.run import Output, Way, give
from sensing.robot.settings import DEFAULTS, Settings
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.robot_file import load_robot
from sensing.tensegrity.samples import FootSample, InertialSample, Sample

TIME = re.compile(rb'"time_s":(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?),')  # first key of an estimate
NEEDED = "no estimate without the lengths of the cables"  # note of a recording without lengths


@dataclass
class Outcome:
    """Result of a replay.

    Attributes:
        samples: number of samples read.
        compared: number of estimates computed again.
        different: number of estimates that differ from the recorded ones in any bit.
        inertial: whether the file holds an inertial sample.
        endcaps: names of the endcaps with a reading.
        end: damage at the file's end; None if it is complete.
    """

    samples: int = 0
    compared: int = 0
    different: int = 0
    inertial: bool = False
    endcaps: set[str] = field(default_factory=set)
    end: FileError | None = None

    @property
    def notes(self) -> list[str]:
        """Notes on missing samples, and what they prevented."""
        if self.inertial:
            return []
        contacts = "which endcaps touch" if self.endcaps else "no contacts either"
        return [f"no inertial sample in it: the first shape from the cables, held, {contacts}; motion is not measured"]


class Recording:
    """A recording of :class:`sensing.robot.node.recorder.RobotRecorder`.

    Args:
        path: path of the file.

    Attributes:
        robot: robot as the recording describes it.

    Raises:
        FileError: missing, no recording of a robot, of another version, or without the robot's description.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._about = path, dict[str, str]()
        description: bytes | None = None
        try:
            for record in read_records(path):
                if isinstance(record, Metadata) and record.name == METADATA:
                    self._about = dict(record.metadata)
                elif isinstance(record, Attachment) and record.name == DESCRIPTION:
                    description = record.data
                elif isinstance(record, Message):
                    break
        except (DamagedError, CutError):
            pass  # reported when the samples are read
        if not self._about:
            raise FileError(
                f"{path}: no recording of a robot: give one made with python -m sensing.robot --record FILE.mcap"
            )
        if self._about.get("format") != FORMAT or not self._about.get("wall_ns", "").lstrip("-").isdecimal():
            raise FileError(f"{path}: recorded by another version of the toolkit: replay it there, or record again")
        if description is None or hashlib.sha256(description).hexdigest() != self._about.get("sha256"):
            raise FileError(f"{path}: does not carry the robot's description whole: the file is damaged")
        with tempfile.TemporaryDirectory() as folder:
            (copy := Path(folder) / DESCRIPTION).write_bytes(description)
            self.robot: TensegrityRobot = load_robot(copy)

    def replay(self, outputs: Sequence[Output] = (), settings: Settings = DEFAULTS) -> Outcome:
        """Compute all estimates again and compare them with the recorded ones.

        Args:
            outputs: outputs that take samples and reports.
            settings: settings of the recorded run, which are needed for equal bits.

        Raises:
            FileError: a message that cannot be decoded.
            ParameterError: a sample that is not of this robot.
        """
        found, way, estimator = Outcome(), Way(self.robot), RobotEstimator(self.robot, settings)
        for topic, data in self._messages(found):
            if topic == ESTIMATE:
                estimate = estimator.state(_predicted_to(data, estimator.newest_s))
                found.compared += 1
                found.different += estimate is None or ros.string(estimate_text(estimate)) != data
                if estimate is not None:
                    report = way.report(estimate, None)
                    for output in outputs:
                        output.report(report)
            elif (sample := self._sample(topic, data)) is not None:
                found.samples += 1
                found.inertial |= isinstance(sample, InertialSample)
                if isinstance(sample, FootSample):
                    found.endcaps.add(sample.endcap)
                for output in outputs:
                    output.sample(sample)
                give(estimator, sample)
        if not found.compared and found.end is None:
            raise FileError(f"{self.path}: no estimate in it ({found.samples} samples): {NEEDED}; record for longer")
        return found

    def _messages(self, found: Outcome) -> Iterator[tuple[str, bytes]]:
        topics: dict[int, str] = {}
        try:
            for record in read_records(self.path):
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topics:
                    yield topics[record.channel_id], record.data
        except (DamagedError, CutError) as error:
            found.end = error

    def _sample(self, topic: str, data: bytes) -> Sample | None:
        if topic.startswith("/imu/"):
            kind = messages.IMU
        elif topic == LENGTHS:
            kind = messages.JOINTS
        elif topic.endswith("/wrench/with_covariance"):
            kind = ros.ENDCAP_WRENCH
        else:
            return None
        try:
            return messages.sample_of(kind, data, int(self._about["wall_ns"]))
        except Exception as error:  # each kind of damage raises another error
            raise FileError(f"{self.path}: {printable(topic)}: no {kind} ({printable(str(error))[:80]})") from None


def _predicted_to(estimate: bytes, newest_s: float) -> float | None:
    """Time of a recorded estimate, s, if it is later than all samples, so that it is a prediction; else None."""
    found = TIME.search(estimate)
    time_s = float(found[1]) if found else newest_s
    return time_s if newest_s < time_s < math.inf else None
