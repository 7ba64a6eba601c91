"""Notifications to systemd (sd_notify(3)): ready, status, stopping, and the heartbeat for its watchdog.

The heartbeat tells that the daemon lives while its event loop and every capture thread do.
"""

import logging
import os
import socket
from collections.abc import MutableMapping

from grabberd.instrument.device.status_board import Liveness, StatusBoard

log = logging.getLogger(__name__)

PATIENCE_S = 5.0
"""Longest wait to send what is sent only once: without READY=1 systemd would take the start for failed."""


class Notifier:
    """Sends messages to the socket that systemd names; to nobody if it names none.

    Attributes:
        watchdog_s: Silence after which systemd kills the daemon, or None if there is no watchdog.
    """

    def __init__(self, address: str | None = None, watchdog_s: float | None = None) -> None:
        self.watchdog_s = watchdog_s
        self._address = address
        self._status: str | None = None
        self._unheard = False

    @classmethod
    def from_environment(cls, environment: MutableMapping[str, str]) -> "Notifier":
        """Makes a notifier from NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID.

        They are removed from the environment, so that no child process speaks in the daemon's name.
        """
        address = environment.pop("NOTIFY_SOCKET", None) or None
        timeout_us = environment.pop("WATCHDOG_USEC", "")
        watched = environment.pop("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        return cls(address, int(timeout_us) / 1e6 if watched and timeout_us.isdigit() else None)

    def ready(self) -> None:
        """Tells that the API serves."""
        self._send("READY=1", PATIENCE_S)

    def status(self, line: str) -> None:
        """Tells the daemon's status in one line; sent only if it has changed."""
        if line != self._status and self._send("STATUS=" + " ".join(line.split())):
            self._status = line

    def alive(self) -> bool:
        """Tells that the daemon lives; returns False if that was not received and must be sent again."""
        return self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Tells that the daemon begins to stop."""
        self._send("STOPPING=1", PATIENCE_S)

    def _send(self, message: str, patience_s: float = 0.0) -> bool:
        """Sends a message; returns False if it was not received.

        The daemon works on all the same: systemd's own time-outs decide what becomes of it.
        """
        if self._address is None:
            return False
        # A leading @ stands for an abstract socket, whose name begins with a zero byte.
        name = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
                sender.settimeout(patience_s)
                sender.sendto(message.encode(), name)
        except OSError as error:
            self._complain(message, error)
            return False
        self._unheard = False
        return True

    def _complain(self, message: str, error: OSError) -> None:
        """Logs the first failure after a success."""
        if not self._unheard:
            log.warning("%s cannot be sent to systemd: %s", message.partition("=")[0], error)
        self._unheard = True


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
            liveness.restart_after_s = self._half_s

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
