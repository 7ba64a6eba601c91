"""Frames between the daemon and the process that reads contents of captures: questions, answers and errors.

A frame is the number of a reading, what the frame is, the length of what follows, and that.
"""

import json
import struct
from enum import IntEnum
from typing import NamedTuple

from grabberd.errors import (
    CaptureFileError,
    Cause,
    GrabberdError,
    LaterVersion,
    NotFound,
    ReadingGivenUp,
    StorageError,
)

HEAD = struct.Struct("!IBI")
"""Head of a frame: number of the reading, kind, bytes that follow."""
UNTIL = struct.Struct("!d")
"""The time until which a piece is waited for, by the monotonic clock, which all processes share."""


class Question(IntEnum):
    """Kind of a frame to the process."""

    READ = 0
    """Begins a reading: pickled name, arguments and end of the patience with it."""
    NEXT = 1
    """Asks for the next piece; the end of the patience with it."""
    GIVE_UP = 2
    """Ends a reading; not answered, unless what was asked before is."""


class Answer(IntEnum):
    """Kind of a frame from the process."""

    WHOLE = 0
    """All that was asked for."""
    BEGUN = 1
    """It comes in pieces, on request."""
    PIECE = 2
    END = 3
    """There is no further piece."""
    ERROR = 4
    """A `GrabberdError` as JSON; nothing follows."""


class Frame(NamedTuple):
    """A question or an answer: the number of its reading, its kind, and what it carries."""

    number: int
    kind: int
    content: bytes

    def packed(self) -> bytes:
        """The bytes that are sent."""
        return HEAD.pack(self.number, self.kind, len(self.content)) + self.content


KINDS: dict[str, type[GrabberdError]] = {
    kind.__name__: kind for kind in (CaptureFileError, LaterVersion, NotFound, ReadingGivenUp, StorageError)
}
"""Errors that are told by their kind; others by the nearest kind that they are of."""


def packed_error(error: Exception) -> bytes:
    """An error as JSON; one that the program did not mean to raise is told without a kind."""
    if isinstance(error, MemoryError):
        error = StorageError("reading it takes more memory than a reading may have", "ask for less at once")
    kind = next((one.__name__ for one in type(error).__mro__ if one.__name__ in KINDS), None)
    if kind is None or not isinstance(error, GrabberdError):
        return json.dumps({"message": f"{type(error).__name__}: {error}"}).encode()
    cause = getattr(error, "cause", None)
    return json.dumps({"kind": kind, "message": error.message, "hint": error.hint, "cause": cause}).encode()


def unpacked_error(content: bytes) -> Exception:
    """The error that `packed_error` has packed; a RuntimeError for one without a kind."""
    told = json.loads(content)
    if "kind" not in told:
        return RuntimeError(told["message"])
    kind = KINDS[told["kind"]]
    if issubclass(kind, StorageError) and told["cause"]:
        return kind(told["message"], told["hint"], Cause(told["cause"]))
    return kind(told["message"], told["hint"])
