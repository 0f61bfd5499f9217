"""Check, before anything is made, that a silicone stays pourable until its mold is closed."""

from __future__ import annotations

from cad.errors import ParameterError
from cad.materials import silicone, silicones
from cad.mold.layout import MoldLayout
from fab.recipe import closed_cast_mm3, timeline


def short_pot_life_words(layout: MoldLayout, volume_mm3: float | None = None) -> str | None:
    """Warning for a silicone that thickens before the mold is closed; ``None`` where there is time.

    Args:
        layout: the design and its silicone.
        volume_mm3: of the cast, mm3; by default its closed form, which needs no CAD kernel.
    """
    volume = closed_cast_mm3(layout.params) if volume_mm3 is None else volume_mm3
    row, closed_min = silicone(layout.silicone), _closed_min(layout.silicone, volume)
    if closed_min <= row.pot_life_min:
        return None
    others = [name for name in silicones() if _fits(layout, name, volume)]
    choice = f"take {', '.join(others)}, " if others else "take "
    return (
        f"material={row.name!r}: {volume / 1e6:.1f} l take {closed_min:g} min to mix, pour and close, and the pot life "
        f"is {row.pot_life_min:g}: {choice}a thinner wall or a smaller D"
    )


def require_pot_life(layout: MoldLayout, volume_mm3: float) -> None:
    """Refuse a cast that thickens before its mold is closed.

    Args:
        layout: the design and its silicone.
        volume_mm3: of the cast, mm3.

    Raises:
        ParameterError: the time is too short; the message names silicones with a sufficient pot life.
    """
    if words := short_pot_life_words(layout, volume_mm3):
        raise ParameterError(words, name="material", value=layout.silicone)


def _closed_min(name: str, volume_mm3: float) -> float:
    """Minutes from the first contact of the two parts to the closed mold."""
    return timeline(silicone(name), volume_mm3)[-1].end_min


def _fits(layout: MoldLayout, name: str, volume_mm3: float) -> bool:
    """Whether another silicone leaves the time, and does not leak through joints of this clearance."""
    try:
        MoldLayout(layout.params, layout.joint_clearance_mm, name)
    except ParameterError:
        return False
    return _closed_min(name, volume_mm3) <= silicone(name).pot_life_min
