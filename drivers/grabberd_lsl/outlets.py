"""The streams of one device on the Lab Streaming Layer, their channels, and the clock that dates them.

LSL's own threads send what is pushed; for an inlet that is slow they keep a minute and drop the oldest. So
nobody waits here, and the daemon knows nothing of inlets at all. A stream of points has six channels for each
target of the object model, always in its sequence.

Events of a device: what has changed from one answer of the daemon to the next.
"""

import hashlib
import json
import math
import platform
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from grabberd import __version__
from grabberd.archive.capture.encodings import PER_MM, rounded
from grabberd.client.daemon import UNENDED
from grabberd.client.points_stream import StreamedPoints
from grabberd.core.field import PAL_HZ
from grabberd.documents.points_frame import PointsFrame
from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
    import pylsl

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


TRIALS = 9
"""The clocks are read so often; the reading that took the shortest time counts."""
SAME_NS = 10_000_000
"""On one computer, UTC and the monotonic clock differ by the same for everybody, to well within this.

On two computers they do so only if both were started within this time of each other."""


class Relation(NamedTuple):
    """LSL's clock as seen by another one.

    Attributes:
        offset_ns: To be added to the other clock's time.
        error_ns: The most by which that is wrong.
    """

    offset_ns: int
    error_ns: int


