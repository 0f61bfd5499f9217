"""Contact of the ground with an endcap during a run, in the variables of the shell's simulation (N, degrees).

    contacts = contacts_of(walk, robot, robot.endcaps[0], rows)

The contact's direction on the dome is that of the ground's normal in the endcap frame: on the rigid sphere of the run
the two are the same. Load and pull are the normal and the tangential component of the ground's force.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensing.simulator.walk.truth import Walk
from sensing.tensegrity.description import Array, MountedEndcap, TensegrityRobot


@dataclass(frozen=True)
class Contacts:
    """One endcap at n times.

    Attributes:
        time_s: (n,) times, s.
        tilt_deg: (n,) angle from the tip to the contact, degrees; 0 without contact.
        azimuth_deg: (n,) azimuth of the contact, endcap frame, degrees.
        normal_n: (n,) load along the inward normal, N; 0 without contact.
        tangential_n: (n, 2) force of the ground on the endcap, N, along (meridian, lateral) as in
            :mod:`sensing.simulator.contact.indenter`.
    """

    time_s: Array
    tilt_deg: Array
    azimuth_deg: Array
    normal_n: Array
    tangential_n: Array

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Contacts:
        """The contacts that an index or a mask selects."""
        return Contacts(**{name: getattr(self, name)[rows] for name in self.__dataclass_fields__})


def contacts_of(walk: Walk, robot: TensegrityRobot, endcap: MountedEndcap, rows: NDArray[np.int64]) -> Contacts:
    """Contacts of an endcap.

    Args:
        walk: the run.
        robot: robot of the run.
        endcap: endcap whose contacts are returned.
        rows: numbers of samples of the run.
    """
    number, bar = robot.endcaps.index(endcap), robot.bar_number(endcap.bar)
    into = np.swapaxes(walk.T_world_bar[rows, bar, :3, :3] @ endcap.T_bar_endcap[:3, :3], 1, 2)
    outward = -np.einsum("nij,nj->ni", into, walk.normal[rows, number])
    force = np.einsum("nij,nj->ni", into, walk.force_n[rows, number])
    normal = -np.einsum("ni,ni->n", force, outward)
    loaded = normal > 0
    outward[~loaded] = [0.0, 0.0, 1.0]
    tilt, azimuth = np.arccos(np.clip(outward[:, 2], -1, 1)), np.arctan2(outward[:, 1], outward[:, 0])
    zero = np.zeros_like(tilt)
    meridian = np.stack([np.cos(tilt) * np.cos(azimuth), np.cos(tilt) * np.sin(azimuth), -np.sin(tilt)], axis=1)
    lateral = np.stack([-np.sin(azimuth), np.cos(azimuth), zero], axis=1)
    pull = np.stack([(force * meridian).sum(axis=1), (force * lateral).sum(axis=1)], axis=1)
    return Contacts(
        walk.time_s[rows], np.degrees(tilt), np.degrees(azimuth),
        np.where(loaded, normal, 0.0), np.where(loaded[:, None], pull, 0.0),
    )  # fmt: skip
