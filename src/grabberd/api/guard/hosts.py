"""By which name a request calls the daemon, and on whose page it was made.

A foreign page can make a browser in the barn ask anything of the daemon, and can give the daemon's address
to a name of its own (DNS rebinding). So both are checked for every request, with tokens or without. A port
is not: a tunnel changes it, and no page can choose what stands in front of it.
"""

import ipaddress
import re

from starlette.datastructures import Headers
from starlette.types import Scope

from grabberd.api.guard.front import Front
from grabberd.api.guard.refusals import Refusal

_HOST = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(:[0-9]{1,5})?")
UNSAFE = frozenset({"POST", "PUT", "PATCH", "DELETE"})
FOREIGN_SITES = frozenset({"cross-site", "same-site"})


def check_host(scope: Scope, front: Front) -> None:
    """Whether the request calls the daemon by a name of its own, or by the address that it came in on.

    Raises:
        Refusal: 421, it does not.
    """
    said = Headers(scope=scope).getlist("host")
    match = _HOST.fullmatch(said[0]) if len(said) == 1 else None
    name = match["name"].strip("[]").rstrip(".").lower() if match else ""
    if name not in front.hosts and not _is_own_address(name, scope):
        raise Refusal(
            421,
            "foreign-host",
            f"this daemon is not called {', '.join(said)[:100]!r}",
            "use its address, or add the name to http.hosts in its configuration",
        )


def _is_own_address(name: str, scope: Scope) -> bool:
    """An address cannot be rebound; it is ours if the connection came in on it."""
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
    """Whether the request was made on a page of the daemon's own, or on none.

    Raises:
        Refusal: 403, a foreign page made it.
    """
    headers = Headers(scope=scope)
    origin = headers.get("origin")
    if origin is not None and not _is_own_page(origin, headers, front):
        raise _foreign(f"the page {origin[:100]!r}")
    if headers.get("sec-fetch-site") in FOREIGN_SITES and not _follows_a_link(scope, headers):
        raise _foreign("a page of another site")


def check_page_is_named(scope: Scope) -> None:
    """Whether a request that a browser's session carries, and that changes something, says its page.

    Raises:
        Refusal: 403, it does not, so a foreign page may have made it.
    """
    changes = scope["type"] == "websocket" or scope["method"] in UNSAFE
    if changes and "origin" not in Headers(scope=scope):
        raise _foreign("a page that does not say which it is")


def _is_own_page(origin: str, headers: Headers, front: Front) -> bool:
    # Plain HTTP may stand behind a proxy that shows the certificate; TLS has no plain pages.
    schemes = ("https",) if front.tls else ("https", "http")
    return origin.lower() in {f"{scheme}://{headers['host'].lower()}" for scheme in schemes}


def _follows_a_link(scope: Scope, headers: Headers) -> bool:
    return scope.get("method") in ("GET", "HEAD") and headers.get("sec-fetch-mode") == "navigate"


def _foreign(who: str) -> Refusal:
    return Refusal(
        403,
        "foreign-page",
        f"{who} may not use this daemon",
        "open the daemon's own page; scripts send no Origin",
    )
