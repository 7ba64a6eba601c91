"""How the daemon is reached from outside: what the checks of every request go by."""

import socket
from dataclasses import dataclass, field

from grabberd.config import HttpConfig, HttpLimits

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class Front:
    """The daemon as its clients see it; by default, as it is on a loopback address.

    Attributes:
        hosts: names and addresses by which it may be called, in lower case, without ports.
        tls: it shows a certificate.
        private: its sockets are reached from this machine alone, so that tokens are optional.
        limits: what one client can ask of it.
    """

    hosts: frozenset[str] = LOOPBACK_NAMES
    tls: bool = False
    private: bool = True
    limits: HttpLimits = field(default_factory=HttpLimits)

    @classmethod
    def from_config(cls, http: HttpConfig, private: bool) -> "Front":
        """As it is configured; beyond this machine it answers to the machine's own name, too."""
        own = frozenset() if private else _own_names()
        return cls(LOOPBACK_NAMES | own | frozenset(http.hosts), http.tls is not None, private, http.limits)


def _own_names() -> frozenset[str]:
    name = socket.gethostname().lower()
    return frozenset({name, f"{name.partition('.')[0]}.local"})
