"""Guided first run: which cameras there are, which endcap is which, its zero, its threshold, and ``endcaps.toml``.

    python -m sensing.setup                              # asks, and writes endcaps.toml
    python -m sensing.setup --url http://127.0.0.1:8081/ --url http://127.0.0.1:8082/
    python -m sensing.live --config endcaps.toml

Every camera is zeroed while nothing touches. Then each endcap is touched in turn, in the order in which they are to be
named, and the camera that sees it gets the name. The rest after each touch gives its contact threshold: the force that
an untouched endcap passes once in a thousand frames (:func:`sensing.wrench.contact.threshold_from_rest`). A camera that
is not mounted as the design has it gets a file of its own (:mod:`sensing.calibration.rest_camera`). N, mm, s.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cad.design_arguments import add_design_arguments, design_of
from cad.errors import EndcapError, FileError, ParameterError, printable
from cad.extras import program
from cad.identity import identity
from cad.materials import DEFAULT_SILICONE
from cad.messages import LOG, show
from cad.whole_file import require_place
from sensing.arguments import number, silicone_name
from sensing.live.core.config import LiveConfig, known_models
from sensing.live.core.endcap_config import EndcapConfig, dots_of
from sensing.live.core.endcaps_file import next_words, save_config
from sensing.live.core.engine import Engine, LiveEndcap
from sensing.live.core.first_reference import without_reference
from sensing.live.core.model import other_silicone
from sensing.live.core.setup_watch import SetupWatch, start_again
from sensing.live.core.warm_up import warm_up
from sensing.live.ending import leave
from sensing.live.open_endcaps import Models, configured_models, open_endcaps
from sensing.sources.camera import lasting_name, list_devices
from sensing.sources.choose import is_camera_number
from sensing.tracking.zero import save_zero
from sensing.wrench.contact import threshold_from_rest

REST_S, MOST_REST_S = 5.0, 90.0  # watched for a threshold at least, and at most until it has samples enough
TOUCH_S = 30.0  # waited for a touch
FALSE_RATE = 1e-3  # contacts a frame that an untouched endcap may show
TOUCH_SHARE = 3.0  # a touch is this many times the largest force at rest of that camera
LEAST_TOUCH_N = 1.0  # at D=130 T=8
SETTLE_S, RELEASED_S = 0.5, 1.0  # after a release: silicone and filter settle; then watched
LEAST_ON_N, MARGIN = 0.2, 1.5  # E: never below, at D=130 T=8; over the measured threshold, for slow drift

Ask = Callable[[str], str]
Say = Callable[[str], None]


def _say(text: str) -> None:
    show(printable(text))


def set_up(
    config: LiveConfig, out: Path, ask: Ask = input, say: Say = _say, models: Models | None = None
) -> LiveConfig:
    """Zero, name and measure all endcaps, write references and configuration.

    Args:
        config: sources to use; names are given anew.
        out: the TOML file; references go beside it.
        ask: shows a line and waits for Enter.
        say: shows a line.
        models: gives the model of an endcap; None loads those of the configuration.

    Raises:
        EndcapError: a camera that does not deliver, a touch that nobody saw, an endcap that would not rest.
    """
    if out.exists():
        raise FileError(f"{out}: is there already: move it away, or choose another name with --out")
    for taken in (out.with_name(f"endcap_{k}.npz") for k in range(len(config.endcaps))):
        if taken.exists():
            why = "is there already, and another configuration may use it"
            raise FileError(f"{taken}: {why}: move it away, or give --out in another folder")
    require_place(out)
    ask(f"{len(config.endcaps)} camera(s): leave all endcaps untouched, then press Enter ")
    opened = models or configured_models(config, any_silicone=True)
    endcaps, watch = open_endcaps(config, models=opened), SetupWatch()
    warm_up(say)
    with Engine(endcaps, [watch]):
        _await_zeros(endcaps, say)
        say("zeroed; measuring the rest, leave them untouched")
        rest = _watch_rest(endcaps, watch, say)
        order = _name_by_touch(endcaps, watch, rest, ask, say)
        _require_release(order, watch, rest, ask, say)
    made = tuple(_measured(endcap, f"endcap_{k}", rest[endcap.name], out, say) for k, endcap in enumerate(order))
    result = replace(config, endcaps=made)
    save_config(result, out)
    trained_for = next(filter(None, (other_silicone(each.pipeline.model, each.pipeline.endcap) for each in order)), "")
    say(f"{out}: written; {next_words(out, trained_for)}")
    return result


def _await_zeros(endcaps: Sequence[LiveEndcap], say: Say) -> None:
    for endcap in endcaps:
        why = without_reference(endcap)
        if why:
            raise ParameterError(f"{endcap.pipeline.endcap.source}: {why}", name="source")
        if (check := endcap.pipeline.check) and check.doubt:
            say(f"{endcap.pipeline.endcap.source}: warning: every reading will be flagged: {check.doubt}")


def _watch_rest(endcaps: Sequence[LiveEndcap], watch: SetupWatch, say: Say) -> dict[str, list[np.ndarray]]:
    """Forces at rest of every endcap, as many as its threshold needs.

    Raises:
        ParameterError: even after a long time a camera has not come back, or frames that follow one another are too
            alike for a threshold; at once where a camera has moved.
    """
    for endcap in endcaps:
        watch.forces_n[endcap.name] = []
    begin_s, waits = time.monotonic(), ""
    while True:
        time.sleep(0.25)
        waited_s = time.monotonic() - begin_s
        watch.require_unmoved(endcaps)
        before, waits = waits, watch.without_force(endcaps)
        if waits and not before:
            say(f"waiting for {waits}")
        rest = {endcap.name: list(watch.forces_n[endcap.name]) for endcap in endcaps}
        if waited_s < REST_S:
            continue
        try:
            for forces in rest.values():
                threshold_from_rest(np.array(forces).reshape(-1, 3), FALSE_RATE)
            return rest
        except ParameterError as error:
            if waited_s > MOST_REST_S:
                raise ParameterError(start_again(waits), name="source") if waits else error from None


def _name_by_touch(
    endcaps: Sequence[LiveEndcap], watch: SetupWatch, rest: dict[str, list[np.ndarray]], ask: Ask, say: Say
) -> list[LiveEndcap]:
    """Endcaps in the order in which they are touched."""
    if len(endcaps) == 1:
        return list(endcaps)
    limits = {endcap.name: _touch_n(endcap, rest[endcap.name]) for endcap in endcaps}
    order: list[LiveEndcap] = []
    for place in range(len(endcaps)):
        ask(f"press the endcap that is to be endcap_{place} firmly after Enter, and hold it ")
        before = {endcap.name: len(watch.forces_n[endcap.name]) for endcap in endcaps}
        order.append(_touched([endcap for endcap in endcaps if endcap not in order], watch, before, limits, place))
        say(f"endcap_{place} is {order[-1].pipeline.endcap.source}; let it go")
    return order


def _require_release(
    endcaps: Sequence[LiveEndcap], watch: SetupWatch, rest: dict[str, list[np.ndarray]], ask: Ask, say: Say
) -> None:
    """Refuse references taken under load: they show that load when everything is let go; name flags that stay."""
    ask("leave all endcaps untouched again, then press Enter ")
    time.sleep(SETTLE_S)
    before = {endcap.name: len(watch.forces_n[endcap.name]) for endcap in endcaps}
    time.sleep(RELEASED_S)
    watch.require_unmoved(endcaps)
    for endcap in endcaps:
        forces = watch.forces_n[endcap.name][before[endcap.name] :]
        if not forces:
            raise ParameterError(
                f"{endcap.pipeline.endcap.source}: no number any more: {endcap.health.message}", name="source"
            )
        left_n = float(np.median([np.linalg.norm(force) for force in forces]))
        if left_n > _touch_n(endcap, rest[endcap.name]):
            raise ParameterError(
                f"{endcap.pipeline.endcap.source}: {left_n:.1f} N are left when it is untouched: it was pressed while "
                "it was zeroed, or is pressed now; start again with all endcaps free",
                name="rest",
            )
        if (condition := endcap.machine.condition).level:
            say(f"{endcap.pipeline.endcap.source}: look at it: {condition.state}: {condition.reason}")


def _touch_n(endcap: LiveEndcap, rest: list[np.ndarray]) -> float:
    """Force from which an endcap counts as touched, by those that it read at rest."""
    usual_n = max((float(np.linalg.norm(force)) for force in rest), default=0.0)
    return max(LEAST_TOUCH_N * endcap.pipeline.model.load_scale, TOUCH_SHARE * usual_n)


def _touched(
    endcaps: Sequence[LiveEndcap], watch: SetupWatch, before: dict[str, int], limits: dict[str, float], number: int
) -> LiveEndcap:
    end_s = time.monotonic() + TOUCH_S
    while time.monotonic() < end_s:
        watch.require_unmoved(endcaps)
        shares = [watch.largest_n(endcap.name, before[endcap.name]) / limits[endcap.name] for endcap in endcaps]
        if max(shares) > 1:
            return endcaps[int(np.argmax(shares))]
        time.sleep(0.05)
    waits = watch.without_force(endcaps)
    raise ParameterError(
        f"endcap_{number}: no camera saw a touch in {TOUCH_S:.0f} s: "
        + (start_again(waits) if waits else "press harder, near the tip, and start again"),
        name="touch",
    )


def _measured(endcap: LiveEndcap, name: str, rest: list[np.ndarray], out: Path, say: Say) -> EndcapConfig:
    """The endcap's entry: reference saved, threshold measured."""
    zero = endcap.pipeline.zero
    assert zero is not None
    path = out.with_name(f"{name}.npz")
    made_of = endcap.pipeline.endcap.identity.without("camera", "silicone")
    save_zero(replace(zero, sensor=name, made_of=made_of), path)
    threshold = threshold_from_rest(np.array(rest), FALSE_RATE, endcap.pipeline.model.load_scale)
    on = max(LEAST_ON_N * endcap.pipeline.model.load_scale, MARGIN * threshold.on_n)
    off = min(on, max(0.6 * on, threshold.off_n))
    say(f"{name}: {path}, contact from {on:.3g} N, over below {off:.3g} N")
    camera = _camera_kept(endcap, out.parent / f"{name}.json", say)
    return replace(
        endcap.pipeline.endcap, name=name, zero=path, camera=camera, contact_on_n=round(on, 3),
        contact_off_n=round(off, 3),
    )  # fmt: skip


