"""The streams of one device on the Lab Streaming Layer.

LSL's own threads send what is pushed; for an inlet that is slow they keep a minute and drop the oldest. So
nobody waits here, and the daemon knows nothing of inlets at all.
"""

import json
import math
import platform
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from grabberd import __version__
from grabberd.client.lsl.events import Event
from grabberd.client.lsl.lsl_clock import LslClock
from grabberd.client.lsl.points_layout import PointsLayout
from grabberd.client.points_stream import StreamedPoints
from grabberd.errors import ExtraMissing

if TYPE_CHECKING:
    import pylsl

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
