"""The version that commands and manifests state."""

from importlib import metadata

import cad


def test_a_checkout_without_an_installed_toolkit_says_so(monkeypatch):
    """Libraries can be installed alone: ``make molds`` would end in a traceback at its last file."""
    assert cad.__version__ == metadata.version("endcap-toolkit")

    def absent(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", absent)
    assert cad.__version__ == "not installed"
