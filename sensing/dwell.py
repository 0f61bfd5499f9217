"""Constants of an endcap's rate effects from one dwell test: a weight put on, left standing, taken off.

    python -m sensing.live --config endcaps.toml --record dwell.mcap       # untouched, weight on, 5 s, weight off, 5 s
    python -m sensing.dwell --config endcaps.toml --endcap endcap_0 --source dwell.mcap --picture dwell.png

Silicone that was pressed a moment ago pushes back harder than one that has relaxed, and no picture shows it. With the
constants in endcaps.toml live adds what is missing (:mod:`sensing.wrench.relaxation`). N, s.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, ParameterError
from cad.extras import program
from cad.messages import LOG, show
from cad.whole_file import replace_file, require_place
from sensing.live.core.config import chosen_endcap
from sensing.live.core.config_entries import change_entries
from sensing.live.core.endcaps_file import load_config
from sensing.live.core.warm_up import warm_up
from sensing.live.ending import leave
from sensing.live.open_endcaps import configured_models
from sensing.weighing.at_rest import MOST_FLAGGED
from sensing.weighing.dwell import Dwell, DwellError, fit_dwell
from sensing.weighing.film import film_readings, require_even
from sensing.wrench.stiffness import Stiffness

MOST_LEFT = 0.25  # E: of the creep; an undisturbed test leaves 0.02, a plate of 0.5 N that stays on 0.28
PICTURES = (".png", ".jpg", ".pdf", ".svg")
DESCRIPTION = """\
Find the relaxation of an endcap's silicone in a recording of one dwell test, and store it in endcaps.toml. Record the
untouched endcap, put a weight of 500 g or more on it at once, leave it for 5 s or more, take it off at once, and go on
recording for 5 s. The weight need not be known.
"""
EPILOG = (
    "exit status: 0 stored (or only shown with --dry-run), 2 refused or bad input (one line on stderr), 130 stopped"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        _identify(options)
    except EndcapError as error:
        LOG.error(f"sensing.dwell: {error}")
        return 2
    except KeyboardInterrupt:
        LOG.error("\nsensing.dwell: stopped, nothing stored")
        return 130
    return 0


def _identify(options: argparse.Namespace) -> None:
    if options.picture:
        _require_picture(options.picture)
    config = load_config(options.config)
    endcap = chosen_endcap(config, options.endcap)
    require_even(options.source)
    warm_up(LOG.info)
    # The gain of a weighed endcap belongs to the weights that it was weighed with, which others would not match.
    models = configured_models(config, any_silicone=not endcap.weighed)
    gain, model = Stiffness(endcap.gain, 0.0), models(endcap)
    rows = []
    flagged: list[tuple[frozenset[str], str]] = []
    for reading in film_readings(endcap, options.source, model):
        if reading.valid:
            rows.append([reading.estimate.time_s, *gain.applied(reading.estimate).force_n])
            if reading.estimate.flags:
                flagged.append((reading.estimate.flags, reading.reason))
    if not rows:
        raise DwellError(f"{options.source}: no reading that counts")
    found = np.array(rows)
    along = _along(found[:, 1:])
    result = fit_dwell(found[:, 0], found[:, 1:] @ along, endcap.gain * model.load_scale)
    for term in result.terms:
        show(f"strength {term.strength:.4f} ± {term.sd:.4f} with tau {term.tau_s:.3f} s")
    show(
        f"weight {result.level_n:.2f} N; creep in the dwell and what is left after it: {result.before_n:.3f} N without "
        f"the constants, {result.after_n:.3f} N with them (root mean square)"
    )
    _warn(result, flagged, len(rows))
    if options.picture:
        _draw(options.picture, found[:, 0], found[:, 1:] @ along - result.rest_n, result)
    if not options.dry_run:
        terms = [[float(f"{x:.4g}") for x in (term.strength, term.tau_s, term.sd)] for term in result.terms]
        change_entries(options.config, {endcap.name: {"relaxation": terms}})
        show(f"{options.config}: stored for {endcap.name}")


def _warn(result: Dwell, flagged: Sequence[tuple[frozenset[str], str]], count: int) -> None:
    """Say why the constants may be wrong: creep that they leave, and readings that live flags."""
    if result.left_share > MOST_LEFT:
        LOG.warning(
            f"sensing.dwell: warning: the constants leave {result.left_share:.0%} of the creep: did the weight stand "
            "still, and was all of it taken off at once? repeat the test before live uses them"
        )
    if len(flagged) > MOST_FLAGGED * count:
        names = ", ".join(sorted(frozenset.union(*(flags for flags, _ in flagged))))
        LOG.warning(
            f"sensing.dwell: warning: {len(flagged)} of {count} readings are flagged ({names}), lastly because: "
            f"{flagged[-1][1] or 'see docs/live_faults.md'}; repeat the test before live uses the constants"
        )


def _along(force_n: np.ndarray) -> np.ndarray:
    """(3,) direction of the load, from the readings over half of the largest."""
    size = np.linalg.norm(force_n, axis=1)
    mean = force_n[size >= 0.5 * size.max()].mean(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-9))


def _require_picture(path: Path) -> None:
    """Refuse a picture that could not be written, before a recording is read for it."""
    if path.suffix.lower() not in PICTURES:
        raise ParameterError(
            f"--picture {path}: the name must end in {', '.join(PICTURES)}", name="picture", value=path
        )
    require_place(path)


def _draw(path: Path, time_s: np.ndarray, force_n: np.ndarray, result: Dwell) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 3.5), layout="constrained")
    axes = figure.subplots(1, 2)
    for axis, shift in zip(axes, (0.0, result.level_n), strict=True):
        axis.plot(time_s - time_s[0], force_n - shift, label="as the model reports it")
        axis.plot(time_s - time_s[0], result.corrected_n - shift, label="with the constants")
        axis.set_xlabel("s")
    axes[0].set_ylabel("force along the load, N")
    axes[1].set_ylabel("difference from the weight, N")
    axes[1].set_ylim(-0.1 * result.level_n, 0.1 * result.level_n)
    axes[0].legend()
    figure.savefig(buffer := io.BytesIO(), dpi=100, format=path.suffix[1:].lower())
    replace_file(path, buffer.getvalue())


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.dwell"), description=DESCRIPTION, epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument(
        "--source",
        required=True,
        metavar="FILE",
        help="recording, video or folder of pictures (30 a second; the first one untouched)",
    )
    parser.add_argument("--config", type=Path, default=Path("endcaps.toml"), metavar="FILE", help="(endcaps.toml)")
    parser.add_argument("--endcap", metavar="NAME", help="which one; may be left out where there is only one")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="force without and with the constants")
    parser.add_argument("--dry-run", action="store_true", help="show the constants and store nothing")
    return parser


if __name__ == "__main__":
    leave(main())
