"""The computer's start, by which times of the monotonic clock can be compared."""

import pytest

from grabberd import clock


@pytest.fixture
def unread(monkeypatch):
    """Nothing is cached before or after."""
    monkeypatch.delenv(clock.BOOT_ID_VARIABLE, raising=False)
    clock.boot_id.cache_clear()
    yield monkeypatch
    clock.boot_id.cache_clear()


def test_the_boot_id_is_the_kernels(unread, tmp_path):
    unread.setattr(clock, "BOOT_ID_FILE", tmp_path / "boot_id")
    (tmp_path / "boot_id").write_text("7f9c2ba4-e88f-827d-6160-45507605853e\n")
    assert clock.boot_id() == "7f9c2ba4e88f827d616045507605853e"


def test_in_a_sandbox_that_hides_it_the_unit_tells_it(unread, tmp_path):
    unread.setattr(clock, "BOOT_ID_FILE", tmp_path / "hidden")
    unread.setenv(clock.BOOT_ID_VARIABLE, "7f9c2ba4e88f827d616045507605853e")
    assert clock.boot_id() == "7f9c2ba4e88f827d616045507605853e"


def test_where_nobody_tells_it_it_is_unknown(unread, tmp_path):
    unread.setattr(clock, "BOOT_ID_FILE", tmp_path / "hidden")
    assert clock.boot_id() == ""


def test_now_is_the_present_moment_of_this_start():
    now = clock.Now.by_the_system()
    assert now.ns <= clock.SystemClock().now_ns()
    assert now.boot_id == clock.boot_id()
