"""Downloads: files that are made while they are sent, and files that must not change while they are sent."""

import logging
import os
from collections.abc import AsyncIterator, Callable
from typing import Any, Protocol

from fastapi.responses import StreamingResponse
from starlette.concurrency import iterate_in_threadpool
from starlette.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send

log = logging.getLogger(__name__)


class Source(Protocol):
    """Maker of the pieces of a download, in threads or in a process."""

    def close(self) -> None:
        """Makes no further piece; safe twice."""


class Download(StreamingResponse):
    """A file made piece by piece; its source is closed as soon as the client has gone.

    Attributes:
        source: Makes the pieces.
        pieces: Has them made.
    """

    source: Source
    pieces: Callable[[Any], AsyncIterator[str | bytes]] = staticmethod(iterate_in_threadpool)

    async def stream_response(self, send: Send) -> None:
        """Sends the pieces."""
        self.body_iterator = self.pieces(self.source)
        try:
            await super().stream_response(send)
        finally:
            self.source.close()


def download(source: Source, media_type: str, name: str) -> Download:
    """A download that the client saves under a name."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    answer = Download((), media_type=media_type, headers=headers)
    answer.source = source
    return answer


class _Changed(Exception):
    """The file has changed since the download began."""


class WholeFile(FileResponse):
    """A file download that aborts if the file is written meanwhile, as when a run is added to a capture.

    The client knows the length, so it notices that the file is incomplete and retries; half of the old file
    followed by half of the new one would look like a whole capture.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Sends the file."""
        began = _version(self.stat_result or os.stat(self.path))

        async def send_if_same(message: Message) -> None:
            if message.get("body") and _version(os.stat(self.path)) != began:
                raise _Changed
            await send(message)

        try:
            await super().__call__(scope, receive, send_if_same)
        except (_Changed, FileNotFoundError):
            log.warning(
                "%s has changed while a client was downloading it: the client has to retry", self.path
            )


def _version(stat: os.stat_result) -> tuple[int, int]:
    return stat.st_mtime_ns, stat.st_size
