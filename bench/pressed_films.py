"""Films of one endcap that is pressed along a path: pictures as its camera sees them, and the true wrench of each.

    film = pressed_film(Path("exports/bench/weigh_0"), Recipe("Smooth-Sil 940", tilt_deg=0.0), targets)

Made by the simulator (level 2) and its renderer, kept in a folder: ``frame_00000.jpg`` is the untouched
endcap, ``truth.csv`` the wrench at the endcap's origin. N, N m, s, degrees.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cad.materials import silicone
from sensing.records import Frame
from sensing.simulator.contact.indenter import Indenter
from sensing.simulator.dataset.cluster import Origin
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.levels import Simulator
from sensing.simulator.press.press import Target
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.scene import Scene
from sensing.simulator.solid.geometry import shell_geometry
from sensing.simulator.solid.surface import turn_wrench


@dataclass(frozen=True)
class Recipe:
    """What is pressed.

    Attributes:
        silicone: row of cad/materials.csv. tilt_deg, azimuth_deg: of first touch. friction: Coulomb's.
        rate_effects: whether the silicone relaxes. sensor: as of ``sensing.simulator data``.
        noise: number of the first picture's noise. density: of the mesh.
    """

    silicone: str = "Smooth-Sil 950"
    tilt_deg: float = 0.0
    azimuth_deg: float = 0.0
    friction: float = 0.6
    rate_effects: bool = False
    sensor: int = 0
    noise: int = 0
    density: str = "data"


@dataclass(frozen=True)
class Film:
    """Pictures and truth: the first is the untouched endcap.

    Attributes:
        folder: of the pictures. frames: one a picture, with its time. wrench: (n, 6) at the endcap's origin, N, N m.
    """

    folder: Path
    frames: list[Frame]
    wrench: np.ndarray


def asked_film(description: str | None, count: int) -> int | None:
    """Number of the one film that the command line asks for, to make it in a process of its own; None for the bench.

    Args:
        description: of the bench. count: of its films.
    """
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "film", nargs="?", type=int, choices=range(count), metavar=f"0..{count - 1}",
        help="make only this film, which the bench then finds; films can be made in several processes",
    )  # fmt: skip
    number: int | None = parser.parse_args().film
    return number


def pressed_film(folder: Path, recipe: Recipe, targets: Sequence[Target | None], began_s: float = -1.0) -> Film:
    """The film of a path, from where an earlier run of the same recipe, path and simulator left it.

    Args:
        folder: of the pictures; its name is followed by a digest of what follows. recipe: what is pressed.
        targets: one a picture, with times; None (at the start) shows the untouched endcap.
        began_s: time until which the shell was untouched and at rest, s.
    """
    what = hashlib.sha256(repr((recipe, list(targets), began_s, Origin.here())).encode()).hexdigest()
    folder = folder.with_name(f"{folder.name}_{what[:12]}")
    if not (folder / "truth.csv").exists():
        _make(folder, recipe, targets, began_s)
    with (folder / "truth.csv").open(newline="") as stream:
        rows = np.array([[float(x) for x in row] for row in list(csv.reader(stream))[1:]])
    pictures = [path.read_bytes() for path in sorted(folder.glob("*.jpg"))]
    frames = [
        Frame(float(row[0]), k, str(folder), jpeg=jpeg)
        for k, (row, jpeg) in enumerate(zip(rows, pictures, strict=True))
    ]
    return Film(folder, frames, rows[:, 1:])


def _make(folder: Path, recipe: Recipe, targets: Sequence[Target | None], began_s: float) -> None:
    cv2.setNumThreads(1)
    request = DataRequest(1, silicone=recipe.silicone, sensor=recipe.sensor, lamp="steady")
    row = silicone(recipe.silicone)
    prony = row.prony_series() if recipe.rate_effects else ()
    simulator = Simulator(shell_geometry(130, 8), row.neo_hooke(), recipe.density, 2, 2e-3, prony=prony)
    surface = simulator.surface
    renderer = DomeRenderer(request.params, request.mounted, request.settings, surface.position, surface.interpolation)
    states = simulator.follow(
        Scene(Indenter(recipe.tilt_deg), recipe.friction), [t for t in targets if t is not None], began_s
    )
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for k, target in enumerate(targets):
        state = None if target is None else next(states)
        moved = None if state is None else state.surface_mm
        shown = renderer.render(moved, azimuth_deg=recipe.azimuth_deg, frame=recipe.noise + k)
        (folder / f"frame_{k:05d}.jpg").write_bytes(shown.jpeg)
        wrench = np.zeros(6) if state is None else turn_wrench(state.wrench, recipe.azimuth_deg)
        time_s = k / 30 if target is None or target.time_s is None else target.time_s
        rows.append([time_s, *wrench[:3], *(wrench[3:] / 1000)])
    part = folder / "truth.part"
    with part.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time_s", "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"])
        writer.writerows([[f"{x:.9g}" for x in row] for row in rows])
    part.replace(folder / "truth.csv")  # which says that the film is whole
