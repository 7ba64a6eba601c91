"""Liveness: whether every capture thread goes on, looked at from the event loop."""

import logging
from collections.abc import Iterable

from grabberd.documents.states import DeviceState
from grabberd.instrument.device.status_board import STREAMING, StatusBoard

log = logging.getLogger(__name__)

STUCK_AFTER_S = 5.0
"""Silence after which a thread that takes fields is stuck: it beats fifty times a second."""
SLOW_AFTER_S = 15.0
"""The same while a device is opened or reset, which may take ten seconds. Also the silence after which the
daemon is to be restarted, unless systemd asks for signs of life more often."""
_IN_TIME_S = 2.5
"""Pause between two looks, after which the whole program may have stood still, and not a thread of it."""


class Liveness:
    """Finds capture threads that are stuck: in the kernel's driver, or in the program.

    The threads beat in every state, whatever their devices do.

    Args:
        boards: Status of each device.
        restart_after_s: Silence of a thread after which the daemon is to be restarted.
    """

    def __init__(self, boards: Iterable[StatusBoard], restart_after_s: float = SLOW_AFTER_S) -> None:
        self.boards = tuple(boards)
        self._restart_after_s = restart_after_s
        self._looked_s: float | None = None
        self._excused = False
        self._silent: tuple[str, ...] = ()

    def restart_after(self, seconds: float) -> None:
        """Sets the silence of a thread after which the daemon is to be restarted."""
        self._restart_after_s = seconds

    def look(self, now_s: float) -> None:
        """Looks at every thread; called about once a second.

        Args:
            now_s: Time of a clock that nobody sets.
        """
        before_s, self._looked_s = self._looked_s, now_s
        late = before_s is not None and now_s - before_s > _IN_TIME_S
        # Once only: an event loop that is always late has to find stuck threads all the same.
        self._excused = late and not self._excused
        if self._excused:
            return
        for board in self.boards:
            if board.silent_s > _limit_s(board):
                board.find_stuck()
        self._judge()

    @property
    def silent(self) -> tuple[str, ...]:
        """Devices whose threads have been silent for so long that the daemon is to be restarted."""
        return self._silent

    @property
    def is_well(self) -> bool:
        """True unless the daemon is to be restarted now: not while another device records."""
        return not self._silent or self._another_records()

    def _judge(self) -> None:
        limit_s = self._restart_after_s
        silent = tuple(board.name for board in self.boards if board.silent_s > limit_s)
        if silent and silent != self._silent:
            log.critical(
                "the capture thread of %s has not beaten for %.0f s: the watchdog may restart the daemon, "
                "when no other device records",
                " and ".join(silent),
                limit_s,
            )
        self._silent = silent

    def _another_records(self) -> bool:
        others = (board for board in self.boards if board.name not in self._silent)
        return any(board.state is DeviceState.CAPTURING for board in others)


def _limit_s(board: StatusBoard) -> float:
    return STUCK_AFTER_S if board.state in STREAMING else SLOW_AFTER_S
