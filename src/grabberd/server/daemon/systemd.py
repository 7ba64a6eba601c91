"""Notifications to systemd (sd_notify(3)): ready, status, stopping, and the heartbeat for its watchdog.

The heartbeat is sent only while the event loop and every capture thread are alive.
"""

import logging
import os
import socket
from collections.abc import MutableMapping

from grabberd.instrument.device.status_board import Liveness, StatusBoard

log = logging.getLogger(__name__)

PATIENCE_S = 5.0
"""Longest wait for messages that are sent once: without READY=1, systemd considers the start failed."""


class Notifier:
    """Sends messages to systemd's notification socket; does nothing without one.

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
        """Reports that the API is serving."""
        self._send("READY=1", PATIENCE_S)

    def status(self, line: str) -> None:
        """Reports the daemon's status in one line; sent only if it has changed."""
        if line != self._status and self._send("STATUS=" + " ".join(line.split())):
            self._status = line

    def alive(self) -> bool:
        """Sends a heartbeat; returns False if it was not received and must be repeated."""
        return self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """Reports that the daemon is stopping."""
        self._send("STOPPING=1", PATIENCE_S)

    def _send(self, message: str, patience_s: float = 0.0) -> bool:
        """Sends a message; returns False if it was not received.

        The daemon continues either way: systemd's own timeouts apply.
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
"""Interval at which `systemctl status` is updated."""


class Heartbeat:
    """Sends the watchdog heartbeat; the event loop calls `beat`, so it stops if the event loop hangs.

    If a capture thread is silent for half of the watchdog's time, the heartbeat is withheld and systemd
    restarts the daemon. While another device is recording, the restart waits for that capture to end.

    Args:
        notifier: Sends to systemd.
        liveness: Checks the capture threads with every beat, with or without a watchdog.

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
        """Checks the capture threads and sends what is due.

        Args:
            now_s: Time of a clock that is never set.
        """
        self._liveness.look(now_s)
        self.notifier.status(self.summary())
        if self._half_s is None or now_s < self._due_s or not self._liveness.is_well:
            return
        if self.notifier.alive():
            # A beat may be one interval late; systemd recommends one in half of the watchdog's time.
            self._due_s = now_s + self._half_s - self.every_s

    def summary(self) -> str:
        """Every device with its state, in one line."""
        return "; ".join(map(_summary, self._liveness.boards))


def _summary(board: StatusBoard) -> str:
    now = board.now
    return f"{board.name} is {now.state}" + (f": {now.cause}" if now.cause else "")
