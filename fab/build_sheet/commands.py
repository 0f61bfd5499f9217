"""Commands printed in the sheet, with the parameters of this endcap and the interpreter of the project's environment.

They are typed in the toolkit's folder, and name the camera module where it is not the released one.
"""

from __future__ import annotations

import shlex

from cad.design_arguments import design_words
from cad.identity import RELEASED_SILICONE
from cad.lens import camera_setting
from cad.materials import DEFAULT_SILICONE
from cad.materials import silicone as silicone_row
from cad.params import EndcapParams
from fab.build_sheet.data import SheetData
from fab.slice.printers import printer_words
from fab.variant import Variant, coupons_command, printer_option, size_words

INTERPRETER = ".venv/bin/python"
RELEASED = EndcapParams(130.0, 8.0)
RELEASED_LOAD_N = 35.0  # P, NET22: largest set-point of the released data; of other endcaps as their forces scale
WEIGHED_PARTS = 0.15, 0.7  # of that range: what sensing.weigh takes best
LEAST_G, MOST_G = 20.0, 6000.0  # that it takes at all
LEAST_RATIO = 2.0  # E: of the heaviest over the lightest; sensing.weigh refuses weights that are nearly equal
GRAVITY_M_S2 = 9.80665  # standard gravity, ISO 80000-3


def make_command(target: str, data: SheetData, printer: str | None = None) -> str:
    """A command of make for this very variant, for example ``make slice D=150 T=9 printer=mk4``.

    Args:
        target: of make.
        data: of the sheet.
        printer: name in the printers' table; by default that of the sheet, unless make uses it anyway.
    """
    chosen = printer or (data.molds_printer if target == "molds" else data.printer)
    named = printer_words(chosen)
    if target != "molds" and not named and data.molds_printer != chosen:  # else that of the molds would be taken
        named = f" {printer_option(chosen)}"
    return f"{Variant(data.layout, data.robot).command(target)}{named}{data.exports_option}"


def ring_command(data: SheetData) -> str:
    """The command that makes the LED ring's files, which depend on neither clearance nor silicone."""
    return f"{camera_setting()}make ring {size_words(data.layout.params)}{data.exports_option}"


def coupons_line(data: SheetData) -> str:
    """The command that makes the coupons for this printer, with the folder of exports where it is not the default."""
    return f"{coupons_command(data.layout.silicone)}{printer_words(data.printer)}{data.exports_option}"


def program_command(module: str, params: EndcapParams, *words: str) -> str:
    """Command line of a program of the sensing side for this endcap.

    Args:
        module: of the program.
        params: the design.
        words: further arguments.
    """
    return camera_setting() + " ".join((INTERPRETER, "-m", module, *design_words(params), *words))


def train_command(params: EndcapParams, silicone: str) -> str:
    """The command that makes weights for this endcap; empty for the released one, whose weights ship.

    Args:
        params: the design; sensing does not use its gyroid.
        silicone: row of cad/materials.csv.
    """
    is_released = design_words(params) == design_words(RELEASED) and silicone == DEFAULT_SILICONE
    if is_released and not camera_setting():
        return ""
    own = {name: value for name, value in params.option_words.items() if name != "gyroid"}
    own |= {"material": shlex.quote(silicone)} if silicone != DEFAULT_SILICONE else {}
    words = (f"{name}={value}" for name, value in own.items())
    return camera_setting() + " ".join(("make train", size_words(params), *words))


def weights_g(params: EndcapParams, silicone_name: str) -> str:
    """Range of the weights with which this endcap's forces are corrected, as text: ``540 to 2500 g``.

    Args:
        params: the design.
        silicone_name: row of cad/materials.csv.
    """
    stiffer = silicone_row(silicone_name).neo_hooke_c10_mpa / float(RELEASED_SILICONE["c10_mpa"])
    range_n = RELEASED_LOAD_N * stiffer * (params.wall_mm / RELEASED.wall_mm) ** 2
    least_g, most_g = (
        min(max(float(f"{1000 * part * range_n / GRAVITY_M_S2:.2g}"), LEAST_G), MOST_G) for part in WEIGHED_PARTS
    )
    return f"{min(least_g, most_g / LEAST_RATIO):.0f} to {most_g:.0f} g"
