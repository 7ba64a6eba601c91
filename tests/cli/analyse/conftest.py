"""Captures to analyse, which no test changes."""

from pathlib import Path

import pytest

from archive.milkings import milking
from core.chain.milking import field, still


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if matplotlib were not installed."""
    monkeypatch.setattr("grabberd.reports.figures.drawing.find_spec", lambda name: None)


@pytest.fixture(scope="session")
def resting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of three fields of the open liner."""
    return milking(tmp_path_factory.mktemp("resting"), still(3), note="first milking")


@pytest.fixture(scope="session")
def pulsating(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A capture of more than a cycle, with two fields missing."""
    fields = [field(n) for n in range(52) if n not in {20, 21}]
    return milking(tmp_path_factory.mktemp("pulsating"), fields)
