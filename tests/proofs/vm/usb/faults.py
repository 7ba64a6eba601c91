"""What goes wrong on the bus or in a grabber, by field."""

from typing import NamedTuple


class Fault:
    """Kinds of them; what the argument means stands behind."""

    LOST = "lost"
    """Parts of a field, by their index among them: first and number; negative: from its end."""
    FIELD = "field"
    """A whole field."""
    GARBLED = "garbled"
    """The head of a part, by its index."""
    REPEATED_ID = "repeated id"
    """The frame's number is that of the frame before."""
    SAME_PARITY = "same parity"
    """The field says that it is of the other parity."""
    SILENCE = "silence"
    """Seconds for which nothing is sent after it."""
    SHORT = "short"
    """Bytes that lack at the end of a packet, by its index: index and bytes."""


class Due(NamedTuple):
    """A fault of one field.

    Attributes:
        field: The camera's number of it.
        kind: Of `Fault`.
        arguments: See there.
    """

    field: int
    kind: str
    arguments: tuple[float, ...] = ()


class Script:
    """Faults to come.

    Attributes:
        done: Those that have happened.
    """

    def __init__(self) -> None:
        self._due: list[Due] = []
        self.done: list[Due] = []

    def add(self, due: Due) -> None:
        """One more."""
        self._due.append(due)

    def of(self, field: int) -> list[Due]:
        """Those of a field, which happen now."""
        found = [one for one in self._due if one.field == field]
        self._due = [one for one in self._due if one.field > field]
        self.done += found
        return found


def without(parts: list[bytes], first: int, count: int = 1) -> list[bytes]:
    """Parts of a field that are left when some are lost; see `Fault.LOST`."""
    begin = first % len(parts)
    return parts[:begin] + parts[begin + count :]
