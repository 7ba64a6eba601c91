"""Answers that are made while they are sent."""

from collections.abc import Generator
from typing import TypeAlias

from fastapi.responses import StreamingResponse
from starlette.types import Send

Source: TypeAlias = Generator[str, None, None] | Generator[bytes, None, None]


class Download(StreamingResponse):
    """A file made piece by piece, whose source is let go of at once when its client has gone."""

    source: Source

    async def stream_response(self, send: Send) -> None:
        """Sends it."""
        try:
            await super().stream_response(send)
        finally:
            self.source.close()


def download(source: Source, media_type: str, name: str) -> Download:
    """A file of that name."""
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    answer = Download(source, media_type=media_type, headers=headers)
    answer.source = source
    return answer
