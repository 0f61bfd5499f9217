"""What the live bench runs: numbers of endcaps and threads, rates, outputs."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from sensing.live.core.seen import Pictures

ENDCAPS = 6
RATE_HZ = 30.0


@dataclass(frozen=True)
class Plan:
    """One live run.

    Attributes:
        endcaps, workers, rate_hz: of the run. page: with a viewer. in_step: all cameras take their pictures at the
            same moment. pictures: which are recorded; None without a recording.
    """

    endcaps: int = ENDCAPS
    workers: int = 1
    rate_hz: float = RATE_HZ
    page: bool = False
    in_step: bool = False
    pictures: Pictures | None = None

    @property
    def outputs(self) -> str:
        """In words."""
        named = ["page"] if self.page else []
        if self.pictures is not None:
            named.append({Pictures.NONE: "recording of dots"}.get(self.pictures, f"recording, {self.pictures}"))
        return " and ".join(named) or "none"


RECORDED = tuple(
    Plan(rate_hz=rate_hz, page=True, pictures=pictures)
    for rate_hz in (30, 60)
    for pictures in (Pictures.NONE, Pictures.FULL)
)
COMPUTED = (Plan(1), Plan(), Plan(in_step=True), Plan(rate_hz=60))
COMMON = (Plan(1), Plan())  # of every method
MORE = (  # of ours
    Plan(workers=2), Plan(workers=6), Plan(in_step=True), Plan(workers=2, in_step=True), Plan(page=True),
    Plan(workers=2, page=True), Plan(rate_hz=60), Plan(workers=2, rate_hz=60), Plan(rate_hz=60, page=True),
    Plan(workers=2, rate_hz=60, page=True), *RECORDED,
)  # fmt: skip


def about_run(plan: Plan) -> dict[str, Any]:
    """Cells of a plan."""
    return asdict(plan) | {"outputs": plan.outputs, "in_step": int(plan.in_step)}
