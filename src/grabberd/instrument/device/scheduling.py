"""Scheduling: whether the capture thread takes fields in time, by its clock and by the kernel's account.

Standstills, in which the program took no fields, are counted and told to people for a minute.
"""

import os
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from grabberd.clock import UtcClock, iso_utc
from grabberd.core.field import PAL_HZ
from grabberd.errors import Cause
from grabberd.instrument.acquisition import Standstill

_NOTABLE = 0.5
"""Periods: a pause that is shorter is none."""
_MOST_SHARE = 0.5
"""Of a processor, for a thread in real time; a camera's fields take a twentieth."""
_PRIORITY = 1
"""The lowest in real time: whatever else asked for that, an audio server for instance, comes before it."""


class ThreadTimes(NamedTuple):
    """Times of a thread since it began.

    Attributes:
        ran_ns: On a processor.
        waited_ns: Ready to run, but without a processor.
    """

    ran_ns: int
    waited_ns: int


class ThreadAccount:
    """The account of a thread, and a say in when it runs; there is neither by a clock not the kernel's."""

    def thread(self) -> ThreadTimes | None:
        """Times of the thread; None if unknown."""
        return None

    def program_ns(self) -> int:
        """Processor time of the whole program."""
        return 0

    def come_first(self) -> str:
        """Asks that the calling thread runs before all others; returns how it runs from now on, in words,
        empty if that is unknown.
        """
        return ""

    def keep_to_share(self, now_ns: int) -> str:
        """Lets the calling thread run like others again if it takes too much for one that comes first.

        Returns how it runs then, in words, empty if nothing changes.
        """
        return ""


