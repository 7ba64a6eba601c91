"""The daemon's public face: its host names, TLS, and limits, which the checks of every request use."""

import socket
from dataclasses import dataclass, field

from grabberd.config import HttpConfig, HttpLimits

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class Front:
    """The daemon as its clients see it; by default, on a loopback address.

    Attributes:
        hosts: Host names and addresses that requests may use, in lower case, without ports.
        tls: True if it serves TLS.
        private: True if its sockets can be reached only from this machine, so that tokens are optional.
        limits: Limits for one client.
    """

    hosts: frozenset[str] = LOOPBACK_NAMES
    tls: bool = False
    private: bool = True
    limits: HttpLimits = field(default_factory=HttpLimits)

    @classmethod
    def from_config(cls, http: HttpConfig, private: bool) -> "Front":
        """The front of a configuration; if not private, the machine's own name is added to the hosts."""
        own = frozenset() if private else _own_names()
        return cls(LOOPBACK_NAMES | own | frozenset(http.hosts), http.tls is not None, private, http.limits)


def _own_names() -> frozenset[str]:
    name = socket.gethostname().lower()
    return frozenset({name, f"{name.partition('.')[0]}.local"})
