"""What the renderer's command says of files that are not what it needs."""

import numpy as np
import pytest

from sensing.simulator.render.cli import main


@pytest.mark.parametrize("data", [b"", b"text", b"PK\x03\x04", "an array alone"])
def test_a_displacement_that_is_none_gets_one_line(data, tmp_path, capsys):
    path = tmp_path / "field.npz"
    if isinstance(data, str):
        with path.open("wb") as stream:
            np.save(stream, np.zeros(3))
    else:
        path.write_bytes(data)
    assert main(["--displacement", str(path), "--out", str(tmp_path / "frame.png")]) == 2
    said = capsys.readouterr().err
    assert "need arrays surface_mm and displacement_mm" in said and said.count("\n") == 1
