"""Frames between a process and those that run functions for it: questions, answers and errors.

A frame is the number of a call, what the frame is, the length of what follows, and that. Questions are
pickled; answers never are: whatever a file has done to a process must not reach the one that asks.
"""

import json
import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import Any, NamedTuple

from grabberd.errors import Cause, GrabberdError, ReadingGivenUp, StorageError
from grabberd.files.disk import is_for_want_of_memory

HEAD = struct.Struct("!IBI")
"""Head of a frame: number of the call, kind, bytes that follow."""
NUMBER = struct.Struct("!d")
"""A time until which a piece is waited for, by the monotonic clock, which all processes share; or a share."""


class Question(IntEnum):
    """Kind of a frame to the process."""

    CALL = 0
    """Begins a call: a pickled `Call`."""
    NEXT = 1
    """Asks for the next piece; the end of the patience with it."""
    GIVE_UP = 2
    """Ends a call; not answered, unless what was asked before is."""


class Answer(IntEnum):
    """Kind of a frame from the process."""

    WHOLE = 0
    """All that was asked for, as bytes."""
    BEGUN = 1
    """It comes in pieces, on request."""
    PIECE = 2
    END = 3
    """There is no further piece."""
    ERROR = 4
    """A `GrabberdError` as JSON; nothing follows."""
    VALUE = 5
    """All that was asked for, as JSON."""
    PROGRESS = 6
    """The share that is done; the answer is still to come."""
    READY = 7
    """The process has started; of no call."""


class Call(NamedTuple):
    """A function and what it is called with.

    Attributes:
        function: `MODULE:NAME`; a generator of bytes or text answers in pieces.
        until_s: End of the patience with it; None: it takes as long as it takes.
        reports: True if it takes the keyword `progress`, and reports the share that is done.
    """

    function: str
    arguments: tuple[Any, ...]
    until_s: float | None = None
    reports: bool = False


class Frame(NamedTuple):
    """A question or an answer: the number of its call, its kind, and what it carries."""

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
"""Errors that are reported by their kind; others by the nearest kind that they are of, if there is one."""


def packed_error(error: Exception) -> bytes:
    """An error as JSON; one that the program did not mean to raise goes without a kind."""
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
    found = json.loads(content)
    if "kind" not in found:
        return RuntimeError(found["message"])
    kind = KINDS[found["kind"]]
    if issubclass(kind, StorageError) and found["cause"]:
        return kind(found["message"], found["hint"], Cause(found["cause"]))
    return kind(found["message"], found["hint"])
