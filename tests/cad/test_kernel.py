"""The CAD kernel loads without scikit-learn, and what build123d needs that library for still works."""

from __future__ import annotations

import subprocess
import sys

import pytest

NOT_LOADED = "import sys; assert not [name for name in sys.modules if name.split('.')[0] == 'sklearn']"
CLUSTERS = (
    "from build123d import brep_from_stl as b; "
    "assert list(b.DBSCAN(eps=1.0, min_samples=1).fit([[0.0], [0.5], [9.0]]).labels_) == [0, 0, 1]; "
    "import sklearn.cluster; assert sklearn.cluster.DBSCAN is type(b.DBSCAN())"
)
LOAD = "from cad.kernel import load_kernel; load_kernel()"


@pytest.mark.parametrize(
    "code",
    [
        f"{LOAD}; {NOT_LOADED}; {CLUSTERS}",
        f"from fab.molds import load_libraries; load_libraries(lambda _: None); {NOT_LOADED}",
        f"import sklearn.cluster; {LOAD}; from build123d import brep_from_stl as b; "
        "assert b.DBSCAN is sklearn.cluster.DBSCAN",
        f"import build123d; {LOAD}; {CLUSTERS.partition('; import')[0]}",
    ],
)
def test_the_kernel_loads_without_scikit_learn_unless_that_is_there(code):
    heard = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert heard.returncode == 0, heard.stderr
