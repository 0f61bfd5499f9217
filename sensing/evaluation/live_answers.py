"""Answers of the live pipeline, the object that users run, on labelled frames.

    answers = live_answers(LabelledSet("exports/test"), load_model("default", params), camera=None)
    answers.value - answers.truth

Every loading path has a pipeline of its own, zeroed on the path's untouched picture. Wrenches on the endcap about
the sphere's centre, N and N m.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cad.errors import FileError
from cad.materials import DEFAULT_SILICONE
from cad.messages import transient
from sensing.evaluation.place_errors import place_errors
from sensing.frames import T_sphere_endcap, wrench_adjoint
from sensing.live.core.endcap_config import EndcapConfig, dots_of
from sensing.live.core.model import LiveModel
from sensing.live.core.pipeline import EndcapPipeline
from sensing.live.core.reading import EndcapReading
from sensing.records_labelled import LabelledFrame, LabelledSet
from sensing.tracking.zero import single_zero
from sensing.wrench.plane_contact import PlaneContactLaw
from sensing.wrench.stiffness import shear_mpa_of

Array = NDArray[np.float64]
SHORTEST_S = 1e-6  # least time step between states that are labelled with the same time


@dataclass(frozen=True)
class LiveAnswers:
    """Answers of single frames (without the filter), in the order of the set.

    Attributes:
        value, truth: (N, 6) wrenches, N and N m.
        covariance: (N, 6, 6) covariances of the answers.
        model_covariance: (N, 6, 6) covariances without the camera's part.
        flagged: (N,) bool, True where the model reports that the field is unlike those of training.
        tilt_deg: (N,) polar angle of first contact, NaN where unknown.
        place: (N, 4) degrees: error of the contact centre (seen from the sphere's centre), error of the normal, and the
            stated standard deviations of both (of one direction); NaN where the place of the plane is not known.
        contact: (N,) bool, whether anything touches.
        path: (N,) str, identity of the loading path.
    """

    value: Array
    truth: Array
    covariance: Array
    model_covariance: Array
    flagged: NDArray[np.bool_]
    tilt_deg: Array
    place: Array
    contact: NDArray[np.bool_]
    path: NDArray[np.str_]

    def take(self, rows: NDArray) -> LiveAnswers:
        """The answers that an index or a mask selects."""
        return LiveAnswers(**{name: getattr(self, name)[rows] for name in self.__dataclass_fields__})


def live_answers(data: LabelledSet, model: LiveModel, camera: Path | None) -> LiveAnswers:
    """Run all frames of a set through :class:`sensing.live.core.pipeline.EndcapPipeline`.

    Args:
        data: labelled frames with pictures.
        model: model for the set's design.
        camera: file of the calibrated camera; None for the nominal one.

    Raises:
        FileError: no frames, or a frame that the pipeline cannot use (its message is passed on).
    """
    to_sphere = wrench_adjoint(T_sphere_endcap(data.params))
    rows: list[tuple[Any, ...]] = []
    plane = data.manifest["request"].get("indenter", "plane") == "plane"
    law = PlaneContactLaw(data.params, shear_mpa_of(model.estimator)) if plane else None
    for item, reading in _readings(data, model, camera):
        estimate, alone = reading.estimate, model.estimator.estimate(reading.field)
        rows.append((
            to_sphere @ np.concatenate([estimate.force_n, estimate.torque_nm]),
            to_sphere @ np.concatenate([item.wrench.force_n, item.wrench.torque_nm]),
            to_sphere @ estimate.covariance @ to_sphere.T, alone.covariance,
            bool(alone.flags), float(item.labels["tilt_deg"]),
            place_errors(item, estimate, law, data.params), item.contact, data.path_name(item.path),
        ))  # fmt: skip
        if len(rows) % 50 == 0:
            transient(f"{data.folder}: {len(rows)} frames through the pipeline")
    if not rows:
        raise FileError(f"{data.folder}: a set without frames: let the command that writes it run first")
    return LiveAnswers(*(np.array(column) for column in zip(*rows, strict=True)))


def _readings(
    data: LabelledSet, model: LiveModel, camera: Path | None
) -> Iterator[tuple[LabelledFrame, EndcapReading]]:
    """(frame, reading) of every frame."""
    pipeline, run, last_s = None, None, float("-inf")
    for item in data.frames():
        now = (item.path, str(item.labels["azimuth_deg"]))
        if pipeline is None or now != run:  # a new run: another reference, or the contact jumps
            pipeline, run, last_s = _pipeline(data, model, item, camera), now, float("-inf")
        last_s = max(item.frame.time_s, last_s + SHORTEST_S)
        reading = pipeline.update(replace(item.frame, time_s=last_s))
        if reading is None or not reading.valid:
            reason = reading.reason if reading is not None else pipeline.outcome[1] if pipeline.outcome else "late"
            raise FileError(f"{item.frame.source}: no answer on frame {item.frame.sequence}: {reason}")
        yield item, reading


def _pipeline(data: LabelledSet, model: LiveModel, item: LabelledFrame, camera: Path | None) -> EndcapPipeline:
    """Pipeline of the set's endcap: its size, dots and silicone."""
    design = data.params
    config = EndcapConfig(
        "evaluated", "labelled", diameter_mm=design.diameter_mm, wall_mm=design.wall_mm, camera=camera,
        silicone=data.silicone or DEFAULT_SILICONE, **dots_of(design),
    )  # fmt: skip
    return EndcapPipeline(config, model, single_zero(item.reference))
