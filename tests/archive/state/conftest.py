"""Three captures, for the tests of what is known of many."""

import pytest

from archive.captures import slots, write


@pytest.fixture
def archive(tmp_path):
    for day in (3, 1, 2):
        write(tmp_path, slots(2), name=f"c{day}", id=f"c{day}", created_utc=f"2026-03-0{day}T09:00:00.000Z")
    return tmp_path
