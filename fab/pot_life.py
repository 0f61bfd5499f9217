"""Is there time to cast? Whether a silicone stays pourable until its mold is closed, said before anything is made."""

from __future__ import annotations

from dataclasses import replace

from cad.errors import ParameterError
from cad.leak import cast_volume_mm3
from cad.materials import silicones
from cad.mold_layout import MoldLayout
from fab.recipe import Recipe, overflow_of, recipe


def short_pot_life_words(layout: MoldLayout, mix: Recipe | None = None) -> str | None:
    """What to say of a silicone that thickens before the mold is closed; ``None`` where there is time.

    Args:
        layout: the design and its silicone.
        mix: its recipe; by default that of the cast's closed form.
    """
    mix = mix or _mix(layout)
    if mix.pot_life_to_spare_min >= 0:
        return None
    others = [name for name in silicones() if name != layout.silicone and _has_time(layout, name)]
    choice = f"take {', '.join(others)}, " if others else "take "
    return (
        f"material={layout.silicone!r}: {mix.cast_volume_mm3 / 1e6:.1f} l take {mix.timeline[-1].end_min:g} min to "
        f"mix, pour and close, and the pot life is {mix.silicone.pot_life_min:g}: {choice}a thinner wall or a smaller D"
    )


def require_pot_life(layout: MoldLayout, mix: Recipe) -> None:
    """Refuse a cast that thickens before its mold is closed.

    Args:
        layout: the design and its silicone. mix: its recipe.

    Raises:
        ParameterError: there is no time; the line names the silicones that give it.
    """
    if words := short_pot_life_words(layout, mix):
        raise ParameterError(words, name="material", value=layout.silicone)


def _mix(layout: MoldLayout) -> Recipe:
    return recipe(cast_volume_mm3(layout.params), overflow_of(layout), layout.silicone)


def _has_time(layout: MoldLayout, silicone: str) -> bool:
    try:
        return _mix(replace(layout, silicone=silicone)).pot_life_to_spare_min >= 0
    except ParameterError:  # it creeps through joints of this clearance
        return False