def _camera_kept(endcap: LiveEndcap, path: Path, say: Say) -> Path | None:
    """File of the camera that the reference shows, where that is not the nominal one; one that is there stays."""
    check = endcap.pipeline.check
    rest = None if check is None else check.rest
    if rest is None or not rest.found or rest.camera is None:
        return endcap.pipeline.endcap.camera
    if path.exists():
        say(f"{path}: is there already, left as it is; live takes the camera from the reference ({rest.misfit.reason})")
        return None
    rest.camera.save(path, identity(endcap.pipeline.endcap.params))
    say(f"{path}: the camera, from the same picture ({rest.misfit.reason})")
    return path


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        devices = list_devices()
        numbers = [str(index) for index, _ in devices]
        if options.camera is not None:
            numbers = [word.strip() for word in options.camera.split(",")]
        words = options.url or [lasting_name(int(word)) if is_camera_number(word) else word for word in numbers]
        if not words:
            raise ParameterError("no camera found: plug one in, or give --url", name="camera")
        for index, name in devices:
            if not options.url and str(index) in numbers:
                show(f"camera {index}: {name}, {lasting_name(index)}")
        config = LiveConfig(_endcaps(options, words), options.model, options.weights, weight_n=options.weight)
        set_up(config, options.out)
    except EndcapError as error:
        LOG.error(f"sensing.setup: {error}")
        return 2
    except (KeyboardInterrupt, EOFError):
        LOG.error("\nsensing.setup: stopped, nothing written")
        return 130
    return 0


