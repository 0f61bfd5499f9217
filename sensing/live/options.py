"""Which options of ``python -m sensing.live`` have a meaning together; what would be ignored is refused."""

from __future__ import annotations

import argparse

from cad.design_arguments import DEFAULTS as DESIGN_DEFAULTS
from cad.errors import ParameterError
from cad.materials import DEFAULT_SILICONE

SOURCES = ("camera", "video", "photos", "url", "source", "replay", "config")  # options that say where frames come from
ROBOT = "the simulated robot"
USED_WITH: dict[str, tuple[str, ...]] = {  # option: sources that it has a meaning for
    "rate": ("camera", "photos", "source", ROBOT),
    "exposure": ("camera", "source"),
    "zero": ("camera", "video", "photos", "url", "source"),
    "diameter": ("camera", "video", "photos", "url", "source", ROBOT),
    "wall": ("camera", "video", "photos", "url", "source", ROBOT),
    "dot_rings": ("camera", "video", "photos", "url", "source", ROBOT),
    "dot_mm": ("camera", "video", "photos", "url", "source", ROBOT),
    "silicone": ("camera", "video", "photos", "url", "source", ROBOT),
    "speed": ("video", "photos", "replay", "config"),
    "from_s": ("replay",),
    "at_end": ("replay",),
    "paused": ("replay",),
}
IN_FILE = {
    "rate": "rate_hz", "exposure": "exposure", "zero": "zero", "diameter": "diameter_mm", "wall": "wall_mm",
    "silicone": "silicone", "dot_rings": "dots", "dot_mm": "dot_mm",
}  # fmt: skip
NOT_WITH_CHECK = (
    "record",
    "json",
    "output",
    "ros",
    "rerun",
    "seconds",
    "speed",
    "workers",
    "host",
    "port",
    "at_end",
    "paused",
    "record_pictures",
)
DEFAULTS = {
    "rate": 0.0, "exposure": 0.0, **DESIGN_DEFAULTS, "speed": 1.0, "workers": 1, "host": "127.0.0.1",
    "silicone": DEFAULT_SILICONE, "from_s": 0.0, "at_end": "stop",
    "record_pictures": "full",
}  # fmt: skip


def complete(options: argparse.Namespace) -> argparse.Namespace:
    """The options with their defaults.

    Raises:
        ParameterError: an option that would be ignored.
    """
    source = next((name for name in SOURCES if getattr(options, name) is not None), ROBOT)
    for option, sources in USED_WITH.items():
        if _is_given(option, options) and source not in sources:
            raise _ignored(option, source, options)
    if options.check and source != "replay":
        raise ParameterError("--check compares a recording with itself: give --replay FILE", name="check")
    for option in NOT_WITH_CHECK if options.check else ():
        if _is_given(option, options):
            raise ParameterError(f"{_flag(option)} has no effect with --check: leave one of them out", name=option)
    for option in ("host", "port") if options.no_page else ():
        if getattr(options, option) is not None:
            raise ParameterError(f"--{option} has no effect with --no-page: leave one of them out", name=option)
    if options.record_pictures is not None and options.no_page and options.record is None:
        raise ParameterError(
            "--record-pictures has no effect without --record or the page's button: give --record",
            name="record_pictures",
        )
    if options.seconds is not None and not 0 < options.seconds < 1e9:
        raise ParameterError(f"--seconds {options.seconds:g}: give more than 0", name="seconds", value=options.seconds)
    given = {name: value for name, value in vars(options).items() if value is not None}
    return argparse.Namespace(**{**vars(options), **DEFAULTS, **given})


def _is_given(option: str, options: argparse.Namespace) -> bool:
    return not any(getattr(options, option) is left_out for left_out in (None, False))  # 0 is given, and equals False


def _ignored(option: str, source: str, options: argparse.Namespace) -> ParameterError:
    shown = source if source == ROBOT else f"--{source}"
    if source == "config" and option in IN_FILE:
        fix = f"set {IN_FILE[option]} of each [[endcap]] in {options.config}"
    elif source == "replay":
        fix = "a recording holds its own; leave it out"
    else:
        fix = f"leave it out; it goes with {', '.join(s if s == ROBOT else f'--{s}' for s in USED_WITH[option])}"
    return ParameterError(f"{_flag(option)} has no effect with {shown}: {fix}", name=option)


def _flag(option: str) -> str:
    """As it is written in a command."""
    return "--" + option.removesuffix("_s").replace("_", "-")
