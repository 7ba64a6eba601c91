"""The daemon's public face: its sockets, host names, TLS and limits, its proxies, and the origins it accepts.

A foreign page can make a browser in the barn send any request to the daemon, and can point a name of its own
at the daemon's address (DNS rebinding). Therefore host and origin are checked for every request, with or
without tokens. The port is not checked: a tunnel changes it, and no page can choose the host in front of it.
"""

import contextlib
import errno
import ipaddress
import os
import re
import socket
import stat
from collections.abc import Iterable, Iterator, MutableMapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from starlette.datastructures import Headers
from starlette.types import Scope

from grabberd.config import HttpConfig, HttpLimits
from grabberd.errors import ConfigError, Conflict, Problem
from grabberd.server.api.problems import Refusal

FIRST_INHERITED = 3
BACKLOG = 128
GONE_AFTER_MS = 30_000
"""Time without acknowledgement after which a client counts as disconnected."""
UNSENT_BYTES = 131_072
"""Bytes that the kernel buffers for a client that does not read, before writing to it blocks."""
_ALL_ADDRESSES = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}  # noqa: S104 - compared, never bound
"""The wildcard addresses, each with its loopback address."""


def inherited(environment: MutableMapping[str, str]) -> list[socket.socket]:
    """The sockets passed by systemd (LISTEN_PID, LISTEN_FDS); empty if there are none.

    The variables are removed from the environment, so that no child process uses the sockets.

    Raises:
        Conflict: The descriptors do not exist, or are not sockets.
    """
    count = environment.pop("LISTEN_FDS", "0")
    environment.pop("LISTEN_FDNAMES", None)
    if environment.pop("LISTEN_PID", "") != str(os.getpid()) or not count.isdigit():
        return []
    try:
        return [_take(FIRST_INHERITED + n) for n in range(int(count))]
    except OSError as error:
        raise Conflict(
            f"the {count} sockets passed on by systemd cannot be used: {error.strerror}",
            "check the socket unit (ListenStream=), or start without it",
        ) from error


def bind(host: str, port: int) -> list[socket.socket]:
    """A listening socket for every address that a host name or address resolves to.

    Raises:
        Conflict: None of the addresses can be bound.
    """
    bound: list[socket.socket] = []
    try:
        for address in _addresses(host, port):
            bound.append(_listen(address))
    except OSError as error:
        if not bound:  # "localhost" resolves to ::1 even on a machine without IPv6
            raise _refused(host, port, error) from error
    return bound


def _refused(host: str, port: int, error: OSError) -> Conflict:
    """The error for an address that cannot be bound, with a hint for its cause."""
    other = "serve on another: grabberd serve --port N, make run PORT=N, or http.port in the configuration"
    if error.errno == errno.EADDRINUSE:
        return Conflict(
            f"port {port} of {host} is in use: another program listens there, perhaps a grabberd that runs "
            "already",
            f"ss -ltnp 'sport = :{port}' shows which; stop it, or {other}",
        )
    if error.errno == errno.EACCES:
        return Conflict(f"port {port} of {host} is for root only", f"take one from 1024 on; {other}")
    return Conflict(
        f"cannot listen on {host} port {port}: {error.strerror}",
        "this machine may not have the address: give one of its own, such as 127.0.0.1, with --host, or as "
        "http.host in the configuration",
    )


def ip_address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """Parses an IP address, without its zone, an IPv4-mapped one as IPv4; None if the text is not one."""
    try:
        address = ipaddress.ip_address(text.strip("[]").partition("%")[0])
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def is_private(listening: socket.socket) -> bool:
    """True if a socket can be reached only from this machine, judged by its address, not by a setting.

    A Unix socket is private unless its file is world-writable.
    """
    name = listening.getsockname()
    if listening.family in (socket.AF_INET, socket.AF_INET6):
        address = ip_address(str(name[0]))
        return address is not None and address.is_loopback
    if listening.family == socket.AF_UNIX:
        return _is_private_file(name)
    return False


def check_private(sockets: Iterable[socket.socket], needs_token: bool, file: Path) -> None:
    """Checks that public sockets are protected by tokens.

    Raises:
        ConfigError: A socket can be reached from other machines, and no token is required.
    """
    public = [describe(one) for one in sockets if not is_private(one)]
    if public and not needs_token:
        message = (
            f"{', '.join(public)} is not a loopback address, and there are no tokens to control access; "
            "make one: grabberd token add NAME --role admin"
        )
        raise ConfigError([Problem(str(file), "http.host", message)])


def describe(listening: socket.socket, scheme: str = "http") -> str:
    """A socket's address as a URL."""
    name = listening.getsockname()
    if listening.family == socket.AF_INET6:
        return f"{scheme}://[{name[0]}]:{name[1]}"
    if listening.family == socket.AF_INET:
        return f"{scheme}://{name[0]}:{name[1]}"
    return f"{scheme}+unix:{name!s}"


def to_open(sockets: Iterable[socket.socket], scheme: str, hosts: Sequence[str] = ()) -> str | None:
    """The URL to open in a browser on this machine; None if no socket has one.

    Args:
        sockets: The listening sockets.
        scheme: http or https.
        hosts: Configured host names, used for a socket on a wildcard address.
    """
    for one in sockets:
        if one.family not in (socket.AF_INET, socket.AF_INET6):
            continue
        address, port = one.getsockname()[:2]
        if address not in _ALL_ADDRESSES:
            return describe(one, scheme)
        return f"{scheme}://{hosts[0] if hosts else _ALL_ADDRESSES[address]}:{port}"
    return None


def _is_private_file(name: str | bytes) -> bool:
    if not name or name[:1] in ("\0", b"\0"):
        return False  # an abstract socket has no permissions: every process may connect
    with contextlib.suppress(OSError):
        return not stat.S_IMODE(os.stat(name).st_mode) & stat.S_IWOTH
    return False


def _addresses(host: str, port: int) -> Sequence[tuple[socket.AddressFamily, tuple[object, ...]]]:
    found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    return list(dict.fromkeys((family, address) for family, _, _, _, address in found))


def _listen(address: tuple[socket.AddressFamily, tuple[object, ...]]) -> socket.socket:
    one = socket.socket(address[0], socket.SOCK_STREAM)
    try:
        # Connections of a daemon that has just ended occupy the port for a minute (TIME_WAIT).
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if address[0] == socket.AF_INET6:
            # Otherwise a socket on [::] would take the IPv4 port as well, which has its own socket.
            one.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        _prepare(one)
        one.bind(address[1])
        one.listen(BACKLOG)
    except OSError:
        one.close()
        raise
    return one


def _take(descriptor: int) -> socket.socket:
    one = socket.socket(fileno=descriptor)
    os.set_inheritable(descriptor, False)
    _prepare(one)
    return one


def _prepare(one: socket.socket) -> None:
    one.setblocking(False)
    if one.family in (socket.AF_INET, socket.AF_INET6):  # accepted connections inherit it
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, GONE_AFTER_MS)
        # The kernel would otherwise buffer megabytes for an event client that never reads.
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT_BYTES)
        # Headers and body of a response are written separately: without this, the body would wait until the
        # headers are acknowledged.
        one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


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
        if next(_from_last(headers, "x-forwarded-proto")).lower() == "https":
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
