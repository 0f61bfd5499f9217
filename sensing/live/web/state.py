"""Content of the page as plain JSON: all once at the start, then the newest numbers on request."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from sensing.live.core.reading import EndcapReading, nothing, plain, rounded
from sensing.live.core.stats import EndcapHealth

if TYPE_CHECKING:
    from sensing.live.outputs.mcap.recording import Recording
    from sensing.live.run import LiveRun

ARROWS = 16  # across the field that is drawn
UNIT_PX = 0.01  # of its arrows, px of the 200 x 200 crop


def hello(run: LiveRun) -> dict[str, Any]:
    """What does not change: names, sizes and places of the endcaps (mm, robot frame)."""
    endcaps = [
        {
            "name": endcap.name,
            "radius_mm": endcap.params.outer_radius_mm,
            "centre_mm": endcap.params.centre_height_mm,
            "T_robot_endcap": endcap.T_robot_endcap.tolist(),
            "weighed": endcap.weighed,
            "rate_effects": endcap.rate_effects,
            "diameter_mm": endcap.diameter_mm,
            "wall_mm": endcap.wall_mm,
            "silicone": endcap.silicone,
        }
        for endcap in run.config.endcaps
    ]
    return {"hello": endcaps, "begun_s": run.begin_s, "weight_n": run.config.weight_n, "model": run.config.model}


def state(run: LiveRun, recording: Recording) -> dict[str, Any]:
    """The newest numbers of all endcaps, and how recording and replay go."""
    readings, robot = run.latest.all(), run.robot()
    endcaps = [_endcap(health, readings.get(health.endcap)) for health in run.engine.health()]
    return {
        "time_s": time.monotonic(),
        "seen": int(1e3 * time.monotonic()),
        "now_s": int(time.time()),  # the page may run on another computer, whose clock is not this one
        "endcaps": endcaps,
        "touching": list(robot.touching),
        "force_sum_n": rounded(float(np.linalg.norm(robot.force_n)), 2),
        "consistent": robot.consistent,
        "recording": recording.state(),
        "replay": None if run.playback is None else run.playback.state(),
    }


def _endcap(health: EndcapHealth, reading: EndcapReading | None) -> dict[str, Any]:
    reported: dict[str, Any] = {
        "name": health.endcap,
        "status": health.status,
        "level": health.level,
        "zeroed": health.zeroed,
        "confirmable": health.confirmable,
        "undoable": health.undoable,
        "message": health.message,
        "rate_hz": rounded(health.rate_hz, 1),
        "dropped": health.dropped,
        "faults": health.faults,
        "age_ms": rounded(1e3 * health.age_s, 0),
        "p50_ms": rounded(health.p50_ms, 2),
        "p99_ms": rounded(health.p99_ms, 2),
        "stage_ms": {name: rounded(value, 3) for name, value in health.stage_ms.items()},
        "drift": health.drift,
        "dots": health.dots,
        "dots_known": health.dots_known,
        "reopened": health.reopened,
    }
    reported |= nothing(health.endcap, health.status, health.message)
    if reading is not None and reading.valid and health.valid:
        reported |= plain(reading) | {"state": health.status}
    return reported


def detail(reading: EndcapReading, number: int) -> dict[str, Any]:
    """Of one endcap: dots as [x, y, quality] (quality -1: lost), rows of [u, v] on a coarse grid (null: invalid)."""
    height, width = reading.zero.image.shape[:2]
    dots: list[list[float]] = []
    if reading.tracks is not None:
        quality = np.where(reading.tracks.lost, -1.0, reading.tracks.quality)
        dots = np.column_stack([reading.tracks.position_px, quality]).round(2).tolist()
    field = reading.field
    rows, columns = field.valid.shape
    step = max(1, -(-max(rows, columns) // ARROWS))
    pick = np.s_[step // 2 :: step, step // 2 :: step]
    moved = np.nan_to_num(np.stack([field.channel("u")[pick], field.channel("v")[pick]], axis=-1))
    arrows: list[list[Any]] = np.rint(moved / UNIT_PX).astype(int).tolist()
    for row, column in np.argwhere(~field.valid[pick]):
        arrows[row][column] = None
    return {
        "number": number,
        "sequence": reading.frame.sequence,
        "size": list(reading.frame.size or (width, height)),
        "dots": dots,
        "field": arrows,
        "cells": [rows, columns, step],
    }
