"""A few of the hard cases, on the coarsest mesh; the report runs them all."""

import pytest

from sensing.simulator.press.press import Target
from sensing.simulator.verification.hard_cases import CASES, HardCase, run_case

EXPECTED = {
    "grazing contact, 1e-3 mm": "converged",
    "tiny load, 1e-3 N": "converged",
    "zero load": "converged",
    "35 N in one step": "converged",
    "pulling": "refused: range",
    "too deep for the model": "refused: range",
    "sharp edge, radius 1 mm": "refused: mesh",
    "small bump, radius 3 mm, light": "refused: mesh",
    "edge, radius 8 mm": "converged",
    "on the clamped rim (D 99, tilt 95)": "refused: range",
}


@pytest.mark.parametrize("case", [case for case in CASES if case.name in EXPECTED], ids=lambda case: case.name)
def test_hard_cases_end_as_they_should(case: HardCase) -> None:
    outcome = run_case(case, "draft")
    assert outcome.verdict == EXPECTED[case.name]
    assert "-0.000 N" not in outcome.detail  # no contact is 0 N, without a sign


def test_a_certificate_that_does_not_hold_is_called_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sensing.simulator.verification.hard_cases.RESIDUAL_LIMIT", 0.0)
    outcome = run_case(HardCase("any", (Target(normal_n=2.0),)), "draft")
    assert not outcome.sound and outcome.verdict.startswith("WRONG: residual")
