"""All scenarios are played once, side by side; each test then looks at one of them."""

from pathlib import Path

import pytest

from .playing import play_all
from .scenario import all_of
from .suffering import Suffered


@pytest.fixture(scope="session")
def suffered(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Suffered]:
    """What became of every scenario."""
    folder: Path = tmp_path_factory.mktemp("faults")
    return play_all(all_of(), folder)
