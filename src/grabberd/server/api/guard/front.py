"""The daemon's public face: its host names, TLS and limits, its proxies, and the origins that it accepts.

A foreign page can make a browser in the barn send any request to the daemon, and can point a name of its own
at the daemon's address (DNS rebinding). Therefore host and origin are checked for every request, with or
without tokens. The port is not checked: a tunnel changes it, and no page can choose the host in front of it.
"""

import ipaddress
import re
import socket
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from starlette.datastructures import Headers
from starlette.types import Scope

from grabberd.config import HttpConfig, HttpLimits
from grabberd.server.api.problems import Refusal
from grabberd.server.api.sockets import ip_address

UNIX = "unix"
"""Proxy that connects to a Unix socket, and so has no address."""
_SECURE = {"http": "https", "ws": "wss"}

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class Proxies:
    """The configured proxies.

    Anyone can send `X-Forwarded-For` and `X-Forwarded-Proto`: only these proxies are trusted.

    Args:
        addresses: Their addresses or networks, and `unix`.
    """

    def __init__(self, addresses: Iterable[str] = ()) -> None:
        given = set(addresses)
        self._unix = UNIX in given
        self._networks: tuple[Network, ...] = tuple(
            ipaddress.ip_network(one, strict=False) for one in sorted(given - {UNIX})
        )

    def include(self, address: str | None) -> bool:
        """True if the peer of a connection is one of them; None stands for a Unix socket."""
        if not address:
            return self._unix
        found = ip_address(address)
        return found is not None and any(found in network for network in self._networks)

    def seen_through(self, scope: Scope) -> Scope:
        """The request as the proxy received it from its client."""
        client = scope.get("client")
        if not self.include(client[0] if client else None):
            return scope
        headers = Headers(scope=scope)
        scheme = scope["scheme"]
        if _last(headers, "x-forwarded-proto").lower() == "https":
            scheme = _SECURE.get(scheme, scheme)
        address = self._client(headers)
        return {**scope, "scheme": scheme, "client": client if address is None else (address, 0)}

    def _client(self, headers: Headers) -> str | None:
        """The last address that is not a proxy's; that client may have invented all addresses before it."""
        farthest = None
        for word in _from_last(headers, "x-forwarded-for"):
            address = ip_address(word)
            if address is None:
                break
            farthest = str(address)
            if not self.include(farthest):
                break
        return farthest


def _from_last(headers: Headers, name: str) -> Iterator[str]:
    words = ",".join(headers.getlist(name)).split(",")
    return (word.strip() for word in reversed(words))


def _last(headers: Headers, name: str) -> str:
    return next(_from_last(headers, name))


LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class Front:
    """The daemon as its clients see it; by default, on a loopback address.

    Attributes:
        hosts: Host names and addresses that requests may use, in lower case, without ports. The names of
            loopback are always valid on loopback addresses.
        tls: True if it serves TLS.
        private: True if its sockets can be reached only from this machine, so that tokens are optional.
        limits: Limits for one client.
        proxies: Trusted proxies.
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


_HOST = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?")
UNSAFE = frozenset({"POST", "PUT", "PATCH", "DELETE"})
FOREIGN_SITES = frozenset({"cross-site", "same-site"})


def check_host(scope: Scope, front: Front) -> None:
    """Checks that a request uses one of the daemon's names, or the address on which it came in.

    The names of loopback are valid only on its addresses and on Unix sockets: a request from another computer
    would use them only to bypass a rule of a proxy.

    Raises:
        Refusal: 421, it uses another name.
    """
    given = Headers(scope=scope).getlist("host")
    match = _HOST.fullmatch(given[0]) if len(given) == 1 else None
    name = match["name"].strip("[]").rstrip(".").lower() if match else ""
    if not (name in front.hosts or _is_own_address(name, scope) or _is_loopback(name, scope)):
        raise Refusal(
            421,
            "foreign-host",
            f"this daemon does not have the name {', '.join(given)[:100]!r}",
            "use its address, or add the name to http.hosts in its configuration",
        )


def _is_loopback(name: str, scope: Scope) -> bool:
    """True if the name is one of loopback's and the connection arrived on loopback or a Unix socket."""
    server = scope.get("server")
    if name not in LOOPBACK_NAMES:
        return False
    address = ip_address(str(server[0])) if server else None
    return address is None or address.is_loopback  # without one it is a Unix socket


def _is_own_address(name: str, scope: Scope) -> bool:
    """True if the name is the address on which the connection arrived; an address cannot be rebound."""
    server = scope.get("server")
    if not name or not server:
        return False
    address = ip_address(name)
    return address is not None and address == ip_address(str(server[0]))


def check_page(scope: Scope, front: Front) -> None:
    """Checks that a request comes from one of the daemon's own pages, or from no page.

    Raises:
        Refusal: 403, it comes from a foreign page.
    """
    headers = Headers(scope=scope)
    origin = headers.get("origin")
    if origin is not None and not _is_own_page(origin, headers, front):
        raise _foreign(f"the page {origin[:100]!r}")
    if headers.get("sec-fetch-site") in FOREIGN_SITES and not _follows_a_link(scope, headers):
        raise _foreign("a page of another site")


def check_page_is_named(scope: Scope) -> None:
    """Checks that a request with a session cookie that changes something names its origin.

    Raises:
        Refusal: 403, it does not, so a foreign page may have sent it.
    """
    changes = scope["type"] == "websocket" or scope["method"] in UNSAFE
    if changes and "origin" not in Headers(scope=scope):
        raise _foreign("a page that does not name its origin")


def _is_own_page(origin: str, headers: Headers, front: Front) -> bool:
    # A proxy may terminate TLS in front of plain HTTP; a daemon with TLS serves no plain pages.
    schemes = ("https",) if front.tls else ("https", "http")
    return origin.lower() in {f"{scheme}://{headers['host'].lower()}" for scheme in schemes}


def _follows_a_link(scope: Scope, headers: Headers) -> bool:
    return scope.get("method") in ("GET", "HEAD") and headers.get("sec-fetch-mode") == "navigate"


def _foreign(who: str) -> Refusal:
    return Refusal(
        403,
        "foreign-page",
        f"{who} may not use this daemon",
        "open the daemon's own page; scripts must not send Origin",
    )
