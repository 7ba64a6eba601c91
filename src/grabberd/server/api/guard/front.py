"""The daemon's public face: its host names, TLS, and limits, which the checks of every request use."""

import socket
from dataclasses import dataclass, field

from grabberd.config import HttpConfig, HttpLimits
from grabberd.server.api.guard.proxies import Proxies

LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class Front:
    """The daemon as its clients see it; by default, on a loopback address.

    Attributes:
        hosts: Host names and addresses that requests may use, in lower case, without ports. Those of loopback
            are valid on its own addresses anyway.
        tls: True if it serves TLS.
        private: True if its sockets can be reached only from this machine, so that tokens are optional.
        limits: Limits for one client.
        proxies: Proxies that are believed what they report about their clients.
    """

    hosts: frozenset[str] = frozenset()
    tls: bool = False
    private: bool = True
    limits: HttpLimits = field(default_factory=HttpLimits)
    proxies: Proxies = field(default_factory=Proxies)

    @classmethod
    def from_config(cls, http: HttpConfig, private: bool) -> "Front":
        """The front of a configuration; if not private, the machine's own name is added to the hosts."""
        own = frozenset() if private else _own_names()
        hosts = own | frozenset(http.hosts)
        return cls(hosts, http.tls is not None, private, http.limits, Proxies(http.proxies))


def _own_names() -> frozenset[str]:
    name = socket.gethostname().lower()
    return frozenset({name, f"{name.partition('.')[0]}.local"})
