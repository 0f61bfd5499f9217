"""The survey of sizes: what its list holds, and that a run goes on where the last one ended."""

from __future__ import annotations

import csv
import math
import os
import re
import time
from concurrent.futures import Future
from datetime import date
from pathlib import Path

import pytest

from bench import bench_sizes, sizes
from cad.feasible import diameter_range_mm, wall_range_mm
from cad.pattern import GYROID_RANGE, LEAST_BRIDGE_MM, pitch_mm
from fab.checks.check import Check


def test_the_list_lies_in_the_valid_region_and_covers_it():
    listed = sizes.survey()
    low, high = diameter_range_mm()
    assert all(low <= size.diameter_mm <= high for size in listed)
    for size in listed:
        thin, thick = wall_range_mm(size.diameter_mm)
        assert thin <= size.wall_mm <= thick
    randoms = [size for size in listed if size.kind == "random"]
    assert len(randoms) == len(set(randoms)) == sizes.RANDOM_SIZES
    assert min(size.diameter_mm for size in randoms) < low + 2 and max(size.diameter_mm for size in randoms) > high - 2
    assert {(200.0, 10.0), (250.0, 12.0), (190.0, 10.0)} <= {(s.diameter_mm, s.wall_mm) for s in listed}


def test_sizes_of_a_day_repeat_and_those_of_another_day_differ():
    first, again = (sizes.random_sizes(date(2026, 11, 22).toordinal(), 3) for _ in range(2))
    assert first == again
    assert first != sizes.random_sizes(date(2026, 11, 23).toordinal(), 3)


def test_the_digest_covers_what_is_made_and_checked():
    paths = {path.relative_to(sizes.ROOT).as_posix() for pattern in sizes.CODE for path in sizes.ROOT.glob(pattern)}
    assert {
        "cad/materials.csv",
        "cad/mold/core.py",
        "fab/design.py",
        "fab/checks/gates.py",
        "fab/steps/cast.py",
    } <= paths
    assert all(any(sizes.ROOT.glob(pattern)) for pattern in sizes.CODE)  # no pattern is left over from a move


def test_every_row_is_of_this_code_or_of_older_code_that_is_known_to_make_the_same():
    codes = {row["code"] for row in bench_sizes._newest()}
    strange = codes - sizes.older_digests() - {sizes.code_digest()}
    assert not strange, (
        f"rows of {sorted(strange)}: add that code to {sizes.OLDER_CODE.name} with what changed since, why it does not "
        "reach these sizes, or make them again: python bench/bench_sizes.py"
    )
    with sizes.OLDER_CODE.open(newline="", encoding="utf-8") as stream:
        assert all(all(row.values()) for row in csv.DictReader(stream))  # each states both, or "nothing" with a reason


def test_a_run_goes_on_where_the_last_one_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(bench_sizes, "TABLE", tmp_path / "sizes.csv")
    some = [
        sizes.Size("round", 130.0, 8.0),
        sizes.Size("round", 200.0, 10.0),
        sizes.Size("clearance", 130.0, 8.0, 0.05),
    ]
    monkeypatch.setattr(bench_sizes, "survey", lambda: some)
    assert bench_sizes._open_sizes("code", None) == some
    bench_sizes._append(sizes.Made(some[0], (), 236, 80.0), "code")
    bench_sizes._append(sizes.Made(some[1], ("cavity.wall_error_mm = 0.067, wanted <= 0.02",), 236, 80.0), "older")
    assert bench_sizes._open_sizes("code", None) == some[1:]  # what other code made is made again
    assert bench_sizes._open_sizes("code", "clearance") == some[2:]
    bench_sizes._append(sizes.Made(some[1], (), 236, 80.0), "code")
    newest = bench_sizes._newest()
    assert [(row["D_mm"], row["failed"]) for row in newest] == [("130", ""), ("200", "")]
    with (tmp_path / "sizes.csv").open(newline="") as stream:
        assert len(list(csv.reader(stream))) == 4


def test_a_size_that_cannot_be_made_is_a_failure_with_its_reason_and_not_the_end(monkeypatch):
    made = sizes.make(sizes.Size("named", 300.0, 10.0))
    assert made.checks == 0 and "outside" in made.failed[0]


@pytest.mark.parametrize(
    "text",
    ["130", "130/x", "1/2/3/4", "300/10", "130/8/0.5", "130/8/dots=1-99-6", "130/8/ink=red", "130/8/gyroid=x"],
)
def test_a_size_of_your_own_is_refused_in_one_line(text, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["bench_sizes.py", "--size", text])
    with pytest.raises(SystemExit) as ended:
        bench_sizes.main()
    assert ended.value.code == 2 and "error: argument --size" in capsys.readouterr().err


def test_a_size_of_your_own_has_options_as_they_are_typed():
    size = bench_sizes._named("195.5/18.13/dots=1-6-23/dot_mm=6.2/gyroid=0.109")
    assert size.key == ("195.5", "18.13", "0.15", "dots=1-6-23 dot_mm=6.2 gyroid=0.109")
    assert bench_sizes._named("130/8/0.05").key == ("130", "8", "0.05", "")


