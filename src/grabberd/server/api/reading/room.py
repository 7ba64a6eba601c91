"""Room for heavy reads, in threads or in the process for contents: how many may wait, and for how long."""

from contextlib import suppress

from starlette.types import Receive

from grabberd.config import HttpLimits
from grabberd.server.api.guard.refusals import Refusal

WAITING_A_THREAD = 4
"""Reads that may wait for each thread: a page asks for several things at once."""
RETRY_S = 2


def check_room(count: int, limits: HttpLimits) -> None:
    """Refuses a read if too many wait already.

    Args:
        count: Number of reads that run or wait.
        limits: Their number of threads.

    Raises:
        Refusal: 503.
    """
    if count >= limits.reads * (1 + WAITING_A_THREAD):
        raise Refusal(
            503,
            "too-many-reads",
            f"{count} requests that read captures run or wait already",
            "try again in a moment; the state and running captures are not affected",
            {"Retry-After": str(RETRY_S)},
        )


async def client_left(receive: Receive) -> None:
    """Waits until the client of a request has left, or has sent what is refused."""
    with suppress(Exception):
        while (await receive())["type"] != "http.disconnect":
            pass
