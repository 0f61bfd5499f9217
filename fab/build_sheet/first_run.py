"""First run of an endcap in the build sheet: does the program find the dots, the weights, setup, and known weights."""

from __future__ import annotations

import shlex

from fab.build_sheet.blocks import Block, Paragraph
from fab.build_sheet.commands import INTERPRETER, camera_setting, program_command, train_command, weights_g
from fab.build_sheet.data import SheetData


def first_run(data: SheetData) -> list[Block]:
    """Steps of the first run: check of the picture, calibration, weights where none ship, setup, live, known weights.

    Args:
        data: of the sheet.
    """
    params, material = data.layout.params, data.recipe.silicone.name
    train = train_command(params, material)
    weights = (
        [Paragraph("No weights ship for this endcap. Make them (minutes); setup and live find them:"), Paragraph(train)]
        if train
        else []
    )
    return [
        Paragraph("Let the program judge light, focus and dots as well; it names the fix of what is bad:"),
        Paragraph(program_command("sensing.sources check 0", params)),
        Paragraph(
            "Then see whether the dots are found. This command writes camera.json and fit.png:"
        ),
        Paragraph(
            program_command(
                "sensing.calibrate", params, "--photo", "a.jpg", "--out", "camera.json", "--picture", "fit.png"
            )
        ),
        Paragraph(
            "fit.png is a.jpg with marks. A green cross is where the design has a dot that was found, seen by the "
            "camera that fits best. A yellow line from a cross points to where the dot is painted, ten times as long "
            "as it is off. A gray cross is a dot that was not found, a red ring a dark spot that is no dot."
        ),
        *weights,
        Paragraph(
            "To run it, two commands. The first takes the untouched reference, finds the camera in it, and writes "
            "endcaps.toml. The second shows force and contact:"
        ),
        Paragraph(program_command("sensing.setup", params, "--silicone", shlex.quote(material))),
        Paragraph(f"{camera_setting()}{INTERPRETER} -m sensing.live --config endcaps.toml"),
        Paragraph(
            'Neither reads camera.json by itself. To use it, write camera = "camera.json" under [[endcap]] in '
            "endcaps.toml."
        ),
        *_weighing(weights_g(params, material)),
    ]  # fmt: skip


def _weighing(weights: str) -> list[Block]:
    """Last step of the first run: known weights correct the forces for the silicone that was cast."""
    return [
        Paragraph(
            "Silicone differs from batch to batch, and no picture shows how stiff yours is. Correct the forces with "
            f"two known weights of {weights}, one near each end of that range. Stand the endcap on its adapter, "
            "upright on a level table, with nothing on it. Each weight presses on the dome through a flat plate; put "
            "weight and plate on a scale together. The command asks for one after the other:"
        ),
        Paragraph(f"{camera_setting()}{INTERPRETER} -m sensing.weigh --config endcaps.toml"),
    ]
