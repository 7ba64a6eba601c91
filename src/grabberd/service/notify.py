"""What systemd is told: that the daemon serves, how it fares, that it lives, that it ends (sd_notify(3))."""

import logging
import os
import socket
from collections.abc import MutableMapping

log = logging.getLogger(__name__)

PATIENCE_S = 5.0
"""With what is said only once: a daemon whose readiness is not heard is taken for one that does not start."""


class Notifier:
    """Sends words to the socket that systemd names; where there is none, to nobody.

    Attributes:
        watchdog_s: how long the daemon may be silent before it is killed, or None where nobody watches it.
    """

    def __init__(self, address: str | None = None, watchdog_s: float | None = None) -> None:
        self.watchdog_s = watchdog_s
        self._address = address
        self._status: str | None = None
        self._unheard = False

    @classmethod
    def from_environment(cls, environment: MutableMapping[str, str]) -> "Notifier":
        """What the environment names: NOTIFY_SOCKET, WATCHDOG_USEC, WATCHDOG_PID.

        They are taken out of it, so that no child speaks in the daemon's name.
        """
        address = environment.pop("NOTIFY_SOCKET", None) or None
        timeout_us = environment.pop("WATCHDOG_USEC", "")
        watched = environment.pop("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        return cls(address, int(timeout_us) / 1e6 if watched and timeout_us.isdigit() else None)

    def ready(self) -> None:
        """The API serves."""
        self._send("READY=1", PATIENCE_S)

    def status(self, words: str) -> None:
        """How it fares, in one line; said again only when it has changed."""
        if words != self._status and self._send("STATUS=" + " ".join(words.split())):
            self._status = words

    def alive(self) -> bool:
        """It lives; returns whether that was heard, so that it can be said again."""
        return self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """It begins to end."""
        self._send("STOPPING=1", PATIENCE_S)

    def _send(self, words: str, patience_s: float = 0.0) -> bool:
        """A daemon that is not heard works on: systemd's own time-outs say the rest."""
        if self._address is None:
            return False
        name = "\0" + self._address[1:] if self._address.startswith("@") else self._address
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as speaking:
                speaking.settimeout(patience_s)
                speaking.sendto(words.encode(), name)
        except OSError as error:
            self._complain(words, error)
            return False
        self._unheard = False
        return True

    def _complain(self, words: str, error: OSError) -> None:
        """Once, until something is heard again."""
        if not self._unheard:
            log.warning("systemd cannot be told %s: %s", words.partition("=")[0], error)
        self._unheard = True
