"""Commands that make a camera file or a reference, as other programs print them: whole, quoted, ready to be pasted."""

from __future__ import annotations

from pathlib import Path

from cad.design_arguments import design_words
from cad.params import EndcapParams
from sensing.interpreter import typed_command

RELEASED = design_words(EndcapParams(130.0, 8.0))


def calibrate_command(params: EndcapParams, out: Path | str, zero: Path | None = None, trusted: bool = False) -> str:
    """``python -m sensing.calibrate ...``; the design is named where it is not the released one.

    Args:
        params: the design.
        out: camera file.
        zero: reference that holds the picture; None for a photo that the user still has to name.
        trusted: the design is kept where another one fits better.
    """
    picture = ("--photo", "PICTURE") if zero is None else ("--zero", str(zero))
    trust = ("--trust-design",) if trusted else ()
    return typed_command("sensing.calibrate", *picture, *_design(params), *trust, "--out", str(out))


def zero_command(params: EndcapParams, source: str, sensor: str, out: Path) -> str:
    """``python -m sensing.zero take ...``, likewise.

    Args:
        params: the design.
        source: camera number or address; whoever prints it takes a password out.
        sensor: name of the endcap.
        out: reference file, which it replaces.
    """
    return typed_command(
        "sensing.zero", "take", "--source", source, "--sensor", sensor, *_design(params), "--out", str(out)
    )


def _design(params: EndcapParams) -> tuple[str, ...]:
    words = design_words(params)
    return () if words == RELEASED else words
