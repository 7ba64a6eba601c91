"""The faults of one grabber, looked up by field number."""

from collections.abc import Iterator, Sequence
from typing import TypeVar

from grabberd_fake.faults import Fault, Recoverable, Unplug, Wrap

F = TypeVar("F", bound=Fault)


class Script:
    """The faults of a grabber that gives so many fields a second, looked up by field number."""

    def __init__(self, faults: Sequence[Fault], rate_hz: float = Fault.rate_hz) -> None:
        self._faults = tuple(fault.paced(rate_hz) for fault in faults)
        self._cleared_at: dict[Fault, int] = {}

    def at(self, number: int, kind: type[F]) -> F | None:
        """The fault of this kind that affects a field, or None."""
        found = (fault for fault in self._faults if isinstance(fault, kind) and self._holds(fault, number))
        return next(found, None)

    def before(self, number: int, kind: type[F]) -> list[F]:
        """The faults of this kind that have begun by a field."""
        return [fault for fault in self._faults if isinstance(fault, kind) and fault.first <= number]

    def delivers(self, number: int) -> bool:
        """True if the field reaches the driver's buffers."""
        return all(fault.delivers or not self._holds(fault, number) for fault in self._faults)

    def clear(self, step: str, number: int) -> None:
        """Ends the faults that this recovery step clears, from a field on."""
        for fault in self._faults:
            if isinstance(fault, Recoverable) and fault.is_cleared_by(step) and self._holds(fault, number):
                self._cleared_at[fault] = number

    def _holds(self, fault: Fault, number: int) -> bool:
        return fault.holds(number) and number < self._end(fault)

    def _end(self, fault: Fault) -> int:
        end = fault.first + fault.fields
        return min(end, self._cleared_at.get(fault, end))

    def uncounted(self, number: int) -> int:
        """Number of fields before this one that the sequence skipped; overlaps count once."""
        return sum(last - first for first, last in self._silent_windows(number))

    def _silent_windows(self, number: int) -> Iterator[tuple[int, int]]:
        windows = ((fault.first, self._end(fault)) for fault in self._faults if not fault.counted)
        silent = sorted((min(first, number), min(end, number)) for first, end in windows)
        reached = 0
        for first, last in silent:
            yield max(first, reached), max(last, first, reached)
            reached = max(reached, last)

    def wraps_after(self) -> int:
        """Number of fields of a stream after which its sequence wraps to zero; 0: it starts there."""
        return next((fault.first for fault in self._faults if isinstance(fault, Wrap)), 0)

    def node(self, number: int) -> int:
        """Number of the device's node: how often it has come back as another one."""
        moves = (fault for fault in self._faults if isinstance(fault, Unplug) and fault.elsewhere)
        return sum(fault.first + fault.fields <= number for fault in moves)

    def counts_losses(self) -> bool:
        """True if the sequence shows every lost field."""
        return all(fault.counted for fault in self._faults)
