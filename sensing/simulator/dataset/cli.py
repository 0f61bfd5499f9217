"""Command line of the data writer: ``python -m sensing.simulator data --help``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np

from cad.messages import LOG, show
from cad.typed_folder import EXPORTS
from sensing.arguments import number, scientific, silicone_name, whole
from sensing.camera.chosen_module import endcap_label
from sensing.records_labelled import LabelledSet
from sensing.simulator.contact.indenter import KINDS, require_used
from sensing.simulator.dataset.request import LAMPS, LOADS, PATH_LEVELS, RELEASED, RENDERERS, DataRequest
from sensing.simulator.dataset.writer import refusals, write_dataset
from sensing.simulator.protocols.catalogue import PROTOCOLS
from sensing.simulator.similarity.ratios import RELEASED_LOAD_N
from sensing.simulator.solid.mesh import DENSITIES

LOADS_ALIKE = 1.5  # E: factor up to which the range of a design counts as that of D=130 T=8
DESCRIPTION = """\
Write labelled, rendered frames (read them with sensing.records_labelled). An unfinished or smaller set of the same
options is completed, of a larger one what is missing of the frames asked for. Examples:

  python -m sensing.simulator data --frames 2000 --out exports/data
  python -m sensing.simulator data --frames 34000 --workers 2 --sensor 7 --unpainted 0.1 --out exports/other_sensor
  python -m sensing.simulator data --frames 2000 --protocol dynamic --rate-effects --out exports/relaxing
  python -m sensing.simulator data --frames 2000 --render off --out exports/states
  python -m sensing.simulator data --frames 2000 --states exports/states --sensor 7 --out exports/sensor7
  python -m sensing.simulator data --frames 34000 --scheduler tcp://10.0.0.1:8786 --out exports/big

exit status: 0 written, 2 bad input or no place to write, 130 interrupted (what is written stays)
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of the command, one for each field of the request, and where and how to run."""
    parser.add_argument("--frames", type=whole, default=2000, metavar="N", help="least number of frames (default 2000)")
    parser.add_argument("--out", type=Path, help="folder (default exports/data_D130_T8_static_0 or alike)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--workers", type=whole, default=1, metavar="N", help="processes on this machine (default 1)")
    where.add_argument(
        "--scheduler", metavar="ADDRESS", help="Dask scheduler to use instead, for example tcp://HOST:8786"
    )
    parser.add_argument(
        "--states", type=Path, metavar="DIR",
        help="take the solved states of that set, written with --render off and the same options",
    )  # fmt: skip
    _add_mechanics(parser)
    _add_pictures(parser)


def _add_mechanics(parser: argparse.ArgumentParser) -> None:
    _option(parser, "diameter_mm", number, "diameter D, mm", "--diameter")
    _option(parser, "wall_mm", number, "wall T, mm", "--wall")
    _option(parser, "dot_rings", str, "dots of each ring from tip to equator")
    _option(parser, "dot_mm", number, "diameter of a dot, mm")
    _option(parser, "silicone", silicone_name, "row of cad/materials.csv")
    _option(
        parser, "interlock", number, "stiffness of the zone with TPU gyroid over the silicone's; Smooth-Sil 950: 1.49"
    )
    _option(parser, "indenter", str, "what presses", choices=tuple(KINDS))
    _option(parser, "radius_mm", number, "radius of a sphere, edge or crest, mm", "--radius")
    _option(
        parser, "axis_deg", number, "direction of an edge or of rows of crests from the meridian, degrees", "--axis"
    )
    _option(parser, "protocol", str, "loading paths", choices=tuple(PROTOCOLS))
    _option(
        parser, "loads", str, "of the set-points: those of D=130 T=8, or in proportion to this design's", choices=LOADS
    )
    _option(parser, "seed", whole, "seed of the paths")
    _option(parser, "azimuths", whole, "labelled azimuths of every solved state")
    _option(parser, "level", whole, "of the mechanics, 1 is the full model", choices=PATH_LEVELS)
    parser.add_argument(
        "--rate-effects", action="store_true", help="the silicone relaxes as its row says (levels 1 and 2, dynamic)"
    )
    _option(parser, "density", str, "mesh", choices=tuple(DENSITIES))
    _option(parser, "tolerance", scientific, "residual over load at level 2")


def _add_pictures(parser: argparse.ArgumentParser) -> None:
    _option(parser, "render", str, "quality of the pictures", choices=RENDERERS)
    _option(parser, "lamp", str, "light of each path", choices=LAMPS)
    _option(parser, "sensor", whole, "which hand-made endcap: paint, and but for 0 its camera and mounting")
    _option(parser, "unpainted", number, "fraction of dents without ink")
    _option(parser, "missing", number, "fraction of dots not there")
    _option(parser, "smeared", number, "fraction of smeared dots")
    _option(parser, "extra", whole, "number of false dots")


def _option(
    parser: argparse.ArgumentParser, name: str, kind: Callable[[str], object], text: str, flag: str = "",
    choices: tuple[object, ...] = (),
) -> None:  # fmt: skip
    """Add an option for one field of the request; the help states its default."""
    default = next(field.default for field in fields(DataRequest) if field.name == name)
    given = None if name in ("radius_mm", "axis_deg") else default  # of the body: refused where it has none
    said = f"{text}; one of {', '.join(map(str, choices))}" if choices else text
    parser.add_argument(
        flag or f"--{name.replace('_', '-')}", dest=name, type=kind, default=given, metavar="V",
        help=f"{said} (default {default})",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Write the data set and print a summary."""
    require_used(options.indenter, radius=options.radius_mm, axis=options.axis_deg)
    typed = {field.name: getattr(options, field.name) for field in fields(DataRequest)}
    request = DataRequest(**{name: value for name, value in typed.items() if value is not None})
    if options.states is None:
        _warn_of_loads(request)
    name = f"data_{endcap_label(request.params, request.silicone)}_{request.protocol}_{request.seed}"
    folder = options.out or Path(EXPORTS) / name
    written = write_dataset(request, folder, options.workers, options.scheduler, options.states)
    data, refused = LabelledSet(folder), refusals(folder)
    there, whole = len(data.shards), data.manifest["shards"]
    shards = f"{there} shards" if there >= whole else f"{there} of {whole} shards of a larger set"
    size = sum(path.stat().st_size for path in data.shards)
    lacking = len({line.split(" states ")[0] for line in refused})  # a path may touch, and be refused, several times
    lost = f"{lacking} paths with refused states, listed in their shards" if refused else "nothing refused"
    paths, tilts = len(np.unique(data.column("path"))), data.column("tilt_deg")
    low, high = round(tilts.min()), round(tilts.max())
    at = f"{paths} paths at {f'tilt {low}' if low == high else f'tilts {low} to {high}'} degrees"
    show(f"{folder}: {len(data)} frames in {shards} ({written} written now), {at}, {size / 1e6:.0f} MB, {lost}")
    return 0


def _warn_of_loads(request: DataRequest) -> None:
    """Say where the set-points of D=130 T=8 press another design much more, or much less, than it bears."""
    alike, factor = LOADS_ALIKE, request.scale.force
    if request.loads == RELEASED and request.protocol != "robot" and not 1 / alike <= factor <= alike:
        LOG.warning(
            f"set-points are those of D=130 T=8, whose weights range to {RELEASED_LOAD_N:g} N; those of "
            f"{request.params.label} in {request.silicone} range to {request.scale.top_n:.3g} N: --loads design "
            "presses in proportion"
        )
