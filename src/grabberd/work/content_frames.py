"""Frames between the daemon and the process that reads contents of captures: questions, answers and errors.

A frame is the number of a reading, what the frame is, the length of what follows, and that.
"""

import json
import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

from grabberd.errors import Cause, GrabberdError, ReadingGivenUp, StorageError
from grabberd.files.disk import is_for_want_of_memory

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

    def head(self) -> bytes:
        """The bytes that are sent before the content."""
        return HEAD.pack(self.number, self.kind, len(self.content))


def _kinds(family: type[GrabberdError]) -> Iterator[type[GrabberdError]]:
    """Errors of a family that are made of a message and a hint, or of these and a cause."""
    if family.__init__ in (GrabberdError.__init__, StorageError.__init__):
        yield family
    for kind in family.__subclasses__():
        yield from _kinds(kind)


KINDS: dict[str, type[GrabberdError]] = {
    kind.__name__: kind for kind in _kinds(GrabberdError) if kind is not GrabberdError
}
"""Errors that are told by their kind; others by the nearest kind that they are of, if there is one."""


def packed_error(error: Exception) -> bytes:
    """An error as JSON; one that the program did not mean to raise is told without a kind."""
    if is_for_want_of_memory(error):
        error = ReadingGivenUp(
            "there is not enough memory to read what was asked for", "ask for less, or later"
        )
    kind = next((one.__name__ for one in type(error).__mro__ if one.__name__ in KINDS), None)
    if kind is None or not isinstance(error, GrabberdError):
        return json.dumps({"message": f"{type(error).__name__}: {error}"}).encode()
    cause = getattr(error, "cause", None)
    return json.dumps({"kind": kind, "message": error.message, "hint": error.hint, "cause": cause}).encode()


def is_fault(content: bytes) -> bool:
    """True if a packed error is one that the program did not mean to raise."""
    return "kind" not in json.loads(content)


def unpacked_error(content: bytes) -> Exception:
    """The error that `packed_error` has packed; a RuntimeError for one without a kind."""
    told = json.loads(content)
    if "kind" not in told:
        return RuntimeError(told["message"])
    kind = KINDS[told["kind"]]
    if issubclass(kind, StorageError) and told["cause"]:
        return kind(told["message"], told["hint"], Cause(told["cause"]))
    return kind(told["message"], told["hint"])
