"""The weights that a recording carries: of every endcap those that answered."""

from dataclasses import replace

from cad.materials import DEFAULT_SILICONE
from sensing.live.core.config import LiveConfig
from sensing.live.core.endcap_config import EndcapConfig
from sensing.live.core.model import weights_in_use
from sensing.live.open_endcaps import configured_models
from sensing.live.outputs.mcap.config import about, carried_files, parsed


def test_every_endcap_is_replayed_with_the_weights_it_had(tmp_path, monkeypatch):
    """Two sizes, and an endcap that was weighed although weights of its silicone are there."""
    folder, other = tmp_path / "weights", "Dragon Skin 30"
    folder.mkdir()
    monkeypatch.setattr(
        "sensing.live.core.model.find_weights", lambda params, silicone: folder / f"{params.label}{silicone}"
    )
    small = EndcapConfig("small", "test", diameter_mm=117.4, wall_mm=7.6)
    cast = EndcapConfig("cast", "test", silicone=other)
    config = LiveConfig((small, cast, replace(cast, name="weighed", gain=0.6)))
    wanted = {"small": DEFAULT_SILICONE, "cast": other, "weighed": DEFAULT_SILICONE}
    for endcap in config.endcaps:
        (folder / f"{endcap.params.label}{wanted[endcap.name]}").write_bytes(endcap.name.encode())
    files = carried_files(config)
    for file in folder.iterdir():
        file.unlink()
    again = parsed(about(config, files), tmp_path / "x.mcap").with_files({f.name: f.data for f in files}, tmp_path)
    assert [weights_in_use(again, endcap).read_bytes().decode() for endcap in again.endcaps] == list(wanted)
    loaded = []
    monkeypatch.setattr("sensing.live.open_endcaps.load_model", lambda *given: loaded.append(given[2].read_bytes()))
    for endcap in again.endcaps:
        configured_models(again)(endcap)
    assert [data.decode() for data in loaded] == list(wanted)
