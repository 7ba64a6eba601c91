"""File descriptors: as many as the system allows, some of them reserved for recording."""

import errno
import logging
import resource
from collections.abc import Callable

from grabberd import runtime

log = logging.getLogger(__name__)

ENOUGH = 65_536
OWN = 64
"""Descriptors for the daemon itself: devices, captures and their journals, databases, the job process."""
AT_ONCE = 16
"""Connections accepted in one round of the event loop, before any of them is counted."""
PER_CONNECTION = 4
"""Its socket, the socket of a connection being refused meanwhile, a capture file and its journal."""
LOG_EVERY_S = 60.0
EXHAUSTED = (errno.EMFILE, errno.ENFILE)


def raise_limit() -> int:
    """Raises this process's limit of descriptors as far as the system allows, and returns the new limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = ENOUGH if hard == resource.RLIM_INFINITY else min(hard, ENOUGH)
    if soft == resource.RLIM_INFINITY or soft >= most:
        return ENOUGH if soft == resource.RLIM_INFINITY else soft
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    return most


def affordable_connections(asked: int, limit: int) -> int:
    """Number of connections that can be served while enough descriptors remain for recording.

    Args:
        asked: Configured limit of connections, which is never exceeded.
        limit: Limit of file descriptors.
    """
    # Excess connections are refused and closed a few rounds of the event loop after they were accepted.
    affordable = max((limit - OWN - 4 * AT_ONCE) // PER_CONNECTION, 1)
    if affordable >= asked:
        return asked
    log.warning(
        "%d connections are served at most, not %d: this process may open %d files only, and recording needs "
        "some of them; raise its limit (LimitNOFILE= of the unit, ulimit -n)",
        affordable,
        asked,
        limit,
    )
    return affordable


class Exhaustion:
    """Counts failures for lack of descriptors; logs the first, then the number once a minute.

    Args:
        now_s: Source of monotonic time.

    Attributes:
        count: Number of failures since the start.
    """

    def __init__(self, now_s: Callable[[], float] = runtime.monotonic) -> None:
        self.count = 0
        self._now_s = now_s
        self._logged = 0
        self._log_at_s = 0.0

    def explains(self, error: BaseException | None) -> bool:
        """True if an error is due to a lack of descriptors, in which case it is counted."""
        if not isinstance(error, OSError) or error.errno not in EXHAUSTED:
            return False
        self.count += 1
        now_s = self._now_s()
        if self._logged == 0 or now_s >= self._log_at_s:
            log.error(
                "no file descriptor is left, %d times now: %s; clients are refused meanwhile: close some, or "
                "raise the limit (LimitNOFILE= of the unit, ulimit -n)",
                self.count,
                error,
            )
            self._logged, self._log_at_s = self.count, now_s + LOG_EVERY_S
        return True


exhaustion = Exhaustion()
"""The counter of this process: its descriptors are shared by all its parts."""
