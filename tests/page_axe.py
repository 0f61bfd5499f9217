"""axe-core on a page: what the browser's tests of all pages share."""

from __future__ import annotations

import importlib.resources
import os
from pathlib import Path

import pytest

VIOLATIONS = """axe.run(document, {resultTypes: ["violations"]}).then((found) => found.violations.flatMap((v) =>
  v.nodes.map((node) => v.id + ": " + node.html.slice(0, 120) + " " + (node.any[0] || node.none[0] || {}).message)))"""


def axe() -> str:
    """axe-core (MPL-2.0): of the file named by AXE_CORE, or of the package axe-core-python."""
    if path := os.environ.get("AXE_CORE"):
        return Path(path).read_text(encoding="utf-8")
    package = pytest.importorskip("axe_core_python")
    return (importlib.resources.files(package) / "axe.min.js").read_text(encoding="utf-8")