class LslClock:
    """Relates the clocks of this computer to LSL's `local_clock`.

    On Linux that is CLOCK_MONOTONIC itself. It is measured nevertheless, because LSL promises it nowhere;
    where no difference can be measured, there is none, and times stay as they are.

    Args:
        local_clock: LSL's clock, seconds.
        monotonic_ns: CLOCK_MONOTONIC of this computer.
        utc_ns: UTC of this computer, since 1970.
    """

    def __init__(
        self,
        local_clock: Callable[[], float],
        monotonic_ns: Callable[[], int] = time.monotonic_ns,
        utc_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self._local_clock = local_clock
        self._monotonic_ns = monotonic_ns
        self._utc_ns = utc_ns
        measured = _relation(local_clock, monotonic_ns)
        self.monotonic = measured._replace(offset_ns=0) if _is_same(measured) else measured

    def is_of_this_computer(self, frame: PointsFrame) -> bool:
        """True if the monotonic clock that a field was dated by is this computer's."""
        own_ns = self._utc_ns() - self._monotonic_ns()
        return abs(frame.utc_us * 1000 - frame.time_ns - own_ns) < SAME_NS

    def time_of(self, frame: PointsFrame, *, of_this_computer: bool) -> float:
        """Middle of a field's exposure, seconds of LSL's clock.

        Args:
            frame: The field.
            of_this_computer: False: by UTC, as well as the clocks of both computers are set.
        """
        if of_this_computer:
            return (frame.time_ns + self.monotonic.offset_ns) / 1e9
        return self._by_utc(frame.utc_us * 1000)

    def time_at(self, utc: datetime) -> float:
        """A moment of UTC, seconds of LSL's clock."""
        return self._by_utc(round(utc.timestamp() * 1e9))

    def now(self) -> float:
        """The present moment, seconds of LSL's clock."""
        return self._local_clock()

    def _by_utc(self, utc_ns: int) -> float:
        # Related anew every time: UTC may have been set meanwhile.
        return (utc_ns + _relation(self._local_clock, self._utc_ns).offset_ns) / 1e9


def _relation(local_clock: Callable[[], float], other_ns: Callable[[], int]) -> Relation:
    trials = []
    for _ in range(TRIALS):
        before_ns, local_s, after_ns = other_ns(), local_clock(), other_ns()
        middle_ns = (before_ns + after_ns) // 2
        trials.append(Relation(round(local_s * 1e9) - middle_ns, (after_ns - before_ns) // 2))
    return min(trials, key=lambda one: one.error_ns)


def _is_same(relation: Relation) -> bool:
    # LSL's clock comes as a float of seconds: after a year, its steps are of 4 ns.
    return abs(relation.offset_ns) <= relation.error_ns + 1000


_VARIANCES = [0, 3, 5]
"""Those of x, y and z among the six elements of a covariance."""
PARTS = (
    *(("x", "PositionX"), ("y", "PositionY"), ("z", "PositionZ")),
    *(("sigma_x", "SigmaX"), ("sigma_y", "SigmaY"), ("sigma_z", "SigmaZ")),
)
"""Ending of each channel's label, and its type."""
UNIT = "millimeters"


class Channel(NamedTuple):
    """A channel as its metadata describes it."""

    label: str
    type: str
    unit: str
    target: int
    row: int
    column: int


class PointsLayout:
    """The targets of an object model and their channels.

    Args:
        name: Name of the object model.
        places: Id, row and column of each target.

    Attributes:
        name: Name of the object model.
    """

    def __init__(self, name: str, places: tuple[tuple[int, int, int], ...]) -> None:
        self.name = name
        self._places = places
        self._index = {target: k for k, (target, _, _) in enumerate(places)}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Self:
        """The layout of an object model as `GET /api/v1/devices/NAME/object` describes it."""
        columns = (document["target"], document["row"], document["column"])
        return cls(document["name"], tuple(zip(*columns, strict=True)))

    def __eq__(self, other: object) -> bool:
        """True if both have the same channels in the same sequence, and the same object model's name."""
        return isinstance(other, PointsLayout) and self._said == other._said

    def __hash__(self) -> int:
        """Hash of what makes them equal."""
        return hash(self._said)

    @property
    def digest(self) -> str:
        """Eight characters that differ where the layouts do."""
        return hashlib.sha256(repr(self._said).encode()).hexdigest()[:8]

    @property
    def channel_count(self) -> int:
        """Number of channels."""
        return len(self._places) * len(PARTS)

    def channels(self) -> Iterator[Channel]:
        """Every channel, in its sequence."""
        for target, row, column in self._places:
            for ending, kind in PARTS:
                yield Channel(f"{target}_{ending}", kind, UNIT, target, row, column)

    def covers(self, frame: PointsFrame) -> bool:
        """True if every target of a field has channels."""
        return all(target in self._index for target in frame.target.tolist())

    def sample(self, frame: PointsFrame) -> NDArray[np.float32]:
        """(channel_count,), one field; NaN where a target was not found.

        Positions are rounded as in a capture file, so that a sample has the numbers of the file in 32 bits.
        σ is that from pointing and line jitter.
        """
        values = np.full((len(self._places), len(PARTS)), np.nan, np.float32)
        found = frame.target.tolist()
        known = [k for k, target in enumerate(found) if target in self._index]
        at = [self._index[found[k]] for k in known]
        values[at, :3] = rounded(frame.xyz_mm[known], PER_MM)
        values[at, 3:] = np.sqrt(frame.covariance_mm2[known][:, _VARIANCES])
        return values.ravel()

    @property
    def _said(self) -> tuple[str, tuple[tuple[int, int, int], ...]]:
        return self.name, self._places


REPEATED_S = 5.0
"""A field that is older than the newest by no more than this has been pushed before; a ring lasts 0.64 s."""
KEPT_S = 60
"""Samples kept for an inlet that is slow; of a minute's points of 83 targets, 6 MB."""


def lsl() -> Any:
    """The module `pylsl`.

    Raises:
        ExtraMissing: It is not installed, or has no library for this computer.
    """
    try:
        import pylsl  # noqa: PLC0415 - an optional extra
    except (ImportError, RuntimeError) as error:  # RuntimeError: liblsl was not found
        raise ExtraMissing("grabberd outlet lsl", "lsl") from error
    return pylsl


class Outlets:
    """The streams of points and of events of a device; any thread may push to them.

    Args:
        device: Name of the device.
        layout_of: Returns the layout of the present object model.
        clock: Dates samples by LSL's clock.
    """

    def __init__(self, device: str, layout_of: Callable[[], PointsLayout], clock: LslClock) -> None:
        self.device = device
        self._layout_of = layout_of
        self._clock = clock
        self._lock = threading.Lock()
        self._events = self._event_outlet()
        self._points: pylsl.StreamOutlet | None = None
        self._layout = PointsLayout("", ())
        self._described: tuple[Any, ...] = ()
        self._near = True
        self._unsure = True
        self._newest_s = -math.inf

    def push(self, one: StreamedPoints) -> None:
        """Pushes the points of a field, to a new stream if what is said of them has changed.

        A capture measures afresh what was measured before its trigger. That is not pushed again: a stream's
        times grow.
        """
        if one.skipped:
            self.tell(Event("points_missed", {"fields": one.skipped}))
        description = one.description
        said = (description.calibration_id, description.object_name, description.rate_hz)
        if self._unsure or said != self._described or not self._layout.covers(one.frame):
            self._look_up(one, said)
        assert self._points is not None
        time_s = self._clock.time_of(one.frame, of_this_computer=self._near)
        if self._newest_s - REPEATED_S < time_s <= self._newest_s:
            return
        self._newest_s = time_s
        self._points.push_sample(self._layout.sample(one.frame).tolist(), time_s)

    def begin(self) -> None:
        """Looks up the object model again before the next field: the daemon may be another one."""
        self._unsure = True

    @property
    def is_heard(self) -> bool:
        """True if an inlet receives the events."""
        return bool(self._events.have_consumers())

    def tell(self, event: Event) -> None:
        """Pushes an event."""
        time_s = self._clock.now() if event.utc is None else self._clock.time_at(event.utc)
        text = json.dumps({"event": event.name, **event.details}, ensure_ascii=False)
        with self._lock:
            self._events.push_sample([text], time_s)

    def _look_up(self, one: StreamedPoints, said: tuple[Any, ...]) -> None:
        layout, near = self._layout_of(), self._clock.is_of_this_computer(one.frame)
        if (layout, near, said) != (self._layout, self._near, self._described) or self._points is None:
            self._points = None  # before another of the same name is announced
            self._points = self._points_outlet(layout, one, near=near)
        self._layout, self._near, self._described, self._unsure = layout, near, said, False

    def _points_outlet(
        self, layout: PointsLayout, one: StreamedPoints, *, near: bool
    ) -> "pylsl.StreamOutlet":
        count, rate_hz = layout.channel_count, one.description.rate_hz
        info = self._info("points", "MoCap", count, rate_hz, "float32", layout.digest)
        about = self._described_by_daemon(info)
        about.append_child_value("object", layout.name)
        about.append_child_value("calibration_id", one.description.calibration_id or "")
        about.append_child_value("clock", "monotonic" if near else "utc")
        error_us = self._clock.monotonic.error_ns / 1000
        about.append_child_value("clock_error_us", f"{error_us:.3f}" if near else "")
        channels = info.desc().append_child("channels")
        for channel in layout.channels():
            node = channels.append_child("channel")
            for key, value in channel._asdict().items():
                node.append_child_value(key, str(value))
        return lsl().StreamOutlet(info, max_buffered=KEPT_S)

    def _event_outlet(self) -> "pylsl.StreamOutlet":
        pylsl = lsl()
        info = self._info("events", "Markers", 1, pylsl.IRREGULAR_RATE, "string", "")
        self._described_by_daemon(info)
        node = info.desc().append_child("channels").append_child("channel")
        node.append_child_value("label", "event")
        node.append_child_value("type", "JSON")
        return pylsl.StreamOutlet(info, max_buffered=KEPT_S)

    def _info(
        self, name: str, kind: str, channels: int, rate_hz: float, number: str, digest: str
    ) -> "pylsl.StreamInfo":
        # An inlet that has lost its stream takes another with the same id, which needs the same channels.
        own_id = "-".join(filter(None, ("grabberd", platform.node(), self.device, name, digest)))
        full_name = f"grabberd-{self.device}-{name}"
        return lsl().StreamInfo(full_name, kind, channels, rate_hz, number, own_id)

    def _described_by_daemon(self, info: "pylsl.StreamInfo") -> Any:
        desc = info.desc()
        acquisition = desc.append_child("acquisition")
        acquisition.append_child_value("manufacturer", "grabberd")
        acquisition.append_child_value("version", __version__)
        acquisition.append_child_value("device", self.device)
        return acquisition