def _endcaps(options: argparse.Namespace, words: Sequence[str]) -> tuple[EndcapConfig, ...]:
    """One for each source, of the design that the options name."""
    params = design_of(options)
    return tuple(
        EndcapConfig(
            f"camera_{k}", word, None, params.diameter_mm, params.wall_mm, exposure=options.exposure,
            silicone=options.silicone, **dots_of(params),
        )
        for k, word in enumerate(words)
    )  # fmt: skip


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program("python -m sensing.setup"),
        description="Guided first run: zero the endcaps, find which is which by touching them, write endcaps.toml.",
        epilog="exit status: 0 written, 2 bad input or a camera that does not answer, 130 stopped",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--camera", metavar="N[,N]", help="only these cameras (default: all that are found)")
    where.add_argument("--url", action="append", metavar="URL", help="MJPEG over HTTP; again for another endcap")
    parser.add_argument("--out", type=Path, default=Path("endcaps.toml"), metavar="FILE", help="(endcaps.toml)")
    parser.add_argument("--model", choices=known_models(), default="default", help="default: ours")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="weights of the model, else those that ship")
    add_design_arguments(parser)
    parser.add_argument(
        "--silicone", type=silicone_name, default=DEFAULT_SILICONE, metavar="NAME",
        help=f"it is cast of ({DEFAULT_SILICONE})"
    )  # fmt: skip
    parser.add_argument("--exposure", type=number, default=0.0, metavar="V", help="fixed exposure, the driver's unit")
    parser.add_argument("--weight", type=number, default=0.0, metavar="N", help="of the robot, N: for the force sum")
    return parser


if __name__ == "__main__":
    leave(main())
