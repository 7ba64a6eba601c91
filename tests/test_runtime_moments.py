"""The computer's start, by which times of the monotonic clock can be compared, and their time of day."""

from datetime import UTC, datetime

import pytest

from grabberd import runtime


@pytest.fixture
def unread(monkeypatch):
    """Nothing is cached before or after."""
    monkeypatch.delenv(runtime.BOOT_ID_VARIABLE, raising=False)
    runtime.boot_id.cache_clear()
    yield monkeypatch
    runtime.boot_id.cache_clear()


def test_the_boot_id_is_the_kernels(unread, tmp_path):
    unread.setattr(runtime, "BOOT_ID_FILE", tmp_path / "boot_id")
    (tmp_path / "boot_id").write_text("7f9c2ba4-e88f-827d-6160-45507605853e\n")
    assert runtime.boot_id() == "7f9c2ba4e88f827d616045507605853e"


def test_in_a_sandbox_that_hides_it_the_unit_tells_it(unread, tmp_path):
    unread.setattr(runtime, "BOOT_ID_FILE", tmp_path / "hidden")
    unread.setenv(runtime.BOOT_ID_VARIABLE, "7f9c2ba4e88f827d616045507605853e")
    assert runtime.boot_id() == "7f9c2ba4e88f827d616045507605853e"


def test_where_nobody_tells_it_it_is_unknown(unread, tmp_path):
    unread.setattr(runtime, "BOOT_ID_FILE", tmp_path / "hidden")
    assert runtime.boot_id() == ""


def test_now_is_the_present_moment_of_this_start():
    now = runtime.Now.by_the_system()
    assert now.ns <= runtime.SystemClock().now_ns()
    assert now.boot_id == runtime.boot_id()


class Stopped:
    """Five seconds after the computer's start it is ten seconds past midnight."""

    def now_ns(self):
        return 5_000_000_000

    def utc_now(self):
        return datetime(1970, 1, 1, 0, 0, 10, tzinfo=UTC)


def test_a_time_of_the_monotonic_clock_has_a_time_of_day():
    assert runtime.iso_utc(runtime.utc_of(Stopped(), 4_000_000_000)) == "1970-01-01T00:00:09.000Z"
    assert runtime.utc_us(Stopped(), 6_000_001_000) == 11_000_001
