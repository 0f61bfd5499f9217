"""The bench that computes how long `make molds` takes on more cores: schedules with known ends."""

from __future__ import annotations

import pytest

from bench.bench_molds_cores import Timed, Work, wall_s

FOUR = Work([1.0, 1.0, 1.0, 3.0], [("submit", job) for job in range(4)] + [("run", 2.0), ("wait", 3)])


@pytest.mark.parametrize(
    ("cores", "workers", "seconds"),
    [
        (8, 4, 3.0),  # the longest job
        (8, 2, 4.0),  # it starts when the first two are done
        (8, 1, 6.0),  # all jobs, one after the other
        (1, 4, 8.0),  # all that there is to do, by one core
        (2, 2, 5.0),  # three share two cores for 3 s, then the longest has 2 s left and a core to itself
    ],
)
def test_jobs_end_where_they_must(cores, workers, seconds):
    assert wall_s(FOUR, cores, workers) == pytest.approx(seconds)


def test_the_command_waits_for_a_job_before_it_goes_on():
    work = Work([5.0, 1.0], [("submit", 0), ("wait", 0), ("run", 1.0), ("submit", 1), ("run", 0.5), ("wait", 1)])
    assert wall_s(work, 4, 2) == pytest.approx(7.0)


def test_jobs_that_are_run_at_once_are_noted_in_their_order():
    work = Work()
    timed = Timed(work)
    jobs = [timed.submit(pow, 2, n) for n in range(3)]
    assert [job.result() for job in reversed(jobs)] == [1 << n for n in (2, 1, 0)]
    kinds = [act for act in work.acts if act[0] != "run"]
    assert kinds == [("submit", 0), ("submit", 1), ("submit", 2), ("wait", 2), ("wait", 1), ("wait", 0)]
    assert len(work.job_s) == 3
