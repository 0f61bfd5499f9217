"""The request of a data set: all options that decide its numbers and pictures, and no others."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from cad.errors import ParameterError
from cad.identity import Identity, identity
from cad.materials import DEFAULT_SILICONE, silicone
from cad.params import EndcapParams
from cad.pattern import RELEASED_DOT_MM, RELEASED_RINGS, parse_rings, rings_text
from sensing.camera.mount import MountedCamera, mount, rotation_matrix
from sensing.camera.nominal import nominal_lens
from sensing.simulator.contact.indenter import KINDS, Indenter
from sensing.simulator.levels import MAX_TOLERANCE
from sensing.simulator.protocols.catalogue import load_path
from sensing.simulator.protocols.loading import LoadPath
from sensing.simulator.protocols.robot import ENDCAPS
from sensing.simulator.protocols.scaled import scaled
from sensing.simulator.render.settings import LEVELS as RENDER_LEVELS
from sensing.simulator.render.settings import Lamp, Paint, RenderSettings, Sensor
from sensing.simulator.similarity.ratios import LoadScale
from sensing.simulator.solid.geometry import ShellGeometry
from sensing.simulator.solid.mesh import DENSITIES
from sensing.simulator.solid.shell import PLAIN, require_interlock

PATHS_PER_SHARD = 3  # loading paths of a shard
MOST_AZIMUTHS = 64  # a shard of 33 states a path and 80 kB a picture has 510 MB then; sensing.npz reads up to 537
TOLERANCE = 2e-3  # of level 2 (docs/data.md: markers within 0.01 %, wrench within 0.2 % of a converged path)
PATH_LEVELS = (1, 2)  # levels that follow a path; level 4 depends on forces alone (Simulator.bulk)
RENDERERS = ("off", *RENDER_LEVELS)  # values of ``render``
LAMPS = ("varied", "steady")  # values of ``lamp``
RELEASED, DESIGN = "released", "design"  # values of ``loads``
LOADS = (RELEASED, DESIGN)
NOISE_KEY = 2  # numbering of the pictures' noise: 1 by path and picture, 2 by seed, path and picture
# Values of options that manifests written before these options lack.
ADDED_SINCE = {
    "rate_effects": False,
    "prony": [],
    "indenter": "plane",
    "radius_mm": 20.0,
    "axis_deg": 90.0,
    "loads": RELEASED,
    "dot_rings": rings_text(RELEASED_RINGS),
    "dot_mm": RELEASED_DOT_MM,
    "interlock": PLAIN,
    "noise_key": 1,
}
# E: standard deviations between sensors: tilt of the camera, degrees; its offset, mm; focal length, relative.
MOUNT_TILT_DEG, MOUNT_SHIFT_MM, FOCAL_SHARE = 1.5, 0.5, 0.01


@dataclass(frozen=True)
class DataRequest:
    """Request of a data set; equal requests give equal data.

    Attributes:
        frames: least number of labelled frames (whole paths and scenes of a robot are kept, so a few more).
        diameter_mm, wall_mm, silicone: the shell: outer diameter D and wall T, mm; row of cad/materials.csv.
        dot_rings, dot_mm: its dot pattern (:mod:`cad.pattern`).
        density: density of the mesh (:data:`sensing.simulator.solid.mesh.DENSITIES`).
        level, tolerance: level of the mechanics and its relative residual (:mod:`sensing.simulator.levels`).
        interlock: stiffness of the zone with the TPU gyroid over that of silicone; 1: plain silicone.
        rate_effects: whether the silicone relaxes (by its row of cad/materials.csv); needs a protocol with times.
        indenter, radius_mm, axis_deg: body that presses (:data:`sensing.simulator.contact.indenter.KINDS`); radius of a
            sphere, edge or crest, mm; direction of an edge or of rows of crests from the meridian, degrees. Radius and
            direction are ignored for bodies without them.
        protocol, seed: protocol of the loading paths, and seed of their random numbers.
        loads: set-points of the paths: ``released`` as they are, for D=130 T=8 in Smooth-Sil 950; ``design`` in
            proportion to the range of this design's weights.
        azimuths: number of labelled azimuths of every solved state.
        render: quality of the pictures (:data:`sensing.simulator.render.settings.LEVELS`), or ``off``.
        lamp: ``varied`` draws brightness, gradient and exposure for every path; ``steady`` keeps the nominal ones.
        sensor: number of the hand-painted endcap: it determines the paint and, except for 0, the nominal one, the
            camera and its mounting.
        unpainted, missing, smeared, extra: defects of its dots (:class:`sensing.simulator.render.settings.Paint`).

    Raises:
        ParameterError: a value outside its range.
    """

    frames: int
    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    silicone: str = DEFAULT_SILICONE
    density: str = "data"
    level: int = 2
    tolerance: float = TOLERANCE
    rate_effects: bool = False
    indenter: str = "plane"
    radius_mm: float = 20.0
    axis_deg: float = 90.0
    protocol: str = "static"
    seed: int = 0
    loads: str = RELEASED
    azimuths: int = 4
    render: str = "data"
    lamp: str = "varied"
    sensor: int = 0
    unpainted: float = 0.0
    missing: float = 0.0
    smeared: float = 0.06
    extra: int = 0
    dot_rings: str = rings_text(RELEASED_RINGS)
    dot_mm: float = RELEASED_DOT_MM
    interlock: float = PLAIN

    def __post_init__(self) -> None:
        ranges = {"frames": (1, 10**7), "azimuths": (1, MOST_AZIMUTHS), "seed": (0, 2**32), "sensor": (0, 2**32)}
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            if not low <= value <= high:
                raise ParameterError(f"{name}={value} outside {low}..{high}: give a count", name=name, value=value)
        if not 1e-9 <= self.tolerance <= MAX_TOLERANCE:
            raise ParameterError(
                f"tolerance={self.tolerance:g} outside 1e-9..{MAX_TOLERANCE:g}: above it labels would be wrong by "
                "percents, below it rounding decides",
                name="tolerance",
                value=self.tolerance,
            )
        choices: dict[str, Collection[Any]] = {
            "indenter": KINDS,
            "density": DENSITIES,
            "render": RENDERERS,
            "lamp": LAMPS,
            "level": PATH_LEVELS,
            "loads": LOADS,
        }
        for name, known in choices.items():
            value = getattr(self, name)
            if value not in known:
                raise ParameterError(
                    f"{name}={value!r} is unknown: choose one of {', '.join(map(str, known))}", name=name, value=value
                )
        require_interlock(self.interlock)
        self._require_protocol()
        silicone(self.silicone)
        self.body(0.0)
        _ = self.params, self.settings, self.prony

    def _require_protocol(self) -> None:
        """Refuse options that the protocol does not have."""
        if load_path(self.protocol, self.seed, 0, 1).began_s is None and self.rate_effects:
            raise ParameterError(
                f"protocol={self.protocol!r} has no rate effects: its states are at rest, and no time passes between "
                "them; choose dynamic, or leave rate effects out",
                name="protocol",
                value=self.protocol,
            )
        if self.loads == DESIGN and self.protocol == "robot":
            raise ParameterError(
                "loads='design' with protocol='robot': stands carry the weight of one robot; choose another protocol",
                name="loads",
                value=self.loads,
            )

    @property
    def params(self) -> EndcapParams:
        """The design."""
        return EndcapParams(self.diameter_mm, self.wall_mm, parse_rings(self.dot_rings), self.dot_mm)

    @property
    def identity(self) -> Identity:
        """Design, dot pattern, camera, silicone and mesh."""
        mesh = DENSITIES[self.density]
        return identity(self.params, self.silicone, (mesh.core, mesh.rings, mesh.layers))

    @property
    def prony(self) -> tuple[tuple[float, float], ...]:
        """Prony series of the silicone, pairs (g, tau_s); empty without rate effects."""
        return silicone(self.silicone).prony_series() if self.rate_effects else ()

    @property
    def settings(self) -> RenderSettings:
        """Render settings of the request under the nominal lamp."""
        paint = Paint(unpainted=self.unpainted, missing=self.missing, smeared=self.smeared, extra=self.extra)
        plain = RenderSettings(seed=self.sensor, paint=paint)
        return plain if self.render == "off" else plain.at_level(self.render)  # type: ignore[arg-type]

    def body(self, tilt_deg: float) -> Indenter:
        """The indenter at its first touch.

        Raises:
            ParameterError: a radius that is not positive, or a tilt that no indenter reaches.
        """
        return Indenter(tilt_deg, self.indenter, self.radius_mm, self.axis_deg)

    @property
    def mounted(self) -> MountedCamera:
        """Camera of this sensor: the nominal one for sensor 0, else one with random errors of hand assembly."""
        lens, height = nominal_lens(), self.params.camera_height_mm
        if self.sensor == 0:
            return mount(lens, (0.0, 0.0, height))
        rng = np.random.default_rng([self.sensor, 11])
        tilt = np.radians(MOUNT_TILT_DEG) * rng.standard_normal(3)
        shift = MOUNT_SHIFT_MM * rng.standard_normal(3)
        pupil = (shift[0], shift[1], shift[2] + height)
        scale = 1 + FOCAL_SHARE * rng.standard_normal()
        lens = replace(lens, fx_px=lens.fx_px * scale, fy_px=lens.fy_px * scale)
        return mount(lens, pupil, rotation_matrix(tilt))

    def light(self, path: int) -> tuple[Lamp, float]:
        """Lamp and camera exposure of a path."""
        if self.lamp == "steady":
            return Lamp(), Sensor().exposure
        rng = np.random.default_rng([self.seed, path, 7])
        brightness, gradient, azimuth, exposure = rng.uniform((0.75, 0.0, 0.0, 0.8), (1.25, 0.3, 360.0, 1.25))
        return Lamp(brightness=brightness, gradient=gradient, gradient_azimuth_deg=azimuth), float(exposure)

    @property
    def scale(self) -> LoadScale:
        """Loads of this design over those of D=130 T=8 in Smooth-Sil 950."""
        geometry = ShellGeometry.from_params(self.params)
        return LoadScale.of(geometry, silicone(self.silicone).neo_hooke().shear_mpa)

    def shards(self) -> list[list[LoadPath]]:
        """Paths of every shard; shards are complete, so that a set can grow later, and hold all endcaps of a scene."""
        shards: list[list[LoadPath]] = []
        total = 0
        while total < self.frames or shards[-1][-1].endcap not in (-1, ENDCAPS - 1):
            numbers = range(len(shards) * PATHS_PER_SHARD, (len(shards) + 1) * PATHS_PER_SHARD)
            shards.append([self._path(number) for number in numbers])
            total += sum(path.frames for path in shards[-1])
        return shards

    def _path(self, number: int) -> LoadPath:
        path = load_path(self.protocol, self.seed, number, self.azimuths)
        return path if self.loads == RELEASED else scaled(path, self.scale)

    def record(self) -> dict[str, Any]:
        """Record for the manifest: the request and the constants behind its names."""
        law = silicone(self.silicone).neo_hooke()
        constants = {"c10_mpa": law.c10_mpa, "bulk_mpa": law.bulk_mpa, "poisson": law.poisson, "prony": self.prony}
        return {**asdict(self), **constants, "noise_key": NOISE_KEY}
