"""A study as one object: its figures by key, and its files (page, table, JSON)."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from cad.errors import ParameterError
from cad.whole_file import make_folder, replace_file
from sensing.camera.chosen_module import endcap_label
from sensing.design.figures import Figure, as_csv, as_record, blind_direction, figures
from sensing.design.pressed import Study
from sensing.design.prints import Prints


@dataclass(frozen=True)
class Report:
    """Report on a design; ``report["silicone_g"].value``, ``report.write("out")``.

    Attributes:
        study: the design in its silicone.
        prints: prints from its sliced files; None for estimates.
    """

    study: Study
    prints: Prints | None = None

    @cached_property
    def figures(self) -> tuple[Figure, ...]:
        """Every figure, in the order of the page, each with its source."""
        return tuple(figures(self.study, self.prints))

    def __getitem__(self, key: str) -> Figure:
        """One figure by its key.

        Raises:
            ParameterError: no figure has that key.
        """
        found = {figure.key: figure for figure in self.figures}
        if key not in found:
            raise ParameterError(f"{key!r} is no figure of a study: choose from {', '.join(found)}", name="key")
        return found[key]

    @property
    def blind(self) -> str:
        """The direction of the load that the dots determine least, in words."""
        return blind_direction(self.study)

    @property
    def label(self) -> str:
        """Name of its folder in exports: the design, and silicone and camera module where they are not the defaults."""
        return endcap_label(self.study.params, self.study.silicone)

    def write(self, folder: str | Path) -> Path:
        """Write study.csv, study.json and study.html; returns the page.

        Raises:
            FileError: the folder cannot be written.
        """
        from sensing.design.page import study_page

        lines, place = list(self.figures), Path(folder)
        make_folder(place)
        record = json.dumps(as_record(self.study, lines), indent=1, allow_nan=False, default=_plain) + "\n"
        texts = {"study.csv": as_csv(lines), "study.json": record, "study.html": study_page(self.study, lines)}
        for name, text in texts.items():
            replace_file(place / name, text.encode())
        return place / "study.html"


def _plain(value: object) -> object:
    return float(value) if hasattr(value, "__float__") else str(value)
