"""Cameras lose data now and then: a damaged picture in a recording would stop the training on all others."""

import cv2
import numpy as np

from cad.params import EndcapParams
from sensing.decode import decode_gray
from sensing.frames import FtMount
from sensing.record import record
from sensing.recording.folder import Recording
from sensing.recording.ft_streams import CSV_COLUMNS, CsvFt
from sensing.records import Frame
from sensing.records_labelled import LabelledSet
from sensing.sources.drawn import Drawing, draw_dots


def test_damaged_pictures_are_left_out_and_counted(tmp_path):
    whole = cv2.imencode(".jpg", draw_dots(Drawing())[0])[1].tobytes()
    pictures = [whole] * 12
    pictures[1] = pictures[7] = whole[: len(whole) // 2]
    pictures[9] = b"\xff\xd8 and nothing behind it"
    frames = [Frame(k / 30, k, "made", jpeg=jpeg) for k, jpeg in enumerate(pictures)]
    csv = tmp_path / "ft.csv"
    csv.write_text("\n".join([",".join(CSV_COLUMNS), *(f"{k / 100},0,0,0,0,0,0" for k in range(60))]))
    with Recording(tmp_path / "set", EndcapParams(130, 8), FtMount(np.eye(4), 1)) as recording:
        result = record(frames, CsvFt(csv), recording, rest_frames=4)
    assert (result.written, result.damaged) == (5, 3)
    assert [item.frame.sequence for item in LabelledSet(tmp_path / "set").frames()] == [5, 6, 8, 10, 11]
    assert all(decode_gray(item.frame).size for item in LabelledSet(tmp_path / "set").frames())
