"""Host names and origins: by which name the daemon is called, and by whose page.

A foreign page can make a browser in the barn send any request to the daemon, and can point a name of its own
at the daemon's address (DNS rebinding). Therefore both are checked for every request, with or without tokens.
The port is not checked: a tunnel changes it, and a page cannot choose the host in front of it.
"""

import ipaddress
import re

from starlette.datastructures import Headers
from starlette.types import Scope

from grabberd.server.api.guard.front import LOOPBACK_NAMES, Front
from grabberd.server.api.guard.refusals import Refusal

_HOST = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?")
UNSAFE = frozenset({"POST", "PUT", "PATCH", "DELETE"})
FOREIGN_SITES = frozenset({"cross-site", "same-site"})


def check_host(scope: Scope, front: Front) -> None:
    """Checks that a request uses one of the daemon's names, or the address on which it came in.

    The names of loopback are valid on its addresses and on Unix sockets: nobody calls the daemon by them from
    another computer, unless to get past a rule of somebody's proxy.

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
    """True if the name is one of loopback's, and the connection came in there or on a Unix socket."""
    server = scope.get("server")
    if name not in LOOPBACK_NAMES:
        return False
    try:
        return not server or _address(str(server[0])).is_loopback
    except ValueError:  # the path of a Unix socket
        return True


def _is_own_address(name: str, scope: Scope) -> bool:
    """True if the name is the address the connection came in on; an address cannot be rebound."""
    server = scope.get("server")
    if not name or not server:
        return False
    try:
        return _address(name) == _address(str(server[0]))
    except ValueError:
        return False


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    address = ipaddress.ip_address(text.partition("%")[0])
    return getattr(address, "ipv4_mapped", None) or address


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
