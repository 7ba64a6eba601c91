"""Lines out of bytes that come in pieces."""

import re
from collections.abc import Sequence

LONGEST = 4096
"""Bytes of the longest line."""
_END = re.compile(rb"[\r\n]+")


class LineBuffer:
    """Puts pieces together; a line without an end is dropped, so that memory stays small."""

    def __init__(self) -> None:
        self._rest = b""
        self._is_overlong = False

    def clear(self) -> None:
        """Forget the piece of a line that has come so far."""
        self._rest, self._is_overlong = b"", False

    def push_back(self, data: bytes) -> None:
        """Put bytes before what has come since the last complete line."""
        self._rest = data + self._rest

    def feed(self, data: bytes) -> tuple[Sequence[str], int]:
        """The lines that are complete now, without empty ones, and the number of those too long to be one."""
        *whole, self._rest = _END.split(self._rest + data)
        overlong = 0
        if whole and self._is_overlong:
            del whole[0]  # the end of one that was counted
            self._is_overlong = False
        if len(self._rest) > LONGEST:
            overlong += not self._is_overlong
            self._rest, self._is_overlong = b"", True
        overlong += sum(len(line) > LONGEST for line in whole)
        lines = (line.decode("utf-8", "replace").strip() for line in whole if len(line) <= LONGEST)
        return [line for line in lines if line], overlong
