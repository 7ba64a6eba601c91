"""Faults of the daemon itself, each logged when it begins and when it is over; devices have their own."""

import logging
from collections import Counter
from typing import Literal

from grabberd import runtime
from grabberd.documents.devices import FaultDocument
from grabberd.errors import Cause
from grabberd.runtime import SystemClock, UtcClock, iso_utc

log = logging.getLogger(__name__)

OWN_CAUSES = (
    *(Cause.CAPTURES_MISSING, Cause.CAPTURES_REPLACED, Cause.CAPTURE_UNSEALED),
    *(Cause.CAPTURE_CHANGED, Cause.INDEX_REBUILDING, Cause.INDEX_FAILED),
    *(Cause.LOGGER_FAILED, Cause.LOGGER_DOUBTFUL),
    *(Cause.SETTINGS_RESTORED, Cause.SETTINGS_LOST, Cause.SETTINGS_UNREADABLE),
    *(Cause.JOBS_LOST, Cause.JOBS_UNWRITABLE),
)
"""The causes that are the daemon's own."""


class FaultBoard:
    """The faults that there are at this moment; any thread may report and resolve.

    Args:
        clock: Source of time.

    Attributes:
        counts: How often each fault has begun since the start.
    """

    def __init__(self, clock: UtcClock | None = None) -> None:
        self.counts: Counter[Cause] = Counter()
        self._clock = clock or SystemClock()
        self._lock = runtime.lock()
        self._now: dict[Cause, FaultDocument] = {}

    @property
    def now(self) -> list[FaultDocument]:
        """The faults, those that need a person first, then the oldest."""
        with self._lock:
            known = list(self._now.values())
        return sorted(known, key=lambda one: (one.level == "warning", one.since_utc))

    def has(self, cause: Cause) -> bool:
        """True while there is such a fault."""
        return cause in self._now

    def report(
        self, cause: Cause, message: str, hint: str, level: Literal["fault", "warning"] = "fault"
    ) -> None:
        """Reports a fault; one that is known already only gets the new message.

        Args:
            cause: Reason code; there is one fault of each.
            message: What is wrong, with values.
            hint: What to do about it.
            level: "warning" if nobody has to act.
        """
        with self._lock:
            known = self._now.get(cause)
            since_utc = known.since_utc if known else iso_utc(self._clock.utc_now())
            self._now[cause] = FaultDocument(
                cause_code=cause, level=level, message=message, hint=hint, since_utc=since_utc
            )
            if known is not None:
                return
            self.counts[cause] += 1
        write = log.error if level == "fault" else log.warning
        write("%s; %s", message, hint, extra={"cause": cause.value})

    def resolve(self, *causes: Cause) -> None:
        """Notes that faults are over; those that are not known are left."""
        for cause in causes:
            # Asked first without the lock, since this is called with every request.
            if cause in self._now:
                with self._lock:
                    over = self._now.pop(cause, None)
                if over is not None:
                    log.info("over since now: %s", over.message, extra={"cause": cause.value})


class Complaint:
    """Logs a failure of a thread once, not again and again for as long as it lasts.

    Args:
        log: Receives the entries.
        words: What has failed, with a place for the reason.
    """

    def __init__(self, log: logging.Logger, words: str) -> None:
        self._log, self._words = log, words
        self._last: str | None = None

    def failed(self, reason: str, error: Exception | None = None) -> None:
        """Notes a failure, with the error if its traceback is wanted."""
        if reason != self._last:
            self._log.error(self._words, reason, exc_info=error)
        self._last = reason

    def over(self) -> None:
        """Notes that it is over."""
        self._last = None
