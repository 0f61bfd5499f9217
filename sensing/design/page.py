"""A study and the map as pages: one HTML file each, which needs no network."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from html import escape

from cad.design_arguments import design_words
from cad.lens import camera_module, camera_setting
from cad.materials import DEFAULT_SILICONE, silicones
from cad.plain_numbers import plain
from cad.silicone_kits import silicone_usd_kg
from sensing.design.figures import Figure, blind_direction
from sensing.design.plots import bound_bars, dots_picture, load_curves, map_panels
from sensing.design.pressed import Study
from sensing.design.prints import PLA_USD_KG
from sensing.design.region import Choice, Place
from sensing.interpreter import typed_command
from sensing.wrench.weight_files import are_for, command_for, find_weights

# CSS of both pages.
STYLE = """
body{font:15px/1.45 system-ui,sans-serif;max-width:70rem;margin:1.5rem auto;padding:0 1rem;color:#1b1b1b}
table{border-collapse:collapse}td,th{padding:.15rem .7rem .15rem 0;text-align:left;vertical-align:top}
td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}img{max-width:100%}
.computed{color:#186a3b}.measured{color:#1a4f8b}.estimated{color:#9a6400}.unknown{color:#6a6a6a}
code,pre{background:#f3f3f3;padding:.1rem .3rem}small{color:#555}pre{overflow-x:auto}
"""
# Explanation of each kind of source.
SOURCES = (
    '<p><small><span class="computed">computed</span>: from solved states of the simulator and closed forms; '
    '<span class="measured">measured</span>: on rendered frames or files of this design; '
    '<span class="estimated">estimated</span>: order of magnitude, with its reason; '
    '<span class="unknown">unknown</span>: nobody can say yet.</small></p>'
)


def study_page(study: Study, lines: Sequence[Figure]) -> str:
    """The page of a study, as HTML.

    Args:
        study: study of the design.
        lines: its figures.
    """
    params = study.params
    found = find_weights(params, study.silicone)
    weights = found if found and are_for(found, params, study.silicone) else None
    has = f"weights: <code>{escape(str(weights))}</code>" if weights else "no weights yet:"
    train = "" if weights else f"<pre tabindex='0'>{escape(command_for(params, study.silicone))}</pre>"
    pictures = "".join(
        f'<p><img src="{picture}" alt="{alt}"></p>'
        for picture, alt in (
            (load_curves(study), "force, patch and strain by depth"),
            (bound_bars(study), "bound on the error by tilt, load and axis"),
            (dots_picture(study), "dots in the picture"),
        )
    )
    return _page(
        f"{params.label} in {study.silicone}: what it will feel",
        f"<table>{''.join(_row(line) for line in lines)}</table>{SOURCES}"
        f"<p>Blind: {escape(blind_direction(study))}.</p>{pictures}"
        f"<h2>Next</h2><p>{has}</p>{train}<pre tabindex='0'>{escape(_next(study))}</pre>",
    )


def _next(study: Study) -> str:
    """Commands that make and run this design, with its dots and silicone."""
    params, other = study.params, study.silicone != DEFAULT_SILICONE
    made = {"D": plain(params.diameter_mm), "T": plain(params.wall_mm), **params.option_words}
    made |= {"material": shlex.quote(study.silicone)} if other else {}
    words = " ".join(f"{name}={value}" for name, value in made.items())
    live = typed_command("sensing.live", *design_words(params), *(("--silicone", study.silicone) if other else ()))
    return "\n".join((f"{camera_setting()}make molds {words}", f"{camera_setting()}make endcap {words}", live))


def map_page(places: Sequence[Place], choices: Sequence[Choice], question: str) -> str:
    """The page of the map: all designs for every silicone, and the answer to a question, as HTML.

    Args:
        places: places of the map.
        choices: answers; empty without a question.
        question: the question in words.
    """
    answer = ""
    if choices:
        rows = "".join(
            f"<tr><td><b>{escape(choice.place.label)}</b></td><td>{escape(choice.why)}</td></tr>" for choice in choices
        )
        answer = f"<h2>{escape(question)}</h2><table>{rows}</table>"
    panels = "".join(
        f'<p><img src="{map_panels(places, name)}" alt="map of {escape(name)}"></p>'
        for name in silicones()
        if any(place.silicone == name for place in places)
    )
    prices = [f"{silicone_usd_kg(name):.0f}" for name in sorted(silicones(), key=silicone_usd_kg)]
    note = (
        "<p>Range, stiffness, bound and mass are computed (library of solved states, closed forms), cost is estimated "
        f"(silicones at {prices[0]} to {prices[-1]} dollars a kg, each in its smallest kit, PLA of our mold at "
        f"{PLA_USD_KG:.0f}, with R squared). All but mass and cost go with the shear modulus, so the maps of two "
        f"silicones differ by a factor. The bound is that of the camera module {escape(camera_module().name)}.</p>"
    )
    return _page("Designs that can be made, and what each will feel", answer + note + panels)


def _row(line: Figure) -> str:
    return (
        f'<tr><td>{escape(line.name)}</td><td class="n">{escape(line.text)}</td>'
        f'<td class="{line.source.value}">{line.source.value}</td><td><small>{escape(line.note)}</small></td></tr>'
    )


def _page(title: str, body: str) -> str:
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{STYLE}</style></head><body><main><h1>{escape(title)}</h1>{body}</main></body></html>\n"
    )
