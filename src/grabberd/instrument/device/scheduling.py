"""Scheduling: whether the capture thread takes fields in time, by its clock and the kernel's accounting.

Standstills, in which the program took no fields, are counted and shown for a minute.
"""

import os
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from grabberd.core.field import PAL_HZ
from grabberd.errors import Cause, DeviceRefused
from grabberd.instrument.acquisition import Standstill
from grabberd.instrument.acquisition.numbering.standstill import StandstillOfDriver
from grabberd.runtime import UtcClock, iso_utc

_NOTABLE = 0.5
"""Shortest pause that counts, in periods."""
_MOST_SHARE = 0.5
"""Share of a processor that a thread in real time may use; a camera's fields take a twentieth."""
_PRIORITY = 1
"""The lowest priority in real time: other real-time programs, such as an audio server, take precedence."""
NOT_FIRST = (
    "permit it: 'LimitRTPRIO=1' in the unit of a service, 'ulimit -r 1' before a daemon that is started by "
    "hand (/etc/security/limits.d sets who may), '--ulimit rtprio=1' for a container"
)


class ThreadTimes(NamedTuple):
    """Times of a thread since its start.

    Attributes:
        ran_ns: On a processor.
        waited_ns: Ready to run, but without a processor.
    """

    ran_ns: int
    waited_ns: int


class ThreadAccount:
    """Accounting and priority of a thread; neither is available with a clock other than the kernel's."""

    def thread(self) -> ThreadTimes | None:
        """Times of the thread; None if unknown."""
        return None

    def program_ns(self) -> int:
        """Processor time used by the whole program."""
        return 0

    def come_first(self) -> str:
        """Requests that the calling thread runs before all others; returns its new scheduling in words, or ""
        if that is unknown.

        Raises:
            DeviceRefused: It may not; the hint says what would permit it.
        """
        return ""

    def keep_to_share(self, now_ns: int) -> str:
        """Ends the priority of the calling thread if it uses the processor too much.

        Returns its new scheduling in words, or "" if nothing changes.
        """
        return ""


