"""The table of own weight: a place that cannot be written is refused before a minute is spent."""

from sensing.simulator.solid import own_weight_table


def test_a_place_that_is_not_there_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(own_weight_table, "rows_of", lambda *_: [])
    assert own_weight_table.main(["--out", str(tmp_path / "none" / "table.csv")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 + said.count("\nD=") and "none/table.csv: " in said
