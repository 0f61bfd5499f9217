"""``/endcap_N/zero`` (std_srvs/Trigger): a new reference of an endcap, answered when it was taken or refused.

    ros2 service call /endcap_0/zero std_srvs/srv/Trigger

A reference is refused while the endcap is touched, with the reason in the answer, as everywhere else; there is no
confirming over ROS. Requests are read in the form of ROS's Cyclone DDS layer
(``RMW_IMPLEMENTATION=rmw_cyclonedds_cpp``): who asks stands in a request's own bytes there, in Fast DDS's layer beside
them, and the two layers do not understand each other's services either.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.outputs.beat import Beat
from sensing.live.outputs.ros import dds, messages

if TYPE_CHECKING:
    from sensing.tracking.zero import Zero

POLL_S = 0.05
PATIENCE_S = 10.0
REFUSED = "not zeroed"


@dataclass(frozen=True)
class _Asked:
    """A request that waits for its answer."""

    end: _End
    asker: tuple[int, int]
    before: Zero | None
    until_s: float


@dataclass(frozen=True)
class _End:
    """Where the requests of one endcap come in and its answers go out."""

    pipeline: EndcapPipeline
    requests: Any
    replies: Any


class ZeroServices:
    """One service for each endcap.

    Args:
        participant: of the domain.
        pipelines: of the endcaps.
        on_error: takes what goes wrong with a request; the next one is answered all the same.
    """

    def __init__(
        self, participant: Any, pipelines: Sequence[EndcapPipeline], on_error: Callable[[Exception], None]
    ) -> None:
        messages.register_trigger()
        self._ends = [_end(participant, pipeline) for pipeline in pipelines]
        self._waiting: list[_Asked] = []
        self._beat = Beat(POLL_S, self._look, on_error)

    def start(self) -> None:
        """Begin to answer."""
        self._beat.start()

    def stop(self) -> None:
        """Nobody is answered any more."""
        self._beat.stop()
        self._ends, self._waiting = [], []

    def _look(self) -> None:
        now_s = time.monotonic()
        for end in self._ends:
            for request in end.requests.take(10):
                asker, before = (request.guid, request.seq), end.pipeline.zero
                refusal = end.pipeline.request_zero()
                if refusal:
                    _reply(end, asker, False, refusal)
                else:
                    self._waiting.append(_Asked(end, asker, before, now_s + PATIENCE_S))
        for _ in range(len(self._waiting)):
            asked = self._waiting.pop(0)  # first: an answer that cannot be written is not tried again
            if not _answered(asked, now_s):
                self._waiting.append(asked)


def _answered(asked: _Asked, now_s: float) -> bool:
    """Whether it is known what became of a request; then its asker knows it too."""
    zero, note = asked.end.pipeline.zero, asked.end.pipeline.note
    if zero is not None and zero is not asked.before:
        return _reply(asked.end, asked.asker, True, f"zeroed {zero.date}")
    if note.startswith(REFUSED):
        return _reply(asked.end, asked.asker, False, note)
    if now_s > asked.until_s:
        if zero is not None:  # or an unplugged camera would be zeroed when it comes back, whatever it carries then
            asked.end.pipeline.taker.cancel()
        return _reply(
            asked.end, asked.asker, False, f"{REFUSED}: no reference within {PATIENCE_S:g} s; see /diagnostics"
        )
    return False


def _reply(end: _End, asker: tuple[int, int], success: bool, message: str) -> bool:
    end.replies.write(dds.encoded(messages.TRIGGER_REPLY, messages.trigger_reply(asker, success, message)))
    return True


def _end(participant: Any, pipeline: EndcapPipeline) -> _End:
    from cyclonedds.pub import DataWriter
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic

    qos, service = dds.quality(), f"{pipeline.endcap.name}/zero"
    asked, answered = (
        Topic(participant, name, dds.idl_type(kind), qos=qos)
        for name, kind in (
            (f"rq/{service}Request", messages.TRIGGER_REQUEST),
            (f"rr/{service}Reply", messages.TRIGGER_REPLY),
        )
    )
    return _End(pipeline, DataReader(participant, asked, qos=qos), DataWriter(participant, answered, qos=qos))
