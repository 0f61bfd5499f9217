"""Gains as entries of endcaps.toml; contact thresholds change with them, since they were measured with the old gain."""

from __future__ import annotations

import datetime
from typing import Any

from sensing.live.core.endcap_config import EndcapConfig


def gain_entries(endcap: EndcapConfig, gain: float, sd: float, digest: str) -> dict[str, Any]:
    """Entries of an endcap that change with a weighing.

    Args:
        endcap: as it is in the file.
        gain, sd: gain and its standard deviation, dimensionless.
        digest: digest of the model's weights.
    """
    date = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    entries: dict[str, Any] = {"gain": float(f"{gain:.5g}"), "gain_sd": float(f"{sd:.3g}")}
    entries |= {"gain_date": date, "gain_weights": digest}
    if endcap.contact_on_n > 0:
        ratio = gain / endcap.gain
        entries |= {
            "contact_on_n": float(f"{ratio * endcap.contact_on_n:.4g}"),
            "contact_off_n": float(f"{ratio * endcap.contact_off_n:.4g}"),
        }
    return entries
