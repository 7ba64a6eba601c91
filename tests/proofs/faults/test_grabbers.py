"""Every fault of a grabber, in mid-capture, through the whole daemon: seen, accounted for, recovered from."""

import pytest

from .judging import problems_of
from .scenario import Scenario, all_of
from .suffering import Suffered

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.mark.parametrize("scenario", all_of(), ids=lambda scenario: scenario.name)
def test_a_fault_is_what_its_scenario_says(scenario: Scenario, suffered: dict[str, Suffered]) -> None:
    assert problems_of(scenario, suffered[scenario.name]) == []
