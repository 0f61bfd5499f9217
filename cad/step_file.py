"""Reproducible STEP files (ISO 10303-21): the same content gives the same bytes each time OCCT writes it.

OCCT's text changes from run to run in four places, none of them geometry: the header's path and time stamp, the
translator's running count, the running count of assembly uses, and the order of the colours (a hash of addresses).
The header names this toolkit as the system of origin, and leaves author and organization empty: OCCT writes "Author"
and its own name there.
"""

from __future__ import annotations

import itertools
import re

from cad.extras import DISTRIBUTION

STEP_TIME = "2000-01-01T00:00:00"  # time stamp in the header instead of the current time
_STYLE_ROOT = "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION("
_STATEMENT = re.compile(r"#(\d+) = (.*?;)\n", re.DOTALL)


def canonical_step(text: str) -> str:
    """Convert a STEP file written by OCCT to a form that depends on its content alone.

    Args:
        text: a whole STEP file.

    Returns:
        The same model; colours renumbered at the end of the file in the order of the solids they colour.
    """
    count = itertools.count(1)

    def header(match: re.Match[str]) -> str:
        strings = re.findall(r"'([^']*)'", _one_line(match[0]))
        made_with = strings[-3]  # version of OCCT's processor, before originating system and authorisation
        return f"FILE_NAME('endcap','{STEP_TIME}',(''),(''),'{made_with}','{DISTRIBUTION}','');"

    def use(match: re.Match[str]) -> str:
        return re.sub(r"\('[0-9]+'", f"('{next(count)}'", _one_line(match[0]), count=1)

    text = re.sub(r"^FILE_NAME\([^;]*;", header, text, count=1, flags=re.MULTILINE)
    text = re.sub(r"NEXT_ASSEMBLY_USAGE_OCCURRENCE\([^;]*;", use, text)
    text = re.sub(r"(Open CASCADE STEP translator [0-9.]+) [0-9.]+", r"\1", text)
    return _sort_styles(text)


def _sort_styles(text: str) -> str:
    """Sort the styles, which OCCT writes last, in the order of the solids that they colour, and renumber them."""
    start = re.search(r"^#\d+ = " + re.escape(_STYLE_ROOT), text, flags=re.MULTILINE)
    if start is None:
        return text
    end = text.index("ENDSEC;", start.start())
    entities = {int(m[1]): _one_line(m[2]) for m in _STATEMENT.finditer(text, start.start(), end)}
    first = min(entities)
    roots = [key for key, body in entities.items() if body.startswith(_STYLE_ROOT)]

    def reached(key: int) -> list[int]:
        """Numbers of the styles below one root, in the order of the text."""
        below = [int(ref) for ref in re.findall(r"#(\d+)", entities[key]) if int(ref) in entities]
        return [key, *(found for child in below for found in reached(child))]

    def targets(root: int) -> list[int]:
        """Numbers of the referenced entities that are not styles: the coloured solid and its context."""
        refs = (int(ref) for key in reached(root) for ref in re.findall(r"#(\d+)", entities[key]))
        return sorted(ref for ref in refs if ref not in entities)

    order = dict.fromkeys(key for root in sorted(roots, key=targets) for key in reached(root))
    order.update(dict.fromkeys(sorted(entities)))  # entities that no root references are kept, too
    number = {key: first + i for i, key in enumerate(order)}
    lines = [
        f"#{number[key]} = " + re.sub(r"#(\d+)", lambda m: f"#{number.get(int(m[1]), int(m[1]))}", entities[key]) + "\n"
        for key in order
    ]
    return text[: start.start()] + "".join(lines) + text[end:]


def _one_line(statement: str) -> str:
    """Remove the line breaks, whose positions depend on the lengths of the numbers."""
    return re.sub(r"\n\s*", "", statement)
