"""The protocols by name; each is a function from (seed, number, azimuths) to a loading path."""

from __future__ import annotations

from collections.abc import Callable

from cad.errors import ParameterError
from sensing.simulator.protocols.dynamic import dynamic_path
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.protocols.robot import robot_path
from sensing.simulator.protocols.static import static_path
from sensing.simulator.protocols.wide import steep_path, wide_path

# (seed, number, azimuths) -> loading path
PROTOCOLS: dict[str, Callable[[int, int, int], LoadPath]] = {
    "static": static_path,
    "dynamic": dynamic_path,
    "robot": robot_path,
    "wide": wide_path,
    "steep": steep_path,
}


def load_path(protocol: str, seed: int, number: int, azimuths: int) -> LoadPath:
    """Path of a protocol by its name.

    Args:
        protocol: a name in :data:`PROTOCOLS`.
        seed: seed of the data set.
        number: number of the path.
        azimuths: number of azimuths that are labelled.

    Raises:
        ParameterError: unknown protocol; the message lists the known ones.
    """
    if protocol not in PROTOCOLS:
        raise ParameterError(
            f"protocol={protocol!r} is unknown: choose one of {', '.join(PROTOCOLS)}", name="protocol", value=protocol
        )
    return PROTOCOLS[protocol](seed, number, azimuths)
