"""The work of a first reference: a robot waits for it at every start, so nothing is found or cut twice."""

from live_stand_in import film, frames, pipeline

from sensing.live.core import reference
from sensing.tracking import recovery, tracker, zero


def test_each_picture_of_a_reference_is_searched_and_cut_once(monkeypatch):
    """One search for the interval's first picture and one for the average; windows of both, and those for jumps."""
    counts = {"find_dots": 0, "cut_patches": 0}

    def counted(module, name):
        work = getattr(module, name)

        def call(*args, **more):
            counts[name] += 1
            return work(*args, **more)

        monkeypatch.setattr(module, name, call)

    for module in (tracker, zero, reference):
        counted(module, "find_dots")
    for module in (tracker, recovery):
        counted(module, "cut_patches")
    pipe = pipeline("endcap_0", 0, zero_frames=3)
    request = pipe.taker._request
    request.frames[:] = frames(film([0] * 3))
    made = pipe.taker._checked(request, None)
    assert len(made.method.tracker.dots) < len(made.method.tracker.found)  # some were left out, and not cut anew
    assert counts == {"find_dots": 2, "cut_patches": 3}
    assert "cells" not in vars(made.method.tracker.operator)  # a tracker needs no field
