"""Measures contact with an endcap: camera frames to shear fields, wrenches and contacts; and simulates the endcap.

Data flow: frame (:mod:`sensing.sources`) -> dot tracks and shear field (:mod:`sensing.tracking`) -> wrench and contact
(:mod:`sensing.wrench`) -> reading of a running endcap (:mod:`sensing.live`). The records between these stages are in
:mod:`sensing.records`, coordinate frames and signs in :mod:`sensing.frames`. Of ``cad``, only the bottom layer is
imported, which needs the standard library alone.
"""

import os
import sys

from cad.extras import extra_of_command, prepare_command, program, started_module

prepare_command()
if program("") or extra_of_command(started_module(sys.orig_argv)):  # the process is a command's, not a user's program
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")  # its errors are one line, without OpenCV's warnings
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # and without any line of FFmpeg's
