"""What the machine and its clients do wrong, done to the whole daemon: nothing recorded is lost."""

from collections.abc import Iterator

import pytest

from .failing import failing_machine
from .machine import Machine
from .playing import FAULTS, play

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def failing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    with failing_machine(tmp_path_factory.mktemp("machine")) as one:
        yield one


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_machine_or_of_a_client_loses_nothing(fault: str, failing: Machine) -> None:
    assert play(fault, failing).problems == ()
