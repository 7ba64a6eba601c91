"""Events of a device: what has changed from one answer of the daemon to the next."""

from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, NamedTuple

from grabberd.core.field import PAL_HZ

UNENDED = ("armed", "recording", "sealing")
NOT_RECEIVED = ("lost", "damaged", "no_signal", "overrun")
_HEALTH = ("level", "part", "word", "message", "hint")


class Event(NamedTuple):
    """An event.

    Attributes:
        name: Kind of event.
        details: What there is to say about it, for JSON.
        utc: Time at which it happened; None: just now.
    """

    name: str
    details: Mapping[str, Any]
    utc: datetime | None = None


class DeviceEvents:
    """The events of one device; what is already so at the beginning is no event, except its health."""

    def __init__(self) -> None:
        self._health: dict[str, Any] | None = None
        self._fields: Mapping[str, int] | None = None
        self._rate_hz = PAL_HZ
        self._ended: set[str] | None = None
        self._started: set[str] = set()

    def of_state(self, device: Mapping[str, Any]) -> Iterator[Event]:
        """Changes of health, and fields that were not received.

        Args:
            device: The device in the state of the daemon.
        """
        self._rate_hz = (device["stream"] or {}).get("rate_hz", self._rate_hz)
        told = device["health"]
        word = told["parts"][told["part"]]["word"] if told["part"] else None
        health = {key: word if key == "word" else told[key] for key in _HEALTH}
        # A message has values that change all the time: alone, it is no event.
        if self._health is None or any(health[key] != self._health[key] for key in ("level", "part", "word")):
            yield Event("health", health)
        self._health = health
        yield from self._not_received(device["fields"])

    def repeat_health(self) -> None:
        """Has the next state tell the health, whether or not it has changed."""
        self._health = None

    def of_captures(self, captures: Sequence[Mapping[str, Any]]) -> Iterator[Event]:
        """Captures that have started or ended since the last call.

        Args:
            captures: The newest captures, the newest first.
        """
        ended = {one["id"] for one in captures if one["state"] not in UNENDED}
        if self._ended is None:
            self._ended = ended
        for one in reversed(captures):
            if one["id"] in self._ended:
                continue
            if one["first_field_s"] is not None and one["id"] not in self._started:
                self._started.add(one["id"])
                yield Event("capture_started", _start_of(one), _first_field(one))
            if one["id"] in ended:
                yield Event("capture_ended", _end_of(one), self._end(one))
        listed = {one["id"] for one in captures}
        self._started &= listed
        self._ended = ended

    def _not_received(self, fields: Mapping[str, int]) -> Iterator[Event]:
        before = self._fields or fields
        self._fields = dict(fields)
        more = {outcome: fields[outcome] - before[outcome] for outcome in NOT_RECEIVED}
        # Where the daemon has been started again, it counts from nothing.
        if fields["received"] >= before["received"] and any(more.values()):
            yield Event("fields_not_received", {outcome: n for outcome, n in more.items() if n})

    def _end(self, capture: Mapping[str, Any]) -> datetime | None:
        first = _first_field(capture)
        due = sum(capture["ledger"]["counts"].values())
        return None if first is None else first + timedelta(seconds=due / self._rate_hz)


def _start_of(capture: Mapping[str, Any]) -> dict[str, Any]:
    group = capture["group"]
    return {
        "capture_id": capture["id"],
        "group_id": group["id"] if group else None,
        "labels": capture["labels"],
    }


def _end_of(capture: Mapping[str, Any]) -> dict[str, Any]:
    ledger, coverage = capture["ledger"], capture["coverage"]
    return {
        "capture_id": capture["id"],
        "state": capture["state"],
        "verdict": capture["verdict"],
        "ended_because": capture["ended_because"],
        "ledger": ledger["in_words"],
        "counts": ledger["counts"],
        "coverage_verdict": coverage["verdict"] if coverage else None,
        "coverage": coverage["in_words"] if coverage else None,
    }


def _first_field(capture: Mapping[str, Any]) -> datetime | None:
    if capture["first_field_s"] is None:
        return None
    created = datetime.fromisoformat(capture["created_utc"])
    return created + timedelta(seconds=capture["first_field_s"])
