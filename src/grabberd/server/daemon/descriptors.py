"""File descriptors: as many as the system allows, and never all of them for clients."""

import errno
import logging
import resource
import time
from collections.abc import Callable

log = logging.getLogger(__name__)

ENOUGH = 65_536
OWN = 64
"""What the daemon opens by itself: devices, captures and their journals, databases, the job process."""
AT_ONCE = 16
"""Connections that are accepted at one go, before any of them is counted."""
PER_CONNECTION = 4
"""A connection's socket and that of one that is being refused meanwhile, a capture file and its journal."""
LOG_EVERY_S = 60.0
EXHAUSTED = (errno.EMFILE, errno.ENFILE)


def raise_limit() -> int:
    """Raises this process's limit as far as the system allows, and returns it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = ENOUGH if hard == resource.RLIM_INFINITY else min(hard, ENOUGH)
    if soft == resource.RLIM_INFINITY or soft >= most:
        return ENOUGH if soft == resource.RLIM_INFINITY else soft
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    return most


def affordable_connections(asked: int, limit: int) -> int:
    """Number of connections that leave enough descriptors for recording, at most as many as asked for.

    Args:
        asked: Configured limit of connections.
        limit: Limit of file descriptors.
    """
    # Accepted ones are refused, and their sockets closed, a few rounds of the event loop later.
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
    """Counts what failed for want of descriptors; logs the first, then once a minute how many there were.

    Args:
        now_s: Source of monotonic time.

    Attributes:
        count: How often it has happened since the start.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self.count = 0
        self._now_s = now_s
        self._logged = 0
        self._log_at_s = 0.0

    def explains(self, error: BaseException | None) -> bool:
        """True if an error comes from it; then it is counted."""
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
"""That of this process, whose descriptors all parts of it share."""
