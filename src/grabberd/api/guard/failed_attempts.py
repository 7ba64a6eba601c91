"""Failed attempts to authenticate: throttled for each client address, and logged from time to time."""

import ipaddress
import logging
import math
import time
from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from starlette.types import Scope

from grabberd.api.guard.refusals import Refusal
from grabberd.service.access import hash_of

log = logging.getLogger(__name__)

K = TypeVar("K")
V = TypeVar("V")

FREE_ATTEMPTS = 10
"""Without delay, because a page sends several requests at once and people mistype; then the wait doubles."""
LONGEST_WAIT_S = 60.0
FORGOTTEN_AFTER_S = 600.0
ADDRESSES = 1024
PROVEN = 256
LOG_EVERY_S = 60.0
UNIX = "this machine"


def client_of(scope: Scope) -> str:
    """The client that a limit counts: an IPv4 address, or the /64 in which an IPv6 host picks addresses."""
    client = scope.get("client")
    if not client or not client[0]:
        return UNIX
    try:
        address = ipaddress.ip_address(str(client[0]).partition("%")[0])
    except ValueError:
        return str(client[0])
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    return str(ipaddress.ip_network((address, 64), strict=False))


class _Record(NamedTuple):
    failures: int
    until_s: float


class Attempts:
    """Counts failures by client, with a bounded number of entries.

    Previously valid tokens bypass throttling, so guessing from a shared address locks nobody out.
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._records: OrderedDict[str, _Record] = OrderedDict()
        self._proven: OrderedDict[bytes, None] = OrderedDict()
        self._unlogged = 0
        self._log_at_s = -math.inf

    def check(self, client: str, secret: str) -> None:
        """Checks that a client may try now.

        Raises:
            Refusal: 429, the client has to wait; the secret is not checked.
        """
        record = self._records.get(client)
        wait_s = record.until_s - self._now_s() if record else 0.0
        if wait_s > 0 and hash_of(secret) not in self._proven:
            seconds = math.ceil(wait_s)
            raise Refusal(
                429,
                "too-many-attempts",
                f"too many invalid tokens came from {client}",
                f"try again in {seconds} s",
                {"Retry-After": str(seconds)},
            )

    def succeeded(self, client: str, secret: str) -> None:
        """Notes that a secret was valid."""
        self._records.pop(client, None)
        _touch(self._proven, hash_of(secret), None, PROVEN)

    def failed(self, client: str) -> None:
        """Notes that a secret was invalid."""
        now_s = self._now_s()
        before = self._records.get(client, _Record(0, now_s))
        failures = 1 if now_s - before.until_s > FORGOTTEN_AFTER_S else before.failures + 1
        _touch(self._records, client, _Record(failures, now_s + _wait_s(failures)), ADDRESSES)
        self._log(client, now_s)

    def _log(self, client: str, now_s: float) -> None:
        self._unlogged += 1
        if now_s < self._log_at_s:
            return
        log.warning("refused invalid tokens or sessions: %d, the last from %s", self._unlogged, client)
        self._unlogged, self._log_at_s = 0, now_s + LOG_EVERY_S


def _wait_s(failures: int) -> float:
    beyond = failures - FREE_ATTEMPTS
    return 0.0 if beyond <= 0 else min(2.0 ** min(beyond - 1, 10), LONGEST_WAIT_S)


def _touch(entries: OrderedDict[K, V], key: K, value: V, most: int) -> None:
    """Enters a key as the newest, and drops the oldest if there are too many."""
    entries[key] = value
    entries.move_to_end(key)
    if len(entries) > most:
        entries.popitem(last=False)
