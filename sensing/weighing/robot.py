"""Fits a gain for each endcap of a robot to its recordings in several postures (``sensing.weigh --postures``).

    recording,up_x,up_y,up_z
    stand_1.mcap,0.02,-0.01,0.9998

Each recording holds all endcaps while the robot stands still; ``up`` is the vertical in the robot frame, as an inertial
sensor gives it. ``weight_n`` and ``T_robot_endcap`` come from endcaps.toml.
"""

from __future__ import annotations

import csv
from itertools import islice
from pathlib import Path

import numpy as np

from cad.errors import FileError, ParameterError
from cad.plain_numbers import is_plain
from sensing.live.core.config import LiveConfig
from sensing.live.core.config_entries import change_entries
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import LiveModel
from sensing.live.core.robot import unplaced
from sensing.live.open_endcaps import Models, configured_models
from sensing.weighing.at_rest import RestWatch
from sensing.weighing.film import film_readings
from sensing.weighing.gain import Array, WeighingError
from sensing.weighing.postures import Posture, fit_gains
from sensing.weighing.session import Say
from sensing.weighing.store import gain_entries
from sensing.wrench.stiffness import weights_digest

COLUMNS = ("recording", "up_x", "up_y", "up_z")  # columns of the table of postures
MOST_ROWS = 100  # largest number of postures


def weigh_robot(config: LiveConfig, out: Path, table: Path, dry_run: bool, say: Say) -> None:
    """Read all postures, fit the gains, and store one for every endcap that carried load.

    Args:
        config: configuration of the robot, with its weight.
        out: path of endcaps.toml.
        table: path of the table of postures.
        dry_run: whether nothing is stored.
        say: function that shows a line.

    Raises:
        EndcapError: no weight, a table or recording that cannot be used, postures that are refused.
    """
    if not config.weight_n > 0:
        raise ParameterError(f"weight_n is missing in {out}: give the robot's weight in N", name="weight_n", value=0.0)
    if places := unplaced(config.endcaps):
        raise ParameterError(
            f"T_robot_endcap of {', '.join(places)} in {out}: two endcaps cannot sit in one place: give each "
            "its own 4 x 4 matrix, endcap to robot coordinates, mm",
            name="T_robot_endcap",
            value=places,
        )
    models = configured_models(config, any_silicone=True)
    postures = [Posture(recording.name, up, *_forces(config, recording, models, say)) for recording, up in _rows(table)]
    carried = [e.name for e in config.endcaps if any(e.name in posture.force_n for posture in postures)]
    found = fit_gains(postures, config.weight_n, carried)
    for name, gain in found.gain.items():
        say(f"{name}: gain {gain:.4f} ± {found.sd[name]:.4f}")
    say(f"chi-square {found.chi_square:.1f} of {found.freedom}")
    idle = [endcap.name for endcap in config.endcaps if endcap.name not in carried]
    if idle:
        say(f"{', '.join(idle)}: carried no load, gain unchanged")
    if dry_run:
        return
    changes = {}
    for endcap in config.endcaps:
        if endcap.name in found.gain:
            digest = weights_digest(models(endcap).estimator)
            changes[endcap.name] = gain_entries(endcap, found.gain[endcap.name], found.sd[endcap.name], digest)
    change_entries(out, changes)
    say(f"{out}: stored")


def _forces(config: LiveConfig, recording: Path, models: Models, say: Say) -> tuple[dict[str, Array], dict[str, Array]]:
    """(force, N; covariance, N2) of every endcap that touches at the end of a recording, robot frame."""
    force: dict[str, Array] = {}
    covariance: dict[str, Array] = {}
    for endcap in config.endcaps:
        found = _at_rest(endcap, recording, models(endcap))
        if found is not None:
            turn = endcap.T_robot_endcap[:3, :3]
            force[endcap.name], covariance[endcap.name] = turn @ found[0], turn @ found[1] @ turn.T
    shown = ", ".join(f"{name} {np.linalg.norm(value):.1f} N" for name, value in force.items())
    say(f"{recording.name}: {shown or 'nothing touches'}")
    if not force:
        raise WeighingError(f"{recording}: no endcap carries load: record while the robot stands on the ground")
    return force, covariance


def _at_rest(endcap: EndcapConfig, recording: Path, model: LiveModel) -> tuple[Array, Array] | None:
    watch, touching = RestWatch(model.load_scale), False
    for reading in film_readings(endcap, str(recording), model):
        watch.add(reading)
        touching = reading.contact.touching if reading.valid else touching
    if not touching:
        return None
    try:
        rest = watch.pressed()
    except WeighingError as error:
        raise WeighingError(f"{recording}, {endcap.name}: {error}") from None
    return rest.wrench[:3], rest.covariance[:3, :3]


def _rows(table: Path) -> list[tuple[Path, Array]]:
    try:
        with table.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(islice(csv.DictReader(stream), MOST_ROWS + 1))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{table}: cannot be read as CSV ({error}): give columns {', '.join(COLUMNS)}") from None
    if not rows or len(rows) > MOST_ROWS or any(name not in rows[0] for name in COLUMNS):
        raise FileError(f"{table}: {len(rows)} rows: give 2..{MOST_ROWS} rows with columns {', '.join(COLUMNS)}")
    found = []
    for line, row in enumerate(rows, 2):
        words = [(row[name] or "").strip() for name in COLUMNS[1:]]
        up = np.array([float(word) if is_plain(word) else np.nan for word in words])
        if not np.isfinite(up).all() or not 0.9 < np.linalg.norm(up) < 1.1:
            raise FileError(f"{table} line {line}: up = {' '.join(words)}: give a vertical of length 1, plain decimals")
        found.append((table.parent / (row["recording"] or ""), up))
    return found
