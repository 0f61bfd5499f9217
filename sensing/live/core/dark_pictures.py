"""Pictures that are no reference because darkness hides dots, as the first ones of a camera that settles its exposure.

    dark = DarkPictures()
    dark.require_brighter(zero.image)       # at once, without a look at the dots: they take a second
    dark.require_light(check, zero.image)   # once they are known

Forces against such a picture were off by 20 N under 19 N; the next one may be good.
"""

from __future__ import annotations

from sensing.calibration.rest_picture import DARK, DOTS_MISSING
from sensing.camera.light import light_of
from sensing.live.core.camera_check import FLAG as CAMERA_MISFIT
from sensing.live.core.camera_check import CameraCheck
from sensing.records import Image
from sensing.tracking.zero import ZeroError

BRIGHTER = 1.1  # than the picture that was refused: such a one is looked at again
AGAIN = 30  # so is every thirtieth: a hand may have gone that was no darker than the silicone


class DarkPictures:
    """Of one endcap, in order."""

    def __init__(self) -> None:
        self._reason, self._gray, self._passed = "", 0.0, 0

    def require_brighter(self, image: Image) -> None:
        """Refuse a picture as dark as the one that was refused before.

        Args:
            image: (h, w) or (h, w, 3) of a reference to be.

        Raises:
            ZeroError: it is.
        """
        if not self._reason:
            return
        self._passed = (self._passed + 1) % AGAIN
        if self._passed and light_of(image).median_gray < BRIGHTER * self._gray:
            raise ZeroError(self._reason)

    def require_light(self, check: CameraCheck | None, image: Image) -> None:
        """Refuse a dark picture that lacks dots or fits no camera.

        Args:
            check: of the picture; None for methods without dots, which pass.
            image: the picture.

        Raises:
            ZeroError: with what is wrong.
        """
        self._reason = ""
        if check is not None and DARK in check.flags and check.flags & {DOTS_MISSING, CAMERA_MISFIT}:
            self._reason, self._gray, self._passed = check.reason, light_of(image).median_gray, 0
            raise ZeroError(self._reason)
