"""A live reading of an endcap as the sample that the estimator takes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sensing.tensegrity.samples import FootSample

if TYPE_CHECKING:
    from sensing.live.core.reading import EndcapReading


def foot_sample(reading: EndcapReading) -> FootSample:
    """The sample of a reading: its filtered wrench at the capture time, NaN where its numbers are not valid."""
    touching = reading.contact.touching if reading.contact.known else None
    wrench = reading.wrench
    return FootSample(
        reading.captured_s, reading.endcap, wrench.force_n, wrench.torque_nm, wrench.covariance, touching, wrench.flags
    )
