"""A visuotactile endcap as a camera of LeRobot: its picture, and beside it wrench, contact and flags.

    config = EndcapCameraConfig(source="0", zero="endcap_0.npz", fps=30)
    with EndcapCamera(config) as camera:
        picture, wrench = camera.async_read(), camera.wrench

Forces in N, torques in N m on the endcap, at the origin of its frame. Numbers that do not count are NaN.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from lerobot.cameras.camera import Camera
from lerobot.cameras.configs import CameraConfig
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from numpy.typing import NDArray

from cad.errors import EndcapError, ParameterError
from cad.materials import DEFAULT_SILICONE
from sensing.decode import FrameError, decode_bgr
from sensing.live.core.reading import EndcapReading
from sensing.live.core.state import Event
from sensing.live.endcap import Endcap, open_endcap
from sensing.records import Wrench
from sensing.sources.camera import lasting_name, list_devices

READ_S = 10.0  # that read() waits, as LeRobot's own cameras do
STALE_S = 0.5  # a reading that is older is no observation of now
WRENCH = ("force_x_n", "force_y_n", "force_z_n", "torque_x_nm", "torque_y_nm", "torque_z_nm")


@CameraConfig.register_subclass("endcap")
@dataclass(kw_only=True)
class EndcapCameraConfig(CameraConfig):
    """One endcap.

    Attributes:
        fps: asked of the camera; None for 30. width, height: checked against the picture, not set; None for its own.
        source: camera number, a name of /dev/v4l/by-path, http address, or ``scene:0`` to ``scene:5``.
        zero: reference file; empty to take the first pictures, while the endcap must be untouched.
        diameter_mm, wall_mm: the design.
        silicone: row of the toolkit's materials that it is cast of.
        start_s: longest wait for the first reading.
    """

    source: str
    zero: str = ""
    diameter_mm: float = 130.0
    wall_mm: float = 8.0
    silicone: str = DEFAULT_SILICONE
    start_s: float = 20.0


class EndcapCamera(Camera):
    """An endcap behind LeRobot's interface of cameras; opened by :meth:`connect`."""

    def __init__(self, config: EndcapCameraConfig) -> None:
        super().__init__(config)
        self.config = config
        self._endcap: Endcap | None = None
        self._thread: threading.Thread | None = None
        self._changed = threading.Condition()
        self._reading: EndcapReading | None = None  # the newest
        self._seen: EndcapReading | None = None  # the newest with a picture that can be decoded
        self._count = self._given = 0  # pictures so far; the last one that was handed out
        self._ended = False

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.config.source})"

    @property
    def is_connected(self) -> bool:
        """Whether it was opened; a camera that is unplugged meanwhile is opened again by itself."""
        return self._endcap is not None

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        """Cameras of this computer; each may be an endcap."""
        return [{"name": name, "type": "endcap", "id": lasting_name(number)} for number, name in list_devices()]

    def connect(self, warmup: bool = True) -> None:
        """Open it; with ``warmup`` return when the first reading is there.

        Raises:
            ParameterError: a configuration that cannot be.
            ConnectionError: connected already, no such camera or file, or no reading within ``start_s``.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        asked = self.config
        try:
            self._endcap = open_endcap(
                asked.source, asked.zero or None, diameter_mm=asked.diameter_mm, wall_mm=asked.wall_mm,
                silicone=asked.silicone, rate_hz=asked.fps or 0.0,
            ).__enter__()  # fmt: skip
        except ParameterError:
            raise
        except EndcapError as error:
            raise ConnectionError(f"{self}: {error}") from error
        self._reading = self._seen = None
        self._count, self._given, self._ended = 0, 0, False
        self._thread = threading.Thread(target=self._take, args=(self._endcap,), daemon=True)
        self._thread.start()
        if not warmup:
            return
        try:
            self._after(0, asked.start_s)
        except BaseException as error:
            self.disconnect()
            if isinstance(error, TimeoutError):
                raise ConnectionError(str(error)) from None
            raise

    def read(self) -> NDArray[Any]:
        """(H, W, 3) uint8 RGB, the next picture from now on.

        Raises:
            DeviceNotConnectedError: not connected.
            TimeoutError: none comes.
            RuntimeError: of another size.
        """
        return self._after(self._count, READ_S)

    def async_read(self, timeout_ms: float = 200) -> NDArray[Any]:
        """(H, W, 3) uint8 RGB, the newest picture that was not handed out yet, or the next.

        Raises:
            DeviceNotConnectedError: not connected.
            TimeoutError: none comes.
            RuntimeError: of another size.
        """
        return self._after(self._given, timeout_ms / 1e3)

    def read_latest(self, max_age_ms: int = 500) -> NDArray[Any]:
        """(H, W, 3) uint8 RGB, the newest picture, at once.

        Raises:
            DeviceNotConnectedError: not connected.
            TimeoutError: the newest is older.
            RuntimeError: none yet.
        """
        endcap, seen = self._connected(), self._seen
        if seen is None:
            raise RuntimeError(f"{self} has given no picture yet{_why(endcap)}")
        age_ms = 1e3 * (time.monotonic() - seen.captured_s)
        if age_ms > max_age_ms:
            raise TimeoutError(f"{self}: the newest picture is {age_ms:.0f} ms old, over {max_age_ms} ms{_why(endcap)}")
        return self._picture(seen)

    def disconnect(self) -> None:
        """Let the camera go."""
        endcap, self._endcap = self._endcap, None
        if endcap is None:
            raise DeviceNotConnectedError(f"{self} is not connected")
        endcap.close()
        if self._thread is not None:
            self._thread.join(5.0)

    @property
    def reading(self) -> EndcapReading | None:
        """All that the newest frame gave, however old; None before the first."""
        return self._reading

    @property
    def current(self) -> bool:
        """Whether the newest reading counts, and is of now."""
        endcap, last = self._endcap, self._reading
        if endcap is None or last is None or not last.valid:
            return False
        return endcap.valid and time.monotonic() - last.captured_s <= STALE_S

    @property
    def wrench(self) -> Wrench:
        """The newest, filtered, with covariance and flags; NaN, with a flag, where it does not count now."""
        last, counts = self._reading, self.current
        if last is not None and (counts or not last.valid):
            return last.wrench
        flags = frozenset({"stale"}) if last is None else last.wrench.flags | {"stale"}
        return Wrench(0.0 if last is None else last.wrench.time_s, np.full(3, np.nan), np.full(3, np.nan), flags=flags)

    @property
    def touching(self) -> bool | None:
        """Whether it touches; None while that is not known."""
        last = self._reading
        return last.contact.touching if last is not None and self.current and last.contact.known else None

    def _connected(self) -> Endcap:
        if self._endcap is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._endcap

    def _take(self, endcap: Endcap) -> None:
        """Keep the newest reading, in a thread of its own."""
        for reading in endcap.readings():
            with self._changed:
                self._reading = reading
                if reading.event is not Event.UNDECODED:
                    self._seen, self._count = reading, self._count + 1
                self._changed.notify_all()
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _after(self, count: int, timeout_s: float) -> NDArray[Any]:
        """The first picture after so many; the newest where there are several."""
        endcap = self._connected()
        with self._changed:
            self._changed.wait_for(lambda: self._count > count or self._ended, timeout_s)
            seen, now = self._seen, self._count
        if seen is None or now <= count:
            ended = "has ended" if self._ended else f"gave no picture in {timeout_s:g} s"
            raise TimeoutError(f"{self} {ended}{_why(endcap)}")
        self._given = now
        return self._picture(seen)

    def _picture(self, reading: EndcapReading) -> NDArray[Any]:
        try:
            picture: NDArray[Any] = cv2.cvtColor(decode_bgr(reading.frame), cv2.COLOR_BGR2RGB)
        except FrameError as error:
            raise TimeoutError(f"{self}: {error}") from None
        height, width = picture.shape[:2]
        asked = (self.config.width or width, self.config.height or height)
        if asked != (width, height):
            raise RuntimeError(f"{self}: picture of {width}x{height} px, configured {asked[0]}x{asked[1]}: correct it")
        self.width, self.height = width, height
        return picture


def wrench_feature_types(name: str) -> dict[str, type]:
    """What :func:`wrench_features` gives, for a robot's ``observation_features``; ``name`` begins every key."""
    keys = (*WRENCH, *(f"{key}_sd" for key in WRENCH), "touching", "flagged", "valid")
    return {f"{name}.{key}": float for key in keys}


def wrench_features(camera: EndcapCamera, name: str) -> dict[str, float]:
    """The newest wrench, its standard deviations and contact as numbers for a robot's observation.

    ``valid`` is 1 where they count, else 0, and all others but ``flagged`` (1 where there are flags) are NaN.
    """
    wrench, touching = camera.wrench, camera.touching
    numbers = np.concatenate([wrench.force_n, wrench.torque_nm])
    variances = wrench.covariance.diagonal()
    deviations = np.sqrt(np.where(variances >= 0, variances, np.nan))
    contact = float("nan") if touching is None else float(touching)
    valid = float(np.isfinite(numbers).all())
    values = [*numbers, *deviations, contact, float(bool(wrench.flags)), valid]
    return dict(zip(wrench_feature_types(name), map(float, values), strict=True))


def _why(endcap: Endcap) -> str:
    health = endcap.health
    return f" ({health.status}{health.message and ': '}{health.message})"
