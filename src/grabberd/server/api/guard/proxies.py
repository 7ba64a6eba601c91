"""Proxies in front of the daemon: whose word about their clients is believed."""

import ipaddress
from collections.abc import Iterable, Iterator

from starlette.datastructures import Headers
from starlette.types import Scope

UNIX = "unix"
"""Proxy that connects to a Unix socket, and so has no address."""
_SECURE = {"http": "https", "ws": "wss"}

Network = ipaddress.IPv4Network | ipaddress.IPv6Network


class Proxies:
    """The proxies of the configuration.

    `X-Forwarded-For` and `X-Forwarded-Proto` come from whoever sends them: they are believed of these alone.

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
        """True if the other end of a connection is one of them; None is that of a Unix socket."""
        if not address:
            return self._unix
        found = _address(address)
        return found is not None and any(found in network for network in self._networks)

    def seen_through(self, scope: Scope) -> Scope:
        """A request as if its client had sent it itself."""
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
        """The address nearest to the daemon that is none of the proxies; whatever stands before it may be
        invented by that client.
        """
        farthest = None
        for word in _from_last(headers, "x-forwarded-for"):
            address = _address(word)
            if address is None:
                break
            farthest = str(address)
            if not self.include(farthest):
                break
        return farthest


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        address = ipaddress.ip_address(text.strip("[]").partition("%")[0])
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def _from_last(headers: Headers, name: str) -> Iterator[str]:
    words = ",".join(headers.getlist(name)).split(",")
    return (word.strip() for word in reversed(words))


def _last(headers: Headers, name: str) -> str:
    return next(_from_last(headers, name))
