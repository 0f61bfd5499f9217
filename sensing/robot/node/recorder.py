"""Records a run as MCAP: every sample as it came, every estimate, and the robot's description.

The file holds samples and estimates in the order in which they were taken and made, so that ``--replay`` can compute
the estimates again from the samples and compare them to the bit. Foxglove and ``ros2 bag`` open it. Messages have the
time at which they were written; those of a run with a clock of its own have that clock's, however fast it runs.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from pathlib import Path

from mcap.writer import CompressionType, Writer

from cad.errors import FileError
from sensing.live.outputs.mcap.index_on_disk import IndexOnDisk
from sensing.live.outputs.mcap.new_file import create
from sensing.live.outputs.ros import types as ros
from sensing.live.outputs.ros.messages import LATCHED, STATIC, TRANSFORMS
from sensing.live.outputs.ros.wall_clock import wall_less_monotonic_ns
from sensing.robot.node import messages
from sensing.robot.node.record import Report, estimate_text
from sensing.robot.node.run import whole_ns
from sensing.tensegrity.description import TensegrityRobot
from sensing.tensegrity.samples import InertialSample, LengthSample, Sample

METADATA, FORMAT, DESCRIPTION = "endcap_robot", "1", "robot.toml"  # metadata record, its version, attachment
LENGTHS, ESTIMATE = "/cable_lengths", "/robot/estimate"  # topics of the recording
FLUSH_S = 1.0  # s, interval of writing; a killed run loses at most this


class RobotRecorder:
    """Writes one recording.

    Args:
        path: path of the file, which must not exist.
        robot: robot of the samples.
        description: bytes of the robot's file.
        wall_ns: wall time at which the samples' clock was 0; None where that is the monotonic clock of this process.
        lost: function that takes a line when writing fails.

    Attributes:
        samples, reports: numbers of those written; after a failure, of those that the file certainly holds.
        failed: reason of a failure; empty without one.

    Raises:
        FileError: the file exists or cannot be made.
    """

    def __init__(
        self, path: Path, robot: TensegrityRobot, description: bytes, wall_ns: int | None = None,
        lost: Callable[[str], object] = lambda _: None,
    ) -> None:  # fmt: skip
        self.path, self._robot, self._lost = path, robot, lost
        self.samples, self.reports, self.failed = 0, 0, ""
        self._kept = 0, 0  # samples and reports in the chunks that are in the file
        self.wall_ns = wall_less_monotonic_ns() if wall_ns is None else wall_ns
        self._newest_ns = wall_ns  # stamp of the newest sample, or estimate, of a clock of its own; None without
        self._cables = tuple(cable.name for cable in robot.cables if cable.measured)
        self._stream = create(path)
        self._writer = Writer(self._stream, chunk_size=1 << 18, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._index = self._indexed()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_s = time.monotonic()
        self._writer.start(profile="ros2", library="endcap-toolkit")
        digest = hashlib.sha256(description).hexdigest()
        about = {"format": FORMAT, "wall_ns": str(self.wall_ns), "robot": robot.name, "sha256": digest}
        self._writer.add_metadata(METADATA, about)
        self._writer.add_attachment(time.time_ns(), time.time_ns(), DESCRIPTION, "", description)

    def sample(self, sample: Sample) -> None:
        """Write a sample as it arrived."""
        stamp = self.wall_ns + (whole_ns(sample.time_s) if math.isfinite(sample.time_s) else 0)
        if not self._channels:
            self._add(STATIC, TRANSFORMS, messages.endcap_transforms(self._robot, stamp), stamp)
        kind, data = messages.sample_message(sample, self._cables, self.wall_ns)
        if isinstance(sample, InertialSample):
            topic = f"/imu/{sample.sensor}"
        else:
            topic = LENGTHS if isinstance(sample, LengthSample) else f"/{sample.endcap}/wrench/with_covariance"
        self.samples += not self.failed
        self._add(topic, kind, data, stamp)

    def report(self, report: Report) -> None:
        """Write an estimate, and the truth where it is known."""
        estimate = report.estimate
        stamp = self.wall_ns + whole_ns(estimate.time_s)
        self.reports += not self.failed
        self._add(ESTIMATE, ros.STRING, ros.string(estimate_text(estimate)), stamp)
        for bar in estimate.bars:
            self._add(f"/robot/bar/{bar.name}/odometry", messages.ODOMETRY, messages.odometry(bar, stamp), stamp)
        self._add("/robot/endcaps", messages.POSES, messages.endcap_poses(estimate, stamp), stamp)
        self._add("/tf", TRANSFORMS, messages.bar_transforms(estimate, stamp), stamp)
        if report.truth is not None:
            self._add("/robot/truth", messages.POSES, messages.pose_array(report.truth, stamp), stamp)

    @property
    def note(self) -> str:
        """Summary of the file, in one line."""
        what = f"{self.path}: {self.samples} samples and {self.reports} estimates recorded"
        return f"{what}, then stopped ({self.failed})" if self.failed else what

    def close(self) -> None:
        """Finish the file."""
        try:
            if not self.failed:
                self._writer.finish()
            self._stream.close()
        except OSError as error:
            self._fail(error)
        finally:
            self._index.close()

    def _indexed(self) -> IndexOnDisk:
        """The index of the chunks on disk; in memory it would grow as long as the robot runs.

        Raises:
            FileError: it cannot be written beside the file, which is then left out, too.
        """
        index = IndexOnDisk()
        try:
            index.take_over(self._writer, self.path.parent)
        except OSError as error:
            self._stream.close()
            self.path.unlink()
            raise FileError(f"{self.path}: {error.strerror}: give a folder with room in it") from None
        return index

    def _add(self, topic: str, kind: str, data: bytes, stamp_ns: int) -> None:
        if self.failed:
            return
        try:
            if topic not in self._channels:
                if kind not in self._schemas:
                    text = ros.definition(kind).encode()
                    self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text)
                about = LATCHED if topic == STATIC else {}
                self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind], about)
            now = time.time_ns()
            if self._newest_ns is not None:
                now = self._newest_ns = max(self._newest_ns, stamp_ns)
            self._writer.add_message(self._channels[topic], now, data, now)
            if time.monotonic() >= self._flushed_s + FLUSH_S:
                self._writer.flush()
                self._stream.flush()
                self._flushed_s, self._kept = time.monotonic(), (self.samples, self.reports)
        except OSError as error:  # disk full: the run goes on, and the file is readable up to here
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        if not self.failed:
            self.failed = str(error.strerror)
            self._lost(f"{self.path}: nothing more is recorded ({self.failed})")
        self.samples, self.reports = self._kept
