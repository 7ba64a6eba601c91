"""What tests of the service share."""

from collections.abc import Iterator

import pytest

from grabberd.work.own_process import OwnProcesses


@pytest.fixture
def processes() -> Iterator[OwnProcesses]:
    """Those of one test."""
    own = OwnProcesses()
    yield own
    own.end()
