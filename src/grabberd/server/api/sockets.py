"""Listening sockets: inherited or bound, and private or public."""

import contextlib
import errno
import ipaddress
import os
import socket
import stat
from collections.abc import Iterable, MutableMapping, Sequence
from pathlib import Path

from grabberd.errors import ConfigError, Conflict, Problem

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
