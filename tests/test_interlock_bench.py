"""What the weighed interlock was pressed with is what its own bench found of the unit cell."""

import csv

from bench import bench_interlock_weighed as bench


def test_the_stiffness_that_is_weighed_is_that_of_the_finest_cell():
    with (bench.HERE / "interlock_weighed.csv").open(newline="") as stream:
        published = {float(row["stiffer"]) for row in csv.DictReader(stream)}
    assert published == {bench.stiffer()}
