"""The camera doctor on pictures of too few rows, and of another endcap than the one named."""

import cv2
import pytest
from rendered_dome import rendered

from cad.params import EndcapParams
from sensing.doctor.finding import Finding, Verdict
from sensing.doctor.picture import picture_findings
from sensing.records import Image

PARAMS = EndcapParams(142.0, 9.6)


@pytest.fixture(scope="module")
def own() -> Image:
    return rendered(PARAMS, "data")


def findings(picture: Image, params: EndcapParams = PARAMS) -> dict[str, Finding]:
    return {each.name: each for each in picture_findings(picture, params)}


@pytest.mark.parametrize("rows", [120, 180, 230])
def test_of_too_few_rows_the_mode_is_named_and_not_the_lens(own, rows):
    """The rims of a sharp lens are as wide as such pixels: the lens would be turned, or all be called good."""
    found = findings(cv2.resize(own, (rows * 4 // 3, rows), interpolation=cv2.INTER_AREA))
    assert found["size"].verdict is Verdict.BAD and "larger mode" in found["size"].fix and "focus" not in found


def test_240_rows_are_enough(own):
    found = findings(cv2.resize(own, (320, 240), interpolation=cv2.INTER_AREA))
    assert found["size"].verdict is Verdict.GOOD and found["focus"].verdict is Verdict.GOOD


@pytest.mark.parametrize("given", [EndcapParams(120.0, 8.0), EndcapParams(130.0, 8.0), EndcapParams(160.0, 9.6)])
def test_a_picture_of_another_diameter_is_not_called_good(own, given):
    """Without --diameter a dome of 142 mm was good throughout, seen as one of 130; live flagged every reading."""
    found = findings(own, given)["design"]
    assert found.verdict is Verdict.BAD and "another design fits" in found.text and "--diameter" in found.fix
    assert findings(own)["design"].verdict is Verdict.GOOD
