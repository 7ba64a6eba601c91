"""Notifications to systemd: ready, status, watchdog, stopping (sd_notify(3))."""

import logging
import os
import socket
from collections.abc import MutableMapping

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
