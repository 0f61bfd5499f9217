"""The sizes that bench_sizes.py and the daily test make, and one size made: every gate, no pictures and no folder."""

from __future__ import annotations

import csv
import hashlib
import math
import random
import tempfile
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cad.errors import EndcapError
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.mold.layout import JOINT_CLEARANCE_MM, MoldLayout, joint_clearance_range_mm
from cad.params import EndcapParams
from cad.pattern import (
    DOT_RANGE_MM,
    GYROID_RANGE,
    LEAST_BRIDGE_MM,
    MOST_RINGS,
    RELEASED_DOT_MM,
    RELEASED_GYROID,
    RELEASED_RINGS,
    most_dots,
    most_rings,
    option_words,
)

if TYPE_CHECKING:  # the CAD kernel is loaded where a size is made
    from fab.checks.check import Check

ROOT = Path(__file__).resolve().parent.parent
OLDER_CODE = Path(__file__).with_name("sizes_code.csv")  # what a size passed by it stands for, and why
SEED = 12
RANDOM_SIZES = 1000
# What decides whether a size comes out: solids, meshes, gates and the sweeps of the steps.
CODE = (
    *("cad/**/*.py", "cad/*.csv", "fab/design.py", "fab/meshing/*.py", "fab/checks/*.py", "fab/steps/*.py"),
    *("fab/packed.py", "fab/bom.py", "fab/exports/writer.py"),
)
# How files get their names, workers and commands end, and lines are printed; prices; not what is in a file.
NOT_OF_THEM = (
    *(f"cad/{name}.py" for name in ("typed_folder", "whole_file", "user_folders", "pools", "messages", "extras")),
    *("cad/silicone_kits.py", "cad/silicone_kits.csv"),
)

# Checks whose value changes from size to size, as the last word of their names: how much of the limit each has used.
WATCHED = (
    *("way_out_gap_mm", "way_out_penetration_mm", "wall_error_mm", "leak_ratio", "hollow_air_mm3", "flange_air_mm3"),
    *("bed_mm", "min_wall_mm", "mesh_volume_error_ratio", "step_volume_error_ratio", "wall_p99_mm"),
    *("wall_mean_error_ratio", "closed_face_share", "ball_covered_share"),
)


@dataclass(frozen=True)
class Size:
    """One run: kind of size, the two numbers, the joint clearance (mm), and the options of the design."""

    kind: str
    diameter_mm: float
    wall_mm: float
    clearance_mm: float = JOINT_CLEARANCE_MM
    dot_rings: tuple[int, ...] = RELEASED_RINGS
    dot_mm: float = RELEASED_DOT_MM
    gyroid: float = RELEASED_GYROID

    @property
    def params(self) -> EndcapParams:
        """Its design."""
        return EndcapParams(self.diameter_mm, self.wall_mm, self.dot_rings, self.dot_mm, self.gyroid)

    @property
    def layout(self) -> MoldLayout:
        """Its mold."""
        return MoldLayout(self.params, self.clearance_mm)

    @property
    def key(self) -> tuple[str, str, str, str]:
        """The numbers, and the options as they are typed, as the table holds them."""
        options = option_words(self.dot_rings, self.dot_mm, self.gyroid)
        words = " ".join(f"{name}={value}" for name, value in options.items())
        return (f"{self.diameter_mm:g}", f"{self.wall_mm:g}", f"{self.clearance_mm:g}", words)


@dataclass(frozen=True)
class Made:
    """How one size came out.

    Attributes:
        size: what was made.
        failed: each check that failed with value and limit, or the error.
        checks: number of checks that ran.
        cpu_s: processor time.
        used: of each of ``WATCHED`` the share of its limit at the piece that comes nearest; over 1 fails.
    """

    size: Size
    failed: tuple[str, ...]
    checks: int
    cpu_s: float
    used: Mapping[str, float] = field(default_factory=dict)


class Inline(Executor):
    """Runs each job at once, in this process."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run it."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def random_sizes(seed: int, count: int, kind: str = "random") -> list[Size]:
    """Sizes uniform over the valid region, to 0.01 mm: the first so many of a seed's endless list."""
    draw = random.Random(seed)
    low, high = diameter_range_mm()
    sizes: list[Size] = []
    while len(sizes) < count:
        diameter, wall = round(draw.uniform(low, high), 2), round(draw.uniform(6.5, high / 10), 2)
        thinnest, thickest = wall_range_mm(diameter)
        if thinnest <= wall <= thickest:
            sizes.append(Size(kind, diameter, wall))
    return sizes


