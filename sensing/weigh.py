"""Calibration by weight: the true stiffness of an endcap's silicone from known weights, without a force sensor.

    python -m sensing.weigh --config endcaps.toml --endcap endcap_0                                  # guided
    python -m sensing.weigh --pose tilt=0,grams=600,source=a.mcap --pose tilt=0,grams=1800,source=b.mcap
    python -m sensing.weigh --postures postures.csv             # a robot's own weight, all its endcaps

What is fitted and why one number is enough: :mod:`sensing.weighing.gain`, docs/weigh.md. N, g, degrees.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from cad.errors import EndcapError, ParameterError, printable
from cad.extras import program
from cad.messages import LOG, show
from cad.whole_file import require_place
from sensing.arguments import number
from sensing.live.core.config import LiveConfig, chosen_endcap
from sensing.live.core.config_entries import change_entries
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.endcaps_file import live_command, load_config
from sensing.live.core.model import LiveModel
from sensing.live.core.warm_up import warm_up
from sensing.live.ending import leave
from sensing.live.open_endcaps import configured_models, open_endcaps
from sensing.tensegrity.description import GRAVITY_M_S2
from sensing.weighing.at_rest import RestWatch
from sensing.weighing.film import as_trained, film_readings
from sensing.weighing.gain import Gain, Pose, WeighingError, fit_gain, pose_gain
from sensing.weighing.robot import weigh_robot
from sensing.weighing.session import Ask, Terms, made_pose, weigh_live
from sensing.weighing.store import gain_entries
from sensing.weighing.unnoticed import unnoticed
from sensing.weighing.words import PoseRequest, parse_pose
from sensing.wrench.stiffness import weights_digest

DESCRIPTION = """\
Find the gain of an endcap's silicone from known weights and store it in endcaps.toml. You need two or more weights
that differ (500 to 2500 g is best at D=130 T=8; else 15 to 70 % of the range of its weights, which endcap train prints)
with a flat plate under them, or a kitchen scale to press the dome on, and a level table. What counts is everything
that presses on the dome, the plate included.
"""
EPILOG = """\
exit status: 0 stored (or only shown with --dry-run), 2 refused or bad input (one line on stderr, nothing stored), 130
stopped
"""


def main(arguments: Sequence[str] | None = None, ask: Ask = input) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        config = load_config(options.config)
        if options.postures is not None:
            _require_of_postures(options)
            weigh_robot(config, options.config, options.postures, options.dry_run, _say)
        else:
            _weigh(config, options, ask)
    except EndcapError as error:
        LOG.error(f"sensing.weigh: {error}")
        return 2
    except (KeyboardInterrupt, EOFError):
        LOG.error("\nsensing.weigh: stopped, nothing stored")
        return 130
    return 0


def _weigh(config: LiveConfig, options: argparse.Namespace, ask: Ask) -> None:
    endcap = chosen_endcap(config, options.endcap)
    if not options.dry_run:
        require_place(options.config)
    terms = Terms(options.tilt, options.azimuth, options.scale_sd, options.gravity)
    requests = [
        parse_pose(text, terms.gravity_m_s2, terms.tilt_deg, terms.azimuth_deg, terms.sd_g) for text in options.pose
    ]
    if len(requests) == 1:
        raise WeighingError("1 pose: at least 2 needed, or a wrong weight could not be noticed; add another --pose")
    model = configured_models(config, any_silicone=True)(endcap)
    digest = weights_digest(model.estimator)
    if not digest:
        raise ParameterError(
            f'model={config.model}: has no covariance, so no gain with an uncertainty: weigh with model = "default"',
            name="model",
            value=config.model,
        )
    _say(f"{endcap.name} ({endcap.source}, {endcap.params.label}): {endcap.weighed or 'not weighed before'}")
    warm_up(_say)
    if requests:
        poses = [_from_file(endcap, request, model, terms) for request in requests]
    else:
        poses = weigh_live(open_endcaps(LiveConfig((as_trained(endcap),)), models=lambda _: model)[0], terms, ask, _say)
    found = fit_gain(poses)
    _report(poses, found)
    if not options.dry_run:
        change_entries(options.config, {endcap.name: gain_entries(endcap, found.gain, found.sd, digest)})
        _say(f"{options.config}: stored for {endcap.name}; {live_command(options.config)} uses it")


def _require_of_postures(options: argparse.Namespace) -> None:
    """Refuse options that a weighing of a whole robot would ignore: all its endcaps get a gain from its weight in N."""
    usual = _parser().parse_args([])
    for name in ("endcap", "tilt", "azimuth", "scale_sd", "gravity"):
        if getattr(options, name) != getattr(usual, name):
            option = f"--{name.replace('_', '-')}"
            fix = "it weighs every endcap that carries load" if name == "endcap" else "its table has the verticals"
            fix = "weight_n is in N" if name in ("scale_sd", "gravity") else fix
            raise ParameterError(f"{option} has no effect with --postures: {fix}; leave it out", name=name)


def _from_file(endcap: EndcapConfig, request: PoseRequest, model: LiveModel, terms: Terms) -> Pose:
    source = request.source or endcap.source
    watch = RestWatch(model.load_scale)
    try:
        for reading in film_readings(endcap, source, model):
            watch.add(reading)
        rest = watch.loaded()
        pose = made_pose(request, rest, terms.gravity_m_s2)
    except WeighingError as error:
        raise WeighingError(f"{request.name} ({source}): {error}") from None
    gain, sd = pose_gain(pose)
    _say(
        f"  {request.name}: the endcap reads {pose.reading_n:.2f} N, {pose.weight_n:.2f} N press: "
        f"gain {gain:.3f} ± {sd:.3f}{rest.note}"
    )
    return pose


def _report(poses: Sequence[Pose], found: Gain) -> None:
    _say(
        f"gain {found.gain:.4f} ± {found.sd:.4f} from {len(poses)} poses (chi-square {found.chi_square:.1f}, refused "
        f"over {found.limit:.0f})"
    )
    missed = unnoticed(poses)
    _say(
        f"  one weight that is wrong by up to {100 * missed.weight_part:.0f} % would not have been noticed, and would "
        f"change the gain by up to {100 * missed.gain_part:.0f} %: check the weights on a second scale, or add another"
    )
    for pose, left in zip(poses, found.residual_n, strict=True):
        _say(f"  {pose.name}: left over fx {left[0]:+.2f}, fy {left[1]:+.2f}, fz {left[2]:+.2f} N")
    if all(abs(pose.load_n[2]) > 0.99 * pose.weight_n for pose in poses):
        _say(
            "  a level table shows the force along the axis only: fx, fy and the torques take the same gain because "
            "stresses scale with the modulus, but nothing here has tested them"
        )


def _say(text: str) -> None:
    show(printable(text))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.weigh"), description=DESCRIPTION, epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument(
        "--config", type=Path, default=Path("endcaps.toml"), metavar="FILE", help="of sensing.setup (endcaps.toml)"
    )
    parser.add_argument("--endcap", metavar="NAME", help="which one; may be left out where there is only one")
    how = parser.add_mutually_exclusive_group()
    how.add_argument(
        "--pose", action="append", default=[], metavar="tilt=DEG,grams=N,source=FILE",
        help="instead of the guide: a weight and its recording, video or folder of pictures (the first one untouched); "
        "twice or more; also azimuth=DEG, sd=GRAMS; what it leaves out is as --tilt, --azimuth and --scale-sd say",
    )  # fmt: skip
    how.add_argument(
        "--postures", type=Path, metavar="FILE.csv",
        help="a robot's own weight: columns recording, up_x, up_y, up_z (vertical in the robot frame)",
    )  # fmt: skip
    parser.add_argument("--tilt", type=number, default=0.0, metavar="DEG", help="of the endcap (0: level)")
    parser.add_argument(
        "--azimuth", type=number, default=0.0, metavar="DEG",
        help="of the vertical in the endcap frame, from x to y: upward with the dome up, downward with the dome down; "
        "opposite to (fx, fy) under the weight (0)",
    )  # fmt: skip
    parser.add_argument(
        "--scale-sd", type=number, default=0.0, metavar="G", help="of the scale (2 g and 0.5 %% together)"
    )
    parser.add_argument("--gravity", type=number, default=GRAVITY_M_S2, metavar="M/S2", help="m/s2 (9.80665)")
    parser.add_argument("--dry-run", action="store_true", help="show the gain and store nothing")
    return parser


if __name__ == "__main__":
    leave(main())
