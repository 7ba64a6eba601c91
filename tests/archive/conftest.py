import pytest

from archive.captures import MADE_WITH, META, meta
from grabberd.archive.capture.writer import CaptureWriter


@pytest.fixture
def part(tmp_path):
    return tmp_path / "liner.grab.part"


@pytest.fixture
def writer(part):
    with_run = CaptureWriter.create(part, meta())
    with_run.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    with_run.commit()
    yield with_run
    with_run.close()
