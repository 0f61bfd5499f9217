"""Gains into endcaps.toml, and the contact thresholds with them: those were measured in N of the old gain."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

from sensing.live.core.config import EndcapConfig
from sensing.live.core.config_entries import change_entries


def store_gain(path: Path, endcap: EndcapConfig, gain: float, sd: float, digest: str) -> None:
    """Write a gain for one endcap; the rest of the file stays.

    Args:
        path: of endcaps.toml. endcap: as it is there. gain, sd: dimensionless. digest: of the model's weights.

    Raises:
        FileError: the file cannot be changed.
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
    change_entries(path, endcap.name, entries)
