"""How long the tests of each file took last, kept in pytest's cache for `make test-affected`.

Slow tests are not counted: it leaves them out.
"""

import json
from collections import Counter
from pathlib import Path

import pytest

KEY = "affected/seconds"


class Durations:
    """A plugin that adds up what is reported; of several processes, only the one that hears of all tests."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._seconds: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Adds a test's setup, call or teardown to its file."""
        if "slow" not in report.keywords:
            self._seconds[report.nodeid.partition("::")[0]] += report.duration

    def pytest_sessionfinish(self) -> None:
        """Files that were not run now keep what they took before."""
        known = self._config.cache.get(KEY, {})  # type: ignore[union-attr]
        rounded = {file: round(seconds, 2) for file, seconds in self._seconds.items()}
        self._config.cache.set(KEY, known | rounded)  # type: ignore[union-attr]


def recorded(root: Path) -> dict[str, float]:
    """Seconds by test file; empty before the first run."""
    file = root / ".pytest_cache" / "v" / KEY
    seconds: dict[str, float] = json.loads(file.read_text()) if file.exists() else {}
    return seconds
