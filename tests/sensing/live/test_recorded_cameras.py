"""``camera_info`` in recordings: every picture has the camera of its reference, at its own size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from live_stand_in import PATIENCE_S, film, frames, pipeline

from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.seen import Pictures
from sensing.live.outputs.mcap.recorder import Recorder
from sensing.live.outputs.ros.frames import CamerasInUse

NAME = "endcap_0"


def messages(path: Path, topic: str) -> list:
    """Messages of the endcap, as an independent reader gives them."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return [message for *_, message in reader.iter_decoded_messages([f"/{NAME}/{topic}"])]


@pytest.mark.parametrize(("kind", "scale"), [(Pictures.FULL, 1.0), (Pictures.HALF, 0.5), (Pictures.NONE, None)])
def test_every_recorded_picture_has_the_camera_of_its_size(kind, scale, tmp_path):
    """With the picture's stamp, as ROS's image_proc pairs them."""
    pipe, path = pipeline(), tmp_path / "run.mcap"
    cameras = CamerasInUse([pipe], pytest.fail)
    recorder = Recorder(
        path, LiveConfig((EndcapConfig(NAME, "test"),)), {NAME: -1}, print, pictures=kind, cameras=cameras
    )
    recorder.start()
    for frame in frames(film([0, 0, 0.5, 1.0, 0.5, 0])):
        recorder.put(pipe.update(frame))
    recorder.close(PATIENCE_S)
    infos, images = messages(path, "camera_info"), messages(path, "image/compressed")
    assert len(infos) == len(images) == (0 if scale is None else 6)
    stamps = [
        [(m.header.stamp.sec, m.header.stamp.nanosec, m.header.frame_id) for m in kind] for kind in (infos, images)
    ]
    assert stamps[0] == stamps[1]
    own = pipe.camera(640, 480).camera  # found from the reference: the drawn dome has another lens than the design
    for info in infos:
        assert (info.width, info.height, info.distortion_model) == (640 * scale, 480 * scale, "equidistant")
        assert np.allclose(info.k[:6:4], [own.fx_px * scale, own.fy_px * scale], rtol=1e-12)
        centre = (np.array([own.cx_px, own.cy_px]) + 0.5) * scale - 0.5  # edges of pixels stay edges
        assert np.allclose([info.k[2], info.k[5]], centre, rtol=1e-12) and tuple(info.d) == own.k
