"""What is known of a device from moment to moment; written by its threads, read by everybody."""

import logging
import threading
from collections import Counter
from dataclasses import dataclass, field, replace

from grabberd.acquisition import Outcome, Slot
from grabberd.acquisition.device import Signal, StreamInfo
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.states import DeviceState, may_follow

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DeviceStatus:
    """A device at one moment.

    Attributes:
        state: in a word; `since_utc`: since when; `cause`: why, in a sentence, or None.
        stream: what the driver granted, or None while it is not open.
        signal: what the driver says of the camera's signal.
        outcomes: what became of every field since the daemon started.
        openings: how often the device has been opened.
    """

    state: DeviceState
    since_utc: str
    cause: str | None = None
    stream: StreamInfo | None = None
    signal: Signal = Signal.UNKNOWN
    outcomes: Counter[Outcome] = field(default_factory=Counter)
    openings: int = 0


class StatusBoard:
    """The status of one device; logs each change of state or cause once.

    Attributes:
        changed: notified with every change of state; whoever waits for a state waits on it.
    """

    def __init__(self, name: str, clock: Clock) -> None:
        self.changed = threading.Condition()
        self._name = name
        self._clock = clock
        self._status = DeviceStatus(DeviceState.ABSENT, iso_utc(clock.utc_now()), "not opened yet")

    @property
    def now(self) -> DeviceStatus:
        """The status as it is; its counters are a copy."""
        with self.changed:
            return replace(self._status, outcomes=self._status.outcomes.copy())

    @property
    def state(self) -> DeviceState:
        """The state alone."""
        return self._status.state

    def enter(self, state: DeviceState, cause: str | None = None) -> None:
        """Goes into a state that may follow the present one."""
        with self.changed:
            if not may_follow(self._status.state, state):
                raise ValueError(f"device {self._name}: {state} may not follow {self._status.state}")
            if (state, cause) == (self._status.state, self._status.cause):
                return
            since = iso_utc(self._clock.utc_now())
            self._status = replace(self._status, state=state, since_utc=since, cause=cause)
            self.changed.notify_all()
        log.log(_level(state), "device %s is %s%s", self._name, state, f": {cause}" if cause else "")

    def opened(self, stream: StreamInfo) -> None:
        """The device has been opened and granted this stream."""
        with self.changed:
            self._status = replace(self._status, stream=stream, openings=self._status.openings + 1)

    def saw_signal(self, signal: Signal) -> None:
        """What the driver says of the signal."""
        with self.changed:
            self._status = replace(self._status, signal=signal)

    def count(self, slot: Slot) -> None:
        """Counts a field and those that were lost before it."""
        with self.changed:
            self._status.outcomes[slot.outcome] += 1
            for entry in slot.lost_before:
                self._status.outcomes[entry.outcome] += entry.count


def _level(state: DeviceState) -> int:
    return logging.WARNING if state in {DeviceState.RECOVERING, DeviceState.FAILED} else logging.INFO
