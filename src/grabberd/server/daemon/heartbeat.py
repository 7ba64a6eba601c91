"""Heartbeat: tells systemd that the daemon lives while its event loop and every capture thread do."""

from grabberd.instrument.device.status_board import StatusBoard
from grabberd.instrument.liveness import Liveness
from grabberd.server.daemon.notify import Notifier

STATUS_EVERY_S = 1.0
"""Interval at which `systemctl status` is brought up to date."""


class Heartbeat:
    """Sends the watchdog's sign of life; the event loop calls `beat`, so it is sent only while that runs.

    A capture thread that is silent for half the watchdog's time holds it back, and systemd restarts the
    daemon. While another device records a capture, the restart waits for the capture's end.

    Args:
        notifier: Sends to systemd.
        liveness: Looks after the capture threads; with every beat, also where nobody watches.

    Attributes:
        every_s: Interval at which to call `beat`.
    """

    def __init__(self, notifier: Notifier, liveness: Liveness) -> None:
        self.notifier = notifier
        self._liveness = liveness
        self._half_s = None if notifier.watchdog_s is None else notifier.watchdog_s / 2
        self._due_s = 0.0
        self.every_s = STATUS_EVERY_S if self._half_s is None else min(STATUS_EVERY_S, self._half_s / 4)
        if self._half_s is not None:
            liveness.restart_after(self._half_s)

    def beat(self, now_s: float) -> None:
        """Looks after the capture threads and sends what is due.

        Args:
            now_s: Time of a clock that nobody sets.
        """
        self._liveness.look(now_s)
        self.notifier.status(self.summary())
        if self._half_s is None or now_s < self._due_s or not self._liveness.is_well:
            return
        if self.notifier.alive():
            # A beat may be late by one interval; systemd asks for one in half its time.
            self._due_s = now_s + self._half_s - self.every_s

    def summary(self) -> str:
        """Every device with its state, in one line."""
        return "; ".join(map(_summary, self._liveness.boards))


def _summary(board: StatusBoard) -> str:
    now = board.now
    return f"{board.name} is {now.state}" + (f": {now.cause}" if now.cause else "")
