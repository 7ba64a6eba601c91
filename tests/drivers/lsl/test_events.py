"""What has happened between two answers of the daemon."""

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from grabberd.documents.examples import CAPTURE
from grabberd_lsl.outlets import DeviceEvents, Event

RECEIVED = {"received": 100, "lost": 0, "damaged": 0, "no_signal": 0, "overrun": 0}


def device(level: str = "good", part: str | None = None, message: str = "", **fields: int) -> dict[str, Any]:
    parts = {part: {"word": "off"}} if part else {}
    health = {"level": level, "part": part, "message": message, "hint": "", "parts": parts}
    return {"stream": {"rate_hz": 50.0}, "health": health, "fields": {**RECEIVED, **fields}}


def capture(number: int, state: str = "sealed", **changes: Any) -> dict[str, Any]:
    return {**CAPTURE, "id": f"c{number}", "state": state, "first_field_s": 0.01, "group": None, **changes}


def names(events: list[Event]) -> list[str]:
    return [one.name for one in events]


@pytest.fixture
def events() -> DeviceEvents:
    return DeviceEvents()


def test_the_health_is_told_first_and_when_it_changes(events: DeviceEvents) -> None:
    assert [one.details["level"] for one in events.of_state(device())] == ["good"]
    assert not list(events.of_state(device()))
    [bad] = events.of_state(device("bad", "rate", "20 Hz"))
    assert (bad.details["part"], bad.details["word"], bad.details["message"]) == ("rate", "off", "20 Hz")
    assert not list(events.of_state(device("bad", "rate", "21 Hz")))


def test_it_is_told_again_to_who_comes_later(events: DeviceEvents) -> None:
    list(events.of_state(device()))
    events.repeat_health()
    assert names(list(events.of_state(device()))) == ["health"]


def test_fields_that_were_not_received_are_counted(events: DeviceEvents) -> None:
    list(events.of_state(device(lost=5)))
    [lost] = events.of_state(device(lost=8, damaged=1))
    assert (lost.name, lost.details) == ("fields_not_received", {"lost": 3, "damaged": 1})


def test_a_daemon_that_counts_from_nothing_again_has_lost_none(events: DeviceEvents) -> None:
    list(events.of_state(device(lost=5)))
    assert not list(events.of_state(device(received=3, lost=9)))


def test_captures_that_had_ended_before_are_no_news(events: DeviceEvents) -> None:
    assert not list(events.of_captures([capture(2), capture(1)]))


def test_a_capture_starts_with_its_first_field_and_ends_with_its_ledger(events: DeviceEvents) -> None:
    assert not list(events.of_captures([capture(1, "recording", first_field_s=None)]))
    [started] = events.of_captures([capture(1, "recording", labels={"cow": "112"})])
    first = datetime(2026, 3, 1, 9, 30, 0, 135_000, UTC)
    assert (started.name, started.utc, started.details["labels"]) == (
        "capture_started",
        first,
        {"cow": "112"},
    )
    assert not list(events.of_captures([capture(1, "sealing")]))
    [ended] = events.of_captures([capture(1)])
    assert (ended.name, ended.utc) == ("capture_ended", first + timedelta(seconds=64 / 50))
    assert ended.details["verdict"] == "incomplete"
    assert ended.details["counts"]["lost"] == 2
    assert not list(events.of_captures([capture(1)]))


def test_captures_that_came_and_went_between_two_answers_are_told_in_order(events: DeviceEvents) -> None:
    list(events.of_captures([]))
    told = list(events.of_captures([capture(2), capture(1)]))
    assert [(one.name, one.details["capture_id"]) for one in told] == [
        *(("capture_started", "c1"), ("capture_ended", "c1")),
        *(("capture_started", "c2"), ("capture_ended", "c2")),
    ]


def test_a_capture_without_any_field_ends_now(events: DeviceEvents) -> None:
    list(events.of_captures([capture(1, "armed", first_field_s=None)]))
    [ended] = events.of_captures([capture(1, first_field_s=None)])
    assert (ended.name, ended.utc) == ("capture_ended", None)
