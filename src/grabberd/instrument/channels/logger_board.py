"""Current status of a logger; written by its thread, read by any other."""

import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from grabberd import runtime
from grabberd.core.channels import Anomaly, LoggerInfo
from grabberd.core.channels.account import AnomalyCount, AnomalyLedger
from grabberd.documents.enums import DeviceState
from grabberd.errors import Cause, DeviceError, GrabberdError
from grabberd.runtime import UtcClock, iso_utc

log = logging.getLogger(__name__)

DOUBTFUL_NS = 10_000_000_000
"""Time for which an anomaly is shown as current."""
STUCK_S = 5.0
"""Time within which a driver must return from a read of a tenth of a second."""
STUCK, STUCK_HINT = (
    "its driver does not return",
    "unplug the logger; if it comes again, restart and report it",
)


@dataclass(frozen=True, slots=True)
class LoggerStatus:
    """Status of a logger at one moment.

    Attributes:
        state: Opening, ready, absent, failed or ended.
        since_utc: Time at which it entered this state.
        cause: Cause of the state in a sentence, or None.
        hint: What an operator can do about it, or None.
        code: Machine-readable code of the cause, or None.
        info: The logger as last found, or None before the first opening.
        openings: Number of times that it has been opened.
        readings: Number of readings since the daemon started.
        anomalies: Number of anomalies since then, by reason.
        doubt: The latest anomaly of the last seconds, or None.
    """

    state: DeviceState
    since_utc: str
    cause: str | None = None
    hint: str | None = None
    code: Cause | None = None
    info: LoggerInfo | None = None
    openings: int = 0
    readings: int = 0
    anomalies: tuple[AnomalyCount, ...] = field(default=())
    doubt: Anomaly | None = None

    @property
    def is_reading(self) -> bool:
        """True while readings come, or may come."""
        return self.state is DeviceState.READY


class LoggerBoard:
    """The status of one logger; logs each change of state or cause once.

    Args:
        name: Name of the logger.
        clock: Source of time.
        changed: Called with each change that is relevant for people.

    Attributes:
        name: Name of the logger.
    """

    def __init__(self, name: str, clock: UtcClock, changed: Callable[[], None] = lambda: None) -> None:
        self.name = name
        self._clock = clock
        self._changed = changed
        self._lock = runtime.lock()
        self._anomalies = AnomalyLedger()
        self._doubt_ns = 0
        self._beat_ns = clock.now_ns()
        self._status = LoggerStatus(DeviceState.OPENING, iso_utc(clock.utc_now()))

    @property
    def now(self) -> LoggerStatus:
        """The current status; failed while the logger's thread hangs in its driver."""
        status = self._status
        silent_s = (self._clock.now_ns() - self._beat_ns) / 1e9
        if silent_s < STUCK_S or not status.is_reading:
            return status
        return replace(status, state=DeviceState.FAILED, cause=STUCK, hint=STUCK_HINT, code=Cause.FAULT)

    def opened(self, info: LoggerInfo) -> None:
        """Notes that the logger has been opened; it is ready once readings come."""
        with self._lock:
            self._status = replace(self._status, info=info, openings=self._status.openings + 1)

    def came(self, readings: int, anomalies: tuple[Anomaly, ...]) -> None:
        """Notes new readings; called after every read, even without readings."""
        now_ns = self._beat_ns = self._clock.now_ns()
        with self._lock:
            before = self._status
            if anomalies:
                self._anomalies.enter(self.name, anomalies)
                self._doubt_ns = now_ns
            settled = before.doubt is not None and not anomalies and now_ns - self._doubt_ns > DOUBTFUL_NS
            doubt = anomalies[-1] if anomalies else (None if settled else before.doubt)
            self._status = replace(
                before,
                readings=before.readings + readings,
                anomalies=self._anomalies.counts if anomalies else before.anomalies,
                doubt=doubt,
            )
        if readings and not before.is_reading:
            self.enter(DeviceState.READY, None)
        elif (doubt and doubt.reason) != (before.doubt and before.doubt.reason):
            self._changed()

    def enter(self, state: DeviceState, error: GrabberdError | None) -> None:
        """Changes the state, with the error that stopped the readings, if any."""
        message, hint = (error.message, error.hint) if error else (None, None)
        code = error.cause if isinstance(error, DeviceError) else None
        with self._lock:
            before = self._status
            if (before.state, before.cause) == (state, message):
                return
            since_utc = iso_utc(self._clock.utc_now())
            self._status = replace(
                before, state=state, since_utc=since_utc, cause=message, hint=hint, code=code
            )
        level = logging.INFO if error is None else logging.WARNING
        log.log(level, "logger %s is %s%s", self.name, state, f": {message}; {hint}" if error else "")
        self._changed()
