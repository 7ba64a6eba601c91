"""Intervals of a study cover, and false alarms are as rare as they are said to be."""

import pytest

from proofs.bench.study_coverage import CASES, Case, counted


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("common", [0.0, 0.5])
def test_intervals_cover_and_alarms_are_rare(case: Case, common: float) -> None:
    found = counted(case, (3, 3), common, 120)
    assert found.differences > 0.9
    assert found.means > 0.88
    assert found.false_alarms < 0.1