def round_sizes() -> list[Size]:
    """Every 5 mm of D by every half mm of T."""
    sizes = []
    for diameter in range(100, 251, 5):
        low, high = wall_range_mm(float(diameter))
        sizes += [Size("round", float(diameter), half / 2) for half in range(13, 51) if low <= half / 2 <= high]
    return sizes


def edge_sizes(count: int = 17) -> list[Size]:
    """Thinnest and thickest wall at diameters from end to end, kept 0.005 mm inside the region."""
    low, high = diameter_range_mm()
    sizes = []
    for step in range(count):
        diameter = round(low + 0.01 + (high - low - 0.01) * step / (count - 1), 2)
        thin, thick = wall_range_mm(diameter)
        sizes += [Size("edge", diameter, round(wall, 3)) for wall in (thin, thick - 0.001) if thin <= wall <= thick]
    return sizes


def clearance_sizes(count: int = 24) -> list[Size]:
    """Sizes spread over the region, each at four clearances: its least, 0.10, its middle and its widest."""
    sizes = []
    for size in random_sizes(SEED + 1, count):
        low, high = joint_clearance_range_mm(EndcapParams(size.diameter_mm, size.wall_mm))
        for clearance in (low, 0.10, round((low + high) / 2, 3), high):
            sizes.append(Size("clearance", size.diameter_mm, size.wall_mm, clearance))
    return sizes


def option_sizes(seed: int = SEED + 2, count: int = 100, kind: str = "options") -> list[Size]:
    """Sizes over the region, each with dots, a dot's diameter and a fraction of TPU drawn from all that it may have."""
    draw, sizes = random.Random(seed), []
    for plain in random_sizes(seed, count, kind):
        inner_mm = plain.diameter_mm / 2 - plain.wall_mm
        dot_mm = round(draw.uniform(*DOT_RANGE_MM), 1)
        pitch_mm = dot_mm + LEAST_BRIDGE_MM
        rings = draw.randint(3, min(MOST_RINGS, most_rings(inner_mm, pitch_mm)))
        most = [most_dots(inner_mm, (1,) * rings, ring, pitch_mm) for ring in range(1, rings)]
        counts = (1, *(draw.randint(3, dots) for dots in most))
        options = {"dot_rings": counts, "dot_mm": dot_mm, "gyroid": round(draw.uniform(*GYROID_RANGE), 3)}
        sizes.append(replace(plain, **options))
    return sizes


def survey() -> list[Size]:
    """All sizes: the five kinds in turn, each in an order drawn from the seed, so that any part of a run is a fair
    sample of every kind."""
    kinds = [edge_sizes(), random_sizes(SEED, RANDOM_SIZES), round_sizes(), clearance_sizes(), option_sizes()]
    for sizes in kinds:
        random.Random(SEED).shuffle(sizes)
    return [size for turn in zip_longest(*kinds) for size in turn if size is not None]


def code_digest() -> str:
    """Digest of the code that a row depends on: first 12 hex digits of SHA-256 over its files."""
    digest = hashlib.sha256()
    for pattern in CODE:
        for path in sorted(set(ROOT.glob(pattern)) - {ROOT / name for name in NOT_OF_THEM}):
            digest.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def older_digests() -> frozenset[str]:
    """Digests of older code whose sizes that passed stand for this code: what it changed since does not reach them."""
    with OLDER_CODE.open(newline="", encoding="utf-8") as stream:
        return frozenset(row["digest"] for row in csv.DictReader(stream))


def used_shares(checks: Iterable[Check]) -> dict[str, float]:
    """Of each of ``WATCHED`` the largest share of a limit: value over limit, or limit over value of a least one."""
    used: dict[str, float] = {}
    for check in checks:
        name = check.name.rpartition(".")[2]
        if name in WATCHED:
            share = check.value / check.high if math.isfinite(check.high) else check.low / max(check.value, 1e-12)
            used[name] = max(share, used.get(name, 0.0))
    return used


def make(size: Size) -> Made:
    """Make one size and run every gate on its files."""
    from fab.checks.gates import start_gates
    from fab.design import build_design
    from fab.exports import writer

    start, checks = time.process_time(), list[Any]()
    try:
        design = build_design(size.layout, Inline(), lambda _: None)
        with tempfile.TemporaryDirectory(prefix="size-") as name:
            folder = Path(name)
            writer.write_meshes(design, folder)
            writer.write_solids(design, folder)
            checks = start_gates(design, folder, Inline()).checks(lambda _: None)
        failed = [f"{check.name} = {check.value:.4g}, wanted {check.limit}" for check in checks if not check.ok]
    except EndcapError as error:
        failed = [str(error)]
    except Exception as error:  # a crash is a failure of this size, not of the survey
        failed = [f"{type(error).__name__}: {error}"]
    return Made(size, tuple(failed), len(checks), time.process_time() - start, used_shares(checks))