class KernelAccount(ThreadAccount):
    """The account of the thread that first asks for it, from /proc/self/task/TID/schedstat."""

    def __init__(self) -> None:
        self._file: int | None = None
        self._opened = False
        self._first_since: tuple[int, int] | None = None

    def thread(self) -> ThreadTimes | None:
        """See `ThreadAccount`; None where the kernel keeps no such account."""
        if not self._opened:
            self._opened = True
            with suppress(OSError):
                path = f"/proc/self/task/{threading.get_native_id()}/schedstat"
                self._file = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        if self._file is None:
            return None
        ran, waited, _turns = os.pread(self._file, 128, 0).split()
        return ThreadTimes(int(ran), int(waited))

    def program_ns(self) -> int:
        """See `ThreadAccount`."""
        return time.process_time_ns()

    def come_first(self) -> str:
        """See `ThreadAccount`; the right to it is LimitRTPRIO of the unit, or `ulimit -r`.

        Processes that the thread starts begin as ordinary ones.
        """
        try:
            # Round robin: the capture threads of several devices take turns.
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
        except OSError as error:
            return f"when the system gets round to it, not in real time: {error.strerror}"
        self._first_since = (0, 0)
        return "in real time, before other programs' work"

    def keep_to_share(self, now_ns: int) -> str:
        """See `ThreadAccount`: a driver that always has a field would leave nobody else a processor."""
        times = None if self._first_since is None else self.thread()
        if self._first_since is None or times is None:
            return ""
        (since_ns, ran_ns), self._first_since = self._first_since, (now_ns, times.ran_ns)
        share = (times.ran_ns - ran_ns) / max(now_ns - since_ns, 1)
        if since_ns == 0 or share <= _MOST_SHARE:
            return ""
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        self._first_since = None
        return f"no longer in real time: that took {share:.0%} of a processor"

    def close(self) -> None:
        """Closes the account; it tells nothing afterwards."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


class Scheduling:
    """Adds up the time by which the capture thread has fallen behind the camera.

    It counts from when the driver's buffers were last found empty: a program that is a little late again and
    again fills them as one long pause does.

    Args:
        clock: Source of time.
        account: The kernel's account of the thread that uses this.
        called_ns: Time spent so far in calls to the device that should return at once.

    Attributes:
        was_in_time: True if the thread waited for the last field, and took it as soon as it came.
    """

    def __init__(
        self, clock: UtcClock, account: ThreadAccount, called_ns: Callable[[], int] = lambda: 0
    ) -> None:
        self._clock = clock
        self._account = account
        self._called_ns = called_ns
        self._asked_ns = self._came_ns = clock.now_ns()
        self._fields = 0
        self._times_at_asking: ThreadTimes | None = None
        self._called_ns_at_asking = 0
        self._times_at_begin: ThreadTimes | None = None
        self._late_ns = self._program_ns_at_begin = self._called_ns_at_begin = 0
        self._untold = False
        self._period_ns = 0
        self.paced(PAL_HZ)
        self.was_in_time = False

    def paced(self, rate_hz: float) -> None:
        """Notes how many fields come a second from now on."""
        self._period_ns = round(1e9 / rate_hz)

    def excuse(self) -> None:
        """Notes that nobody had to take fields until now."""
        self._begin(self._account.thread(), self._called_ns())
        self._came_ns, self._fields = self._clock.now_ns(), 0

    def asks(self) -> int:
        """Notes that the thread asks for a field now; returns the time."""
        self._asked_ns = self._clock.now_ns()
        self._times_at_asking, self._called_ns_at_asking = self._account.thread(), self._called_ns()
        return self._asked_ns

    def came(self, now_ns: int, timeout_s: float, fields: int, *, found_empty: bool) -> Standstill | None:
        """Tells what has kept the thread from taking fields, now that a request is over; None if nothing has.

        What a request without a field has shown is told again with the next field, unless the driver's
        buffers are found empty before.

        Args:
            now_ns: The present time.
            timeout_s: Longest time that the request should have taken.
            fields: Number of fields that it has brought.
            found_empty: True if no field was waiting when it began.
        """
        times, request_ns = self._account.thread(), now_ns - self._asked_ns
        if found_empty:
            self._begin(self._times_at_asking, self._called_ns_at_asking)
            # A processor may have been waited for after a field had come, or something else.
            waited_ns = _waited_ns(self._times_at_asking, times)
            late_ns = max(self._overrun(request_ns, timeout_s), min(waited_ns, request_ns))
        else:
            # There was a field to take all the time since the last ones; those had their own time.
            late_ns = now_ns - self._came_ns - self._fields * self._period_ns
        notable_ns = _NOTABLE * self._period_ns
        self.was_in_time = found_empty and late_ns < notable_ns
        self._came_ns, self._fields = now_ns, fields
        self._late_ns = max(0, self._late_ns + late_ns)
        self._untold |= late_ns >= notable_ns
        if not self._untold:
            return None
        self._untold = not fields
        return self._standstill(times)

    def _standstill(self, times: ThreadTimes | None) -> Standstill:
        return Standstill(
            self._late_ns,
            None if times is None else _waited_ns(self._times_at_begin, times),
            self._account.program_ns() - self._program_ns_at_begin,
            self._called_ns() - self._called_ns_at_begin,
        )

    def _overrun(self, request_ns: int, timeout_s: float) -> int:
        """Time by which a request took too long; if it was longer than it may, a field was due before."""
        if request_ns - round(timeout_s * 1e9) < _NOTABLE * self._period_ns:
            return 0
        return request_ns - self._period_ns

    def _begin(self, times: ThreadTimes | None, called_ns: int) -> None:
        self._late_ns, self._untold = 0, False
        self._times_at_begin, self._called_ns_at_begin = times, called_ns
        self._program_ns_at_begin = self._account.program_ns()


def _waited_ns(before: ThreadTimes | None, after: ThreadTimes | None) -> int:
    """Time waited for a processor between two readings; none where they are unknown."""
    return 0 if before is None or after is None else after.waited_ns - before.waited_ns


SHOWN_S = 60.0
"""Time for which a standstill is shown."""
_HINTS = {
    Cause.COMPUTER_BUSY: "close other programs on this computer, or give the driver more buffers",
    Cause.PROGRAM_STOPPED: "look for what stopped it: suspended, swapped out, a virtual machine that paused",
    Cause.DRIVER_HUNG: "look into the kernel's log (dmesg); another port, cable or grabber may help",
}


class ShownStandstill(NamedTuple):
    """A standstill of the last minute.

    Attributes:
        cause: What it was, in a sentence; `hint`: what to do; `code`: the same as a code.
        utc: Time at which it ended.
    """

    cause: str
    hint: str
    code: Cause
    utc: str


class Standstills:
    """Standstills since the daemon started; used by the capture thread, read by everybody.

    Attributes:
        counts: Their number, by cause.
        seconds: Their length together, by cause.
    """

    def __init__(self, clock: UtcClock) -> None:
        self._clock = clock
        self.counts: Counter[Cause] = Counter()
        self.seconds: dict[Cause, float] = dict.fromkeys(_HINTS, 0.0)
        self._latest: tuple[int, Standstill, Cause, str] | None = None

    def note(self, standstill: Standstill) -> bool:
        """Notes one; returns True if people have not been told of its kind within the last minute."""
        now_ns, code = self._clock.now_ns(), _code_of(standstill)
        latest, shown = self._latest, self.shown
        known_ns, goes_on = 0, False
        if latest is not None and now_ns - standstill.time_ns < latest[0]:
            known_ns, code, goes_on = latest[1].time_ns, latest[2], True
        self.counts[code] += not goes_on
        self.seconds[code] += max(0, standstill.time_ns - known_ns) / 1e9
        self._latest = now_ns, standstill, code, iso_utc(self._clock.utc_now())
        return shown is None or shown.code is not _code_of(standstill)

    def hint_of(self, standstill: Standstill) -> str:
        """Advice against one."""
        return _HINTS[_code_of(standstill)]

    @property
    def shown(self) -> ShownStandstill | None:
        """The latest one, if that was within the last minute."""
        if self._latest is None or self._clock.now_ns() - self._latest[0] > SHOWN_S * 1e9:
            return None
        _, standstill, _, utc = self._latest
        return ShownStandstill(standstill.reason, self.hint_of(standstill), _code_of(standstill), utc)


def _code_of(standstill: Standstill) -> Cause:
    if standstill.is_hang:
        return Cause.DRIVER_HUNG
    return Cause.PROGRAM_STOPPED if standstill.is_stop else Cause.COMPUTER_BUSY
