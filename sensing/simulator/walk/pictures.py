"""Pictures of the cameras of a robot's endcaps during a run: one of the pressed dome for every frame.

    sensor = WalkSensor(simulator, number=101)
    rest = [sensor.picture(None, noise) for noise in range(10)]
    frames = sensor.frames(states, contacts)                       # sensing.records.Frame, capture times of the run

Every endcap has paint, camera and mounting of its own, with random errors of hand assembly. A picture shows a shell
at rest under the load of its moment: without motion during the exposure, rate effects, and torque about the contact's
normal, which the simulator's bodies do not exert.
"""

from __future__ import annotations

from collections.abc import Iterator

from cad.params import EndcapParams
from sensing.records import Frame
from sensing.simulator.dataset.request import DataRequest
from sensing.simulator.levels import Simulator
from sensing.simulator.render.dome import DomeRenderer
from sensing.simulator.solid.element import Array
from sensing.simulator.walk.contacts import Contacts
from sensing.simulator.walk.pressed import PressedStates

REST = 10  # number of pictures of the untouched dome before the run


class WalkSensor:
    """The camera in one endcap.

    Args:
        simulator: simulator of the shell.
        number: number of the sensor, which determines its paint and the errors of its camera and mounting
            (:class:`sensing.simulator.dataset.request.DataRequest`).
        render: quality of the pictures.
    """

    def __init__(self, simulator: Simulator, number: int, render: str = "data") -> None:
        diameter, wall = 2 * simulator.geometry.outer_radius_mm, simulator.geometry.wall_mm
        request = DataRequest(1, diameter, wall, render=render, sensor=number)
        surface = simulator.surface
        self.params: EndcapParams = request.params
        self.name = f"simulated sensor {number}"
        self._renderer = DomeRenderer(
            request.params, request.mounted, request.settings, surface.position, surface.interpolation
        )

    def picture(self, field_mm: Array | None, noise: int, azimuth_deg: float = 0.0) -> bytes:
        """JPEG bytes of a state.

        Args:
            field_mm: (k, 3) displacement of the simulator's inner surface, contact on azimuth 0; None for the untouched
                dome.
            noise: number that selects the noise.
            azimuth_deg: azimuth of the contact, degrees.
        """
        return self._renderer.render(field_mm, azimuth_deg=azimuth_deg, frame=noise).jpeg

    def rest(self) -> list[Frame]:
        """Frames of the untouched dome before the run, at 30 Hz up to a second before time 0."""
        return [
            Frame((number - REST) / 30.0 - 1.0, number, self.name, jpeg=self.picture(None, number))
            for number in range(REST)
        ]

    def frames(self, states: PressedStates, contacts: Contacts) -> Iterator[Frame]:
        """One frame for each moment of a run.

        Args:
            states: states of the shell.
            contacts: contacts of these states.
        """
        for k, time_s in enumerate(contacts.time_s):
            field = states.surface_mm[k].astype(float) if contacts.normal_n[k] > 0 else None
            jpeg = self.picture(field, REST + k, float(contacts.azimuth_deg[k]))
            yield Frame(float(time_s), REST + k, self.name, jpeg=jpeg)