class KernelAccount(ThreadAccount):
    """Accounting of the thread that first uses it, from /proc/self/task/TID/schedstat."""

    def __init__(self) -> None:
        self._file: int | None = None
        self._opened = False
        self._first_since: tuple[int, int] | None = None

    def thread(self) -> ThreadTimes | None:
        """See `ThreadAccount`; None if the kernel does not provide it."""
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
        """See `ThreadAccount`; permitted by LimitRTPRIO of the unit, or `ulimit -r`.

        Processes started by the thread have ordinary priority.
        """
        try:
            # Round robin: the capture threads of several devices take turns.
            os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
        except OSError as error:
            raise DeviceRefused(
                f"fields are not taken in real time ({error.strerror}): some may be lost while others run",
                NOT_FIRST,
            ) from error
        self._first_since = (0, 0)
        return "in real time, before other programs' work"

    def keep_to_share(self, now_ns: int) -> str:
        """See `ThreadAccount`: a driver that always has a field would leave no processor to others."""
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
        """Closes the file; the times are unknown afterwards."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


class _Used(NamedTuple):
    """Processor time of the thread and of its program until a moment, and time of calls to the device."""

    thread: ThreadTimes | None
    program_ns: int
    called_ns: int


class Scheduling:
    """Adds up the time by which the capture thread has fallen behind the camera.

    It counts from when the driver's buffers were last found empty: many small delays fill them just like one
    long pause. A pause after which they are empty is one of the driver as well, if fields are missing.

    Args:
        clock: Source of time.
        account: The kernel's account of the thread that uses this.
        called_ns: Total time spent in calls to the device that should return at once.

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
        self._at_asking = self._at_empty = self._at_field = _Used(None, 0, 0)
        self._late_ns = self._paused_ns = self._ended_ns = 0
        self._unreported = False
        self._period_ns = 0
        self.paced(PAL_HZ)
        self.was_in_time = False

    def paced(self, rate_hz: float) -> None:
        """Notes the number of fields per second from now on."""
        self._period_ns = round(1e9 / rate_hz)

    def excuse(self) -> None:
        """Notes that no fields had to be taken until now."""
        self._late_ns, self._paused_ns, self._unreported = 0, 0, False
        self._at_empty = self._at_field = self._used
        self._came_ns, self._fields = self._clock.now_ns(), 0

    def asks(self) -> int:
        """Notes that the thread now requests a field; returns the time."""
        self._asked_ns, self._at_asking = self._clock.now_ns(), self._used
        return self._asked_ns

    def came(self, now_ns: int, timeout_s: float, fields: int, *, found_empty: bool) -> Standstill | None:
        """Standstill that kept the thread from taking fields until the end of this request, or None.

        One found by a request without a field is returned again with the next field.

        Args:
            now_ns: The present time.
            timeout_s: Longest time that the request should have taken.
            fields: Number of fields that it has returned.
            found_empty: True if no field was waiting when it began.
        """
        used, request_ns = self._used, now_ns - self._asked_ns
        if found_empty:
            self._late_ns, self._unreported, self._at_empty = 0, False, self._at_asking
            # The thread may have waited for a processor, or something else, after a field had come.
            waited_ns = _waited_ns(self._at_asking.thread, used.thread)
            late_ns = max(self._overrun(request_ns, timeout_s), min(waited_ns, request_ns))
            # While a thread waits for a processor, drivers have one.
            between_ns = self._asked_ns - self._came_ns
            between_ns -= _waited_ns(self._at_field.thread, self._at_asking.thread)
            paused_ns = [
                self._overrun(took_ns, timeout_s) for took_ns in (request_ns - waited_ns, between_ns)
            ]
            self._paused_ns += sum(paused_ns)
            self._ended_ns = now_ns if any(paused_ns) else self._ended_ns
        else:
            # There was always a field to take since the last ones, which had their own time.
            late_ns = now_ns - self._came_ns - self._fields * self._period_ns
        notable_ns = _NOTABLE * self._period_ns
        self.was_in_time = found_empty and late_ns < notable_ns
        self._came_ns, self._fields = now_ns, fields
        self._late_ns = max(0, self._late_ns + late_ns)
        if late_ns >= notable_ns:
            self._unreported, self._ended_ns = True, now_ns
        standstill = self._standstill(used)
        if fields:
            self._unreported, self._paused_ns, self._at_field = False, 0, used
        return standstill

    def _standstill(self, used: _Used) -> Standstill | None:
        if not self._paused_ns and not self._unreported:
            return None
        # A field may come between a pause and the next request, and wait for that.
        is_of_driver = self._paused_ns > self._late_ns / 2
        kind, since = (StandstillOfDriver, self._at_field) if is_of_driver else (Standstill, self._at_empty)
        waited_ns = None if used.thread is None else _waited_ns(since.thread, used.thread)
        used_ns = used.program_ns - since.program_ns
        called_ns = used.called_ns - since.called_ns
        return kind(max(self._late_ns, self._paused_ns), waited_ns, used_ns, called_ns, self._ended_ns)

    def _overrun(self, took_ns: int, timeout_s: float) -> int:
        """Time by which something took too long; if it exceeded its limit, a field was due before."""
        if took_ns - round(timeout_s * 1e9) < _NOTABLE * self._period_ns:
            return 0
        return took_ns - self._period_ns

    @property
    def _used(self) -> _Used:
        return _Used(self._account.thread(), self._account.program_ns(), self._called_ns())


def _waited_ns(before: ThreadTimes | None, after: ThreadTimes | None) -> int:
    """Time waited for a processor between two readings; 0 if they are unknown."""
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
        cause: Cause in a sentence; `hint`: what to do; `code`: cause code.
        utc: Time at which it ended.
    """

    cause: str
    hint: str
    code: Cause
    utc: str


class Standstills:
    """Standstills since the daemon started; used by the capture thread, read by any thread.

    Attributes:
        counts: Their number, by cause.
        seconds: Their total length, by cause.
    """

    def __init__(self, clock: UtcClock) -> None:
        self._clock = clock
        self.counts: Counter[Cause] = Counter()
        self.seconds: dict[Cause, float] = dict.fromkeys(_HINTS, 0.0)
        self._latest: tuple[int, Standstill, Cause, str] | None = None

    def note(self, standstill: Standstill) -> bool:
        """Notes one; returns True if none of its kind was reported within the last minute."""
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
        """Advice on how to avoid one."""
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
