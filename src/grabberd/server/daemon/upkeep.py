"""Periodic checks in a running daemon: captures folder, unsealed files, state database, loggers."""

import logging
from collections.abc import Callable, Sequence

from grabberd import runtime
from grabberd.fault_board import Complaint

log = logging.getLogger(__name__)
EVERY_S = 1.0
STATE_EVERY = 10
"""The state database is checked every so many rounds; only changes since then can be lost by damage."""


class Upkeep:
    """A thread that checks everything once a second; each part reports its own faults.

    Args:
        checks: The checks in order, each with the number of rounds from one to the next.
    """

    def __init__(self, checks: Sequence[tuple[Callable[[], None], int]]) -> None:
        self._checks = checks
        self._stopping = runtime.event()
        self._thread: runtime.Thread | None = None
        self._complaint = Complaint(log, "the check of the daemon's files has failed: %s")

    def start(self) -> None:
        """Starts the thread."""
        self._thread = runtime.Thread(target=self._run, name="upkeep", daemon=True)
        self._thread.start()

    def stop(self, timeout_s: float = 10.0) -> None:
        """Ends the thread."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def look(self, rounds: int) -> None:
        """Runs the checks that are due in this round; `rounds`: how many have begun, with this one."""
        for check, every in self._checks:
            if rounds % every == 0:
                check()

    def _run(self) -> None:
        rounds = 0
        while not self._stopping.wait(EVERY_S):
            rounds += 1
            try:
                self.look(rounds)
                self._complaint.over()
            except Exception as error:  # whatever happens in one round, the next one is needed
                self._complaint.failed(f"{error}", error)
