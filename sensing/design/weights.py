"""Weights of any design and silicone in minutes: states from the library, viewed by the camera of that size, training.

    model = design_weights(DesignRequest(EndcapParams(180, 10)), FitConfig())

With ``solved``, other states (such as those of a direct simulation) replace those of the library.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from cad.materials import DEFAULT_SILICONE, silicone
from cad.messages import LOG
from cad.params import EndcapParams
from cad.pattern import rings_text
from sensing.design.unfinished import unfinished
from sensing.learning.contenders import read_all
from sensing.learning.fit_config import FitConfig
from sensing.learning.radial import radial_tensors
from sensing.learning.samples import MARKERS, SENSORS, SHAPE
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.levels import Simulator
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.similarity.labelled import (
    StateSource,
    library_source,
    shell_of,
    with_azimuths,
    write_labelled,
)
from sensing.simulator.similarity.paths import library_paths
from sensing.simulator.similarity.ratios import LoadScale
from sensing.simulator.solid.geometry import shell_geometry
from sensing.wrench.model import WrenchModel
from sensing.wrench.weight_files import BY_SIMILARITY, MADE_BY, are_for, find_weights

AZIMUTHS, PICTURE_AZIMUTHS = 8, 1  # of every state: for training; in pictures that scale the covariance
Say = Callable[[str], None]


@dataclass(frozen=True)
class DesignRequest:
    """Request of weights for one design.

    Attributes:
        params: design.
        silicone: row of cad/materials.csv.
        azimuths: number of azimuths at which every state is viewed.
        pictures: whether the states are rendered and tracked once, to scale the covariance.
        numbers: numbers of the library's paths that are used; None for all.
    """

    params: EndcapParams
    silicone: str = DEFAULT_SILICONE
    azimuths: int = AZIMUTHS
    pictures: bool = True
    numbers: tuple[int, ...] | None = None

    @property
    def paths(self) -> list[LoadPath]:
        """The paths that are used."""
        return [path for path in library_paths() if self.numbers is None or path.number in self.numbers]

    @property
    def scale(self) -> LoadScale:
        """Loads of this design over those of D=130 T=8."""
        geometry = shell_geometry(self.params.diameter_mm, self.params.wall_mm)
        return LoadScale.of(geometry, silicone(self.silicone).neo_hooke().shear_mpa)

    def data(self, render: str, azimuths: int) -> DataRequest:
        """Request of a data set.

        Args:
            render: quality of the pictures, or ``off``.
            azimuths: number of azimuths of every state.
        """
        return DataRequest(
            frames=1, diameter_mm=self.params.diameter_mm, wall_mm=self.params.wall_mm, silicone=self.silicone,
            dot_rings=rings_text(self.params.dot_rings), dot_mm=self.params.dot_mm,
            azimuths=azimuths, render=render, lamp="steady", loads="design",
        )  # fmt: skip


def known_weights(request: DesignRequest) -> Path | None:
    """File that live takes for a design; None without one, and where the row of its silicone or camera has changed.

    Args:
        request: the design.
    """
    known = find_weights(request.params, request.silicone)
    if known is None or are_for(known, request.params, request.silicone):
        return known
    LOG.info(f"{known}: damaged, or made with other numbers of silicone or camera than the tables have: made anew")
    return None


def saved_weights(out: Path, request: DesignRequest, config: FitConfig, say: Say) -> WrenchModel:
    """Train weights for a design and write them; a run that was stopped goes on.

    Args:
        out: file of the weights.
        request, config, say: as for :func:`design_weights`.

    Raises:
        ParameterError: a design outside the library.
        FileError: the library is missing, or a file cannot be written.
    """
    with unfinished(out, f"{request} {request.data('off', 1).identity.digest}") as folder:
        model = design_weights(request, config, say, folder=folder)
        model.save(out)
    return model


def design_weights(
    request: DesignRequest,
    config: FitConfig,
    say: Say | None = None,
    solved: StateSource | None = None,
    folder: Path | None = None,
) -> WrenchModel:
    """Train weights for a design.

    Args:
        request: design and its states.
        config: settings of training.
        say: function that takes one line for each stage.
        solved: states of the library's paths from elsewhere (a direct simulation); None takes the library.
        folder: folder in which a stopped training of the same request goes on (:mod:`sensing.design.unfinished`);
            None takes a temporary one.

    Raises:
        ParameterError: a design outside the library.
        FileError: the library is missing, or the pictures cannot be written.
    """
    from sensing.learning.fitting import fit  # torch takes seconds to load

    say = say or (lambda text: None)
    if folder is None:
        with tempfile.TemporaryDirectory(prefix="endcap_weights_") as place:
            return design_weights(request, config, say, solved, Path(place))
    shell = shell_of(request.data("off", request.azimuths))
    source = solved or library_source(shell[0])
    say(f"states of {request.params.label} from the library")
    _write(request, "off", request.azimuths, source, folder / "states", shell)
    pictured = None
    if request.pictures:
        say("pictures of them, tracked")
        _write(request, "data", PICTURE_AZIMUTHS, source, folder / "pictures", shell)
        pictured = read_all([folder / "pictures"], "dots", SHAPE)
    say(f"fields of {SENSORS} domain-randomised sensors")
    samples = replace(read_all([folder / "states"], MARKERS, SHAPE), sources=("library",))
    say("training")
    model = fit(samples, config, checkpoint=folder / "checkpoint", pictures=pictured)
    model = replace(model, weights=model.weights | radial_tensors([folder / "states"], SHAPE))
    about = {"silicone": request.silicone, MADE_BY: BY_SIMILARITY, "range_n": round(request.scale.top_n, 3)}
    return replace(model, about=model.about | about)


def _write(
    request: DesignRequest, render: str, azimuths: int, source: StateSource, folder: Path,
    shell: tuple[Simulator, LoadScale],
) -> None:  # fmt: skip
    """Write the request's states into a folder, but for the paths that a stopped run left there."""
    paths = with_azimuths(request.paths, azimuths)
    write_labelled(request.data(render, azimuths), paths, source, folder, shell, keep=True)