def test_a_size_of_the_list_keeps_its_kind_when_it_is_named():
    assert bench_sizes._named("200/10").kind == "round"
    assert bench_sizes._named("200/10.01").kind == "named"


def test_sizes_with_options_are_valid_and_use_the_whole_range_of_each():
    listed = sizes.option_sizes()
    assert len(listed) == len({size.key for size in listed}) == 100
    params = [size.params for size in listed]  # raises where one is refused
    assert min(p.dot_mm for p in params) < 3.1 and max(p.dot_mm for p in params) > 7.8
    assert min(len(p.dot_rings) for p in params) == 3 and max(len(p.dot_rings) for p in params) == 12
    low, high = GYROID_RANGE
    assert min(p.gyroid for p in params) < low + 0.002 and max(p.gyroid for p in params) > high - 0.002
    pitches = [pitch_mm(p.inner_radius_mm, p.dot_rings) - p.dot_mm for p in params]
    assert min(pitches) < LEAST_BRIDGE_MM + 0.1


def test_the_used_share_of_a_limit_is_that_of_the_piece_nearest_to_it():
    checks = [
        Check("core_key_1.way_out_gap_mm", 0.2, low=0.05),
        Check("core_key_2.way_out_gap_mm", 0.1, low=0.05),
        Check("cavity.leak_ratio", 0.009, high=0.01),
        Check("base.watertight", 1, low=1),
    ]
    assert sizes.used_shares(checks) == pytest.approx({"way_out_gap_mm": 0.5, "leak_ratio": 0.9})
    failed = Check("gyroid.ball_covered_share", 0.0, low=0.8)
    assert not failed.ok and sizes.used_shares([failed])["ball_covered_share"] > 1


def test_the_shares_are_drawn_where_rows_have_them(tmp_path, monkeypatch):
    monkeypatch.setattr(bench_sizes, "HERE", tmp_path)
    monkeypatch.setattr(bench_sizes, "TABLE", tmp_path / "sizes.csv")
    bench_sizes._append(sizes.Made(sizes.Size("round", 130.0, 8.0), (), 306, 80.0), "older")
    bench_sizes._draw_used(bench_sizes._newest())
    assert not (tmp_path / "sizes_used.png").exists()
    bench_sizes._append(sizes.Made(sizes.Size("round", 150.0, 8.0), (), 306, 80.0, {sizes.WATCHED[0]: 0.4}), "code")
    bench_sizes._draw_used(bench_sizes._newest())
    assert (tmp_path / "sizes_used.png").stat().st_size > 5000


def test_the_document_states_what_the_table_holds():
    rows = bench_sizes._newest()
    text = " ".join((sizes.ROOT / "docs" / "sizes.md").read_text().split())
    made, failed = map(int, re.search(r"\*\*(\d+) sizes have been made, (\d+) of them fails?\*\*", text).groups())
    assert (made, failed) == (len(rows), sum(bool(row["failed"]) for row in rows))
    words = {"edge": "on edges", "random": "at random", "round": "round ones", "clearance": "with clearances"}
    words |= {"options": "with dots", "named": "that were named"}
    for kind, said in words.items():
        stated = int(re.search(rf"(\d+) {said}", text)[1])
        assert stated == sum(row["kind"] == kind for row in rows), kind


def _core_after(file: str) -> set[int]:
    """The cores on which this process may run, once the file is there."""
    while not Path(file).exists():
        time.sleep(0.01)
    return set(os.sched_getaffinity(0))


@pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2, reason="two cores are needed"
)
def test_a_worker_that_follows_another_takes_its_core(tmp_path, monkeypatch):
    monkeypatch.setattr(bench_sizes, "make", _core_after)
    monkeypatch.setattr(bench_sizes, "TASKS_A_WORKER", 1)  # a new process for each
    later = tmp_path / "later"
    cores = bench_sizes._made([str(later), *[str(tmp_path)] * 3], 2, math.inf)
    others = [next(cores) for _ in range(3)]
    later.touch()
    (long,) = cores
    assert len(long) == 1 and all(len(each) == 1 and each != long for each in others)


def test_work_done_in_this_process_keeps_its_result_or_its_error():
    done: Future[float] = sizes.Inline().submit(max, 1.0, 2.0)
    assert done.result() == 2.0
    with pytest.raises(ZeroDivisionError):
        sizes.Inline().submit(lambda: 1 / 0).result()


def test_a_failure_of_the_day_names_the_command_that_makes_it_again(capsys, monkeypatch):
    def fail_the_second(listed, workers, seconds):
        for number, size in enumerate(listed):
            yield sizes.Made(size, ("cavity.wall_error_mm = 0.067, wanted <= 0.02",) * (number == 1), 236, 80.0)

    monkeypatch.setattr(bench_sizes, "_made", fail_the_second)
    assert bench_sizes._today(3, date(2026, 11, 22), 2) == 1
    heard = capsys.readouterr()
    assert heard.out.count("passed") == 2 and "wall_error" in heard.out
    assert "--today 3 --date 2026-11-22" in heard.err
    assert bench_sizes._today(1, date(2026, 11, 22), 2) == 0
    assert "dots=" in capsys.readouterr().out
