"""Guided first run: which cameras there are, which cap is which, its zero, its threshold, and ``endcaps.toml``.

    python -m sensing.setup                              # asks, and writes endcaps.toml
    python -m sensing.setup --url http://127.0.0.1:8081/ --url http://127.0.0.1:8082/
    python -m sensing.live --config endcaps.toml

Every camera is zeroed while nothing touches. Then each cap is touched in turn, in the order in which they are to be
named, and the camera that sees it gets the name. The rest after each touch gives its contact threshold: the force that
an untouched cap passes once in a thousand frames (:func:`sensing.wrench.contact.threshold_from_rest`). N, mm, s.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cad.errors import EndcapError, FileError, ParameterError
from cad.plain_numbers import plain_number
from sensing.live.core.config import MODELS, CapConfig, LiveConfig, save_config
from sensing.live.core.engine import Engine, LiveCap
from sensing.live.core.reading import CapReading
from sensing.live.core.warm_up import warm_up
from sensing.live.open_caps import Models, configured_models, open_caps
from sensing.sources.camera import list_devices
from sensing.tracking.zero import save_zero
from sensing.wrench.contact import threshold_from_rest

REST_S, MOST_REST_S = 5.0, 90.0  # watched for a threshold at least, and at most until it has samples enough
TOUCH_S, ZERO_S = 30.0, 20.0  # waited for a touch and for a zero
FALSE_RATE = 1e-3  # contacts a frame that an untouched cap may show
TOUCH_SHARE = 3.0  # a touch is this many times the largest force at rest of that camera
LEAST_TOUCH_N = 1.0
SETTLE_S, RELEASED_S = 0.5, 1.0  # after a release: silicone and filter settle; then watched
LEAST_ON_N, MARGIN = 0.2, 1.5  # E: never below; over the measured threshold, for slow drift

Ask = Callable[[str], str]


class Watch:
    """Sink that keeps the force norms of each cap."""

    def __init__(self) -> None:
        self.forces_n: dict[str, list[np.ndarray]] = {}

    def put(self, reading: CapReading) -> None:
        """Keep one, if its numbers count."""
        if not reading.valid:
            return
        self.forces_n.setdefault(reading.cap, []).append(np.array(reading.wrench.force_n))

    def largest_n(self, cap: str, since: int = 0) -> float:
        """Largest force norm of a cap after so many readings; 0 before any."""
        forces = self.forces_n.get(cap, [])[since:]
        return max((float(np.linalg.norm(f)) for f in forces), default=0.0)


def set_up(
    config: LiveConfig, out: Path, ask: Ask = input, say: Ask | None = None, models: Models | None = None
) -> LiveConfig:
    """Zero, name and measure all caps, write references and configuration.

    Args:
        config: sources to use; names are given anew. out: the TOML file; references go beside it.
        ask: shows a line and waits for Enter. say: shows a line. models: for tests.

    Raises:
        EndcapError: a camera that does not deliver, a touch that nobody saw, a cap that would not rest.
    """
    say = say or _say
    if out.exists():
        raise FileError(f"{out}: is there already: move it away, or choose another name with --out")
    ask(f"{len(config.caps)} camera(s): leave all caps untouched, then press Enter ")
    caps, watch = open_caps(config, models=models or configured_models(config)), Watch()
    warm_up(say)
    with Engine(caps, [watch]):
        _await_zeros(caps)
        say("zeroed; measuring the rest, leave them untouched")
        rest = _watch_rest(caps, watch)
        order = _name_by_touch(caps, watch, rest, ask, say)
        _require_release(order, watch, rest, ask)
    made = tuple(_measured(cap, f"endcap_{k}", rest[cap.name], out, say) for k, cap in enumerate(order))
    result = replace(config, caps=made)
    save_config(result, out)
    say(f"{out}: written; run python -m sensing.live --config {out}")
    return result


def _await_zeros(caps: Sequence[LiveCap]) -> None:
    end_s = time.monotonic() + ZERO_S
    while waiting := [cap for cap in caps if cap.pipeline.zero is None]:
        if time.monotonic() > end_s:
            cap = waiting[0]
            why = cap.health.message or "no frame came"
            raise ParameterError(f"{cap.pipeline.cap.source}: not zeroed in {ZERO_S:.0f} s: {why}", name="source")
        time.sleep(0.05)


def _watch_rest(caps: Sequence[LiveCap], watch: Watch) -> dict[str, list[np.ndarray]]:
    """Forces at rest of every cap, as many as its threshold needs.

    Raises:
        ParameterError: frames that follow one another are too alike for a threshold, even after a long time.
    """
    for cap in caps:
        watch.forces_n[cap.name] = []
    begin_s = time.monotonic()
    while True:
        time.sleep(0.25)
        waited_s = time.monotonic() - begin_s
        rest = {cap.name: list(watch.forces_n[cap.name]) for cap in caps}
        if waited_s < REST_S:
            continue
        try:
            for forces in rest.values():
                threshold_from_rest(np.array(forces).reshape(-1, 3), FALSE_RATE)
            return rest
        except ParameterError:
            if waited_s > MOST_REST_S:
                raise


def _name_by_touch(
    caps: Sequence[LiveCap], watch: Watch, rest: dict[str, list[np.ndarray]], ask: Ask, say: Ask
) -> list[LiveCap]:
    """Caps in the order in which they are touched."""
    if len(caps) == 1:
        return list(caps)
    limits = {
        name: max(LEAST_TOUCH_N, TOUCH_SHARE * max(float(np.linalg.norm(f)) for f in forces))
        for name, forces in rest.items()
    }
    order: list[LiveCap] = []
    for number in range(len(caps)):
        ask(f"press the cap that is to be endcap_{number} firmly after Enter, and hold it ")
        before = {cap.name: len(watch.forces_n[cap.name]) for cap in caps}
        order.append(_touched([cap for cap in caps if cap not in order], watch, before, limits, number))
        say(f"endcap_{number} is {order[-1].pipeline.cap.source}; let it go")
    return order


def _require_release(caps: Sequence[LiveCap], watch: Watch, rest: dict[str, list[np.ndarray]], ask: Ask) -> None:
    """A reference that was taken under load shows that load when everything is let go.

    Raises:
        ParameterError: an endcap that does not come back to rest.
    """
    ask("leave all endcaps untouched again, then press Enter ")
    time.sleep(SETTLE_S)
    before = {cap.name: len(watch.forces_n[cap.name]) for cap in caps}
    time.sleep(RELEASED_S)
    for cap in caps:
        forces = watch.forces_n[cap.name][before[cap.name] :]
        usual_n = max((float(np.linalg.norm(force)) for force in rest[cap.name]), default=0.0)
        if not forces:
            raise ParameterError(f"{cap.pipeline.cap.source}: no number any more: {cap.health.message}", name="source")
        left_n = float(np.median([np.linalg.norm(force) for force in forces]))
        if left_n > max(LEAST_TOUCH_N, TOUCH_SHARE * usual_n):
            raise ParameterError(
                f"{cap.pipeline.cap.source}: {left_n:.1f} N are left when it is untouched: it was pressed while it was "
                "zeroed, or is pressed now; start again with all endcaps free",
                name="rest",
            )


def _touched(
    caps: Sequence[LiveCap], watch: Watch, before: dict[str, int], limits: dict[str, float], number: int
) -> LiveCap:
    end_s = time.monotonic() + TOUCH_S
    while time.monotonic() < end_s:
        shares = [watch.largest_n(cap.name, before[cap.name]) / limits[cap.name] for cap in caps]
        if max(shares) > 1:
            return caps[int(np.argmax(shares))]
        time.sleep(0.05)
    raise ParameterError(
        f"endcap_{number}: no camera saw a touch in {TOUCH_S:.0f} s: press harder, near the tip, and start again",
        name="touch",
    )


def _measured(cap: LiveCap, name: str, rest: list[np.ndarray], out: Path, say: Ask) -> CapConfig:
    """The cap's entry: reference saved, threshold measured."""
    zero = cap.pipeline.zero
    assert zero is not None
    path = out.parent / f"{name}.npz"
    save_zero(replace(zero, sensor=name), path)
    threshold = threshold_from_rest(np.array(rest), FALSE_RATE)
    on = max(LEAST_ON_N, MARGIN * threshold.on_n)
    off = min(on, max(0.6 * on, threshold.off_n))
    say(f"{name}: {path}, contact from {on:.2f} N, over below {off:.2f} N")
    return replace(cap.pipeline.cap, name=name, zero=path, contact_on_n=round(on, 3), contact_off_n=round(off, 3))


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        words = options.url or [str(number) for number, _ in list_devices()]
        if options.camera is not None:
            words = [word.strip() for word in options.camera.split(",")]
        if not words:
            raise ParameterError("no camera found: plug one in, or give --url", name="camera")
        for number, name in list_devices():
            if str(number) in words:
                print(f"camera {number}: {name}")
        caps = tuple(
            CapConfig(f"camera_{k}", word, None, options.diameter, options.wall, exposure=options.exposure)
            for k, word in enumerate(words)
        )
        set_up(LiveConfig(caps, options.model, options.weights, weight_n=options.weight), options.out)
    except EndcapError as error:
        print(f"sensing.setup: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, EOFError):
        print("\nsensing.setup: stopped, nothing written", file=sys.stderr)
        return 130
    return 0


def _say(text: str) -> str:
    print(text, flush=True)
    return ""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m sensing.setup",
        description="Guided first run: zero the caps, tell which is which by touching them, write endcaps.toml.",
        epilog="exit status: 0 written, 2 bad input or a camera that does not answer, 130 stopped",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--camera", metavar="N[,N]", help="only these cameras (default: all that are found)")
    where.add_argument("--url", action="append", metavar="URL", help="MJPEG over HTTP; again for another cap")
    parser.add_argument("--out", type=Path, default=Path("endcaps.toml"), metavar="FILE", help="(endcaps.toml)")
    parser.add_argument("--model", choices=MODELS, default="default")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="weights of the model, else those that ship")
    parser.add_argument("--diameter", type=plain_number, default=130.0, metavar="MM", help="of the design (130)")
    parser.add_argument("--wall", type=plain_number, default=8.0, metavar="MM", help="of the design (8)")
    parser.add_argument("--exposure", type=float, default=0.0, metavar="V", help="fixed exposure, the driver's unit")
    parser.add_argument("--weight", type=float, default=0.0, metavar="N", help="of the robot, for the force sum")
    return parser


if __name__ == "__main__":
    sys.exit(main())
