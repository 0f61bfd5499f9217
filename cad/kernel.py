"""Load the CAD kernel's Python side without scikit-learn, a quarter of the time that build123d takes to load.

build123d 0.12 imports scikit-learn for one function, ``detect_primitives``, which recognizes cylinders and spheres in
meshes and which nothing here calls. While build123d loads, a stand-in takes the place of that library; the function
still works, and loads it when it is called.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import Any

NAME, CLUSTER = "sklearn", "sklearn.cluster"


def load_kernel() -> None:
    """Import build123d; whatever imports it later finds it loaded."""
    if "build123d" in sys.modules or NAME in sys.modules:
        importlib.import_module("build123d")
        return
    package, cluster = ModuleType(NAME), ModuleType(CLUSTER)
    cluster.DBSCAN = _dbscan  # type: ignore[attr-defined]
    sys.modules |= {NAME: package, CLUSTER: cluster}
    try:
        importlib.import_module("build123d")
    finally:
        for name, module in ((NAME, package), (CLUSTER, cluster)):
            if sys.modules.get(name) is module:
                del sys.modules[name]


def _dbscan(*args: Any, **options: Any) -> Any:
    """The class of scikit-learn, loaded when it is first called."""
    from sklearn.cluster import DBSCAN

    return DBSCAN(*args, **options)
