"""Provenance of weights, part of their file: data and settings of the training."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from sensing.learning.fit_config import FitConfig
from sensing.learning.samples import Samples
from sensing.wrench.model import WrenchModel


def provenance(
    samples: Samples, config: FitConfig, start: WrenchModel | None, others: Samples | None = None
) -> dict[str, Any]:
    """Provenance of a training as plain JSON. Folders are named without their parents.

    Args:
        samples: training samples.
        config: settings of the training.
        start: weights that were fine-tuned; their own training is kept, and its paths count as known.
        others: samples of the covariance alone; their paths count as known, too.
    """
    before = None if start is None else start.about.get("training")
    known = set((before or {}).get("paths", ()))
    seen = [samples] if others is None else [samples, others]
    return {
        "sources": [Path(name).name for part in seen for name in part.sources],
        "paths": sorted(known.union(*(map(str, part.path) for part in seen))),
        "frames": len(samples),
        "config": asdict(config),
        "torch": str(torch.__version__),
        "data_digest": samples.digest,
        "start": before,
    }
