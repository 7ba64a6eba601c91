"""The forced end: a daemon that was told to end does so in time, whatever its threads are doing.

A thread may hang in the kernel, on a disk that is gone or a driver that does not return; Python waits for it.
"""

import logging
import multiprocessing
import os
import select
import threading
from collections.abc import Callable

log = logging.getLogger(__name__)

LEFT_S = 9.0
"""Time from the signal to the forced end."""
EX_TEMPFAIL = 75
"""Exit status of a forced end."""
_LOGGED_S = 0.5


class ForcedEnd:
    """Ends the process some time after it was told to end, unless it has ended by then.

    Args:
        left_s: That time.
        end: Ends the process; returns in tests alone.
    """

    def __init__(self, left_s: float = LEFT_S, end: Callable[[], None] | None = None) -> None:
        self._left_s = left_s
        self._end = end or end_now
        self._reading, self._writing = os.pipe()
        self._thread = threading.Thread(target=self._wait, name="forced-end", daemon=True)
        self._told = False

    def start(self) -> None:
        """Waits for being told."""
        self._thread.start()

    def told_to_end(self) -> None:
        """Begins to count; for a signal handler, which must not take a lock, and again safe."""
        if not self._told:
            self._told = True
            os.write(self._writing, b"!")

    def close(self) -> None:
        """Ends the waiting of a process that goes on; does nothing once it was told to end."""
        if not self._told:
            os.close(self._writing)
            self._thread.join()

    def _wait(self) -> None:
        told = os.read(self._reading, 1)
        if told:
            select.select([], [], [], self._left_s)
            self._end()
        else:
            os.close(self._reading)


def end_now() -> None:
    """Ends the process and those that it has started, without waiting for anything."""
    # A thread of its own: the log, too, may hang.
    logged = threading.Thread(target=_log, daemon=True)
    logged.start()
    logged.join(_LOGGED_S)
    for child in multiprocessing.active_children():
        child.kill()
    os._exit(EX_TEMPFAIL)


def _log() -> None:
    names = ", ".join(sorted(one.name for one in threading.enumerate() if one.is_alive()))
    log.critical(
        "not everything has ended %g s after the signal to end, so it is ended by force: a capture that is "
        "not sealed yet is sealed at the next start; threads left: %s",
        LEFT_S,
        names,
    )
