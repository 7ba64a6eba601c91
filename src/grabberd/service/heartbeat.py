"""Heartbeat: tells systemd that the daemon lives while its event loop and every capture thread do."""

import logging
from collections.abc import Iterable

from grabberd.documents.states import DeviceState
from grabberd.service.device.status_board import StatusBoard
from grabberd.service.notify import Notifier

log = logging.getLogger(__name__)

STATUS_EVERY_S = 1.0
"""Interval at which `systemctl status` is brought up to date."""


class Heartbeat:
    """Sends the watchdog's sign of life; the event loop calls `beat`, so it is sent only while that runs.

    A capture thread that is silent for half the watchdog's time holds it back, and systemd restarts the
    daemon. The threads beat in every state, whatever their devices do: silence is a fault of the program or
    of the kernel's driver. While another device records a capture, the restart waits for the capture's end.

    Args:
        notifier: Sends to systemd.
        boards: Status of each device.

    Attributes:
        every_s: Interval at which to call `beat`.
    """

    def __init__(self, notifier: Notifier, boards: Iterable[StatusBoard]) -> None:
        self.notifier = notifier
        self._boards = tuple(boards)
        self._half_s = None if notifier.watchdog_s is None else notifier.watchdog_s / 2
        self._due_s = 0.0
        self._silent: tuple[str, ...] = ()
        self.every_s = STATUS_EVERY_S if self._half_s is None else min(STATUS_EVERY_S, self._half_s / 4)

    def beat(self, now_s: float) -> None:
        """Sends what is due.

        Args:
            now_s: Time of a clock that nobody sets.
        """
        self.notifier.status(self.summary())
        if self._half_s is None or now_s < self._due_s or not self._all_live(self._half_s):
            return
        if self.notifier.alive():
            # A beat may be late by one interval; systemd asks for one in half its time.
            self._due_s = now_s + self._half_s - self.every_s

    def summary(self) -> str:
        """Every device with its state, in one line."""
        return "; ".join(map(_summary, self._boards))

    def _all_live(self, limit_s: float) -> bool:
        silent = tuple(board.name for board in self._boards if board.silent_s > limit_s)
        if silent and silent != self._silent:
            log.critical(
                "the capture thread of %s has not beaten for %.0f s: the watchdog may restart the daemon, "
                "when no other device records",
                " and ".join(silent),
                limit_s,
            )
        self._silent = silent
        return not silent or self._another_records()

    def _another_records(self) -> bool:
        others = (board for board in self._boards if board.name not in self._silent)
        return any(board.now.state is DeviceState.CAPTURING for board in others)


def _summary(board: StatusBoard) -> str:
    now = board.now
    return f"{board.name} is {now.state}" + (f": {now.cause}" if now.cause else "")
