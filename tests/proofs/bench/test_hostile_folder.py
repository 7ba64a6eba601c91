"""The proof of the hostile folder, with a small one: it measures what it says."""

from pathlib import Path

import pytest

from .hostile_folder import made, weighed

MOST_MB = 200.0


@pytest.mark.slow
def test_a_folder_of_heavy_captures_costs_little_memory_and_no_answer_its_end(tmp_path: Path) -> None:
    made(tmp_path / "hostile", long=1, entries=20_000)
    found = weighed(tmp_path / "daemon", tmp_path / "hostile", 3.0)
    assert found.tracebacks == 0
    assert found.over_mb < MOST_MB
    assert set(found.answers) <= {200, 404, 410, 503}
    assert found.answers[200] > 0
