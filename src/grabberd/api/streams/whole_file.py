"""A file as an answer: the whole of it as it was, or an answer that visibly breaks off."""

import logging
import os

from starlette.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send

log = logging.getLogger(__name__)


class _Changed(Exception):
    """The file is not the one that the client began to take."""


class WholeFile(FileResponse):
    """Breaks off when the file is written while it is sent, as when a run is added to a capture.

    The client has been told its length, so it knows that it has not got all, and asks again; half of the old
    file and half of the new one would look like a whole capture.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends it."""
        began = _version(self.stat_result or os.stat(self.path))

        async def send_if_same(message: Message) -> None:
            if message.get("body") and _version(os.stat(self.path)) != began:
                raise _Changed
            await send(message)

        try:
            await super().__call__(scope, receive, send_if_same)
        except (_Changed, FileNotFoundError):
            log.warning("%s has changed while a client took it home: the client has to ask again", self.path)


def _version(stat: os.stat_result) -> tuple[int, int]:
    return stat.st_mtime_ns, stat.st_size
