"""Cost of one endcap: the sum paid for whole packs, and the share of it that endcap and mold use."""

from __future__ import annotations

from fab.build_sheet.commands import make_command
from fab.build_sheet.data import SheetData


def cost_facts(data: SheetData) -> list[tuple[str, str]]:
    """Two lines of the cover: the sum that is paid and the value used, each with what it leaves out.

    Args:
        data: of the sheet.
    """
    is_sliced = all(line.price_usd is not None for line in data.lines if line.kind == "made")
    unpriced = [line.item for line in data.lines if line.kind not in ("made", "tool") and line.paid_usd is None]
    without = f"; without {', '.join(unpriced)}: no price is known" if unpriced else ""
    paid = sum(line.paid_usd or 0.0 for line in data.lines)
    used = sum(line.price_usd or 0.0 for line in data.lines)
    spools = "" if is_sliced else "; spools by an estimate of the plastic until the prints are sliced"
    prints = "plastic by the gram, " if is_sliced else ""
    later = "" if is_sliced else f"; WITHOUT the prints, whose grams {make_command('slice', data)} measures"
    return [
        ("to pay", f"about {paid:.0f} USD: bags, spools, kits and the batch of ring boards whole, no tools"
                   f"{spools}{without}"),
        ("of it used", f"about {used:.0f} USD: {prints}screws by the piece, one ring board, the rest whole"
                       f"{later}{without}"),
    ]  # fmt: skip
