"""Downloads: files generated while they are sent, and files that must not change while they are sent."""

import io
import logging
import os
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Protocol

from anyio import AsyncFile, wrap_file
from fastapi.responses import StreamingResponse
from starlette.concurrency import iterate_in_threadpool, run_in_threadpool
from starlette.responses import FileResponse
from starlette.types import Message, Receive, Scope, Send
from typing_extensions import Buffer

from grabberd.errors import GrabberdError
from grabberd.files.disk import hold

log = logging.getLogger(__name__)


class Source(Protocol):
    """Source of the pieces of a download."""

    def close(self) -> None:
        """Stops making pieces; may be called twice."""


class Download(StreamingResponse):
    """A file sent piece by piece; its source is closed as soon as the client disconnects.

    The first piece is made before the head is sent: until then, an error is answered as any other. A later
    one cuts the answer off, without its end, so that nobody takes it for whole.

    Attributes:
        source: Source of the pieces.
        pieces: Iterates over the source, in threads or in another process.
    """

    source: Source
    pieces: Callable[[Any], AsyncIterator[str | bytes]] = staticmethod(iterate_in_threadpool)

    async def stream_response(self, send: Send) -> None:
        """Sends the pieces.

        Raises:
            GrabberdError: The first piece cannot be made.
        """
        try:
            pieces = aiter(self.pieces(self.source))
            self.body_iterator = _all_of(await anext(pieces, b""), pieces)
            await super().stream_response(send)
        except _CutOff as error:
            log.warning("a download ends early: %s", error)
        finally:
            self.source.close()


class _CutOff(Exception):
    """The rest of a download cannot be made."""


async def _all_of(first: str | bytes, others: AsyncIterator[str | bytes]) -> AsyncIterator[str | bytes]:
    yield first
    try:
        async for piece in others:
            yield piece
    except GrabberdError as error:
        raise _CutOff(error.message) from error


def download(source: Source, media_type: str, name: str = "") -> Download:
    """A download, with a file name if it has one."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'} if name else {}
    answer = Download((), media_type=media_type, headers=headers)
    answer.source = source
    return answer


class _Changed(Exception):
    """The file has changed since the download started."""


class WholeFile(FileResponse):
    """A file download that aborts if the file is written meanwhile, e.g. when a run is added to a capture.

    The client knows the length, so it notices the incomplete file and retries; half of the old file followed
    by half of the new one would look like a whole capture. The file is a database that this process may have
    open, so its descriptor is shared and held (`files.disk`).
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

    @asynccontextmanager
    async def _open_file(self) -> AsyncIterator[AsyncFile[bytes]]:
        with await run_in_threadpool(hold, Path(self.path)) as held:
            yield wrap_file(io.BufferedReader(_HeldFile(held.descriptor), self.chunk_size))


class _HeldFile(io.RawIOBase):
    """A file read through a shared descriptor, with its own position; it does not close the descriptor."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._position = 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Moves to an offset from the start, or from the current position; never from the end."""
        self._position = offset + (self._position if whence == os.SEEK_CUR else 0)
        return self._position

    def readinto(self, buffer: Buffer) -> int:
        read = os.preadv(self._descriptor, [buffer], self._position)
        self._position += read
        return read


def _version(stat: os.stat_result) -> tuple[int, int]:
    return stat.st_mtime_ns, stat.st_size
