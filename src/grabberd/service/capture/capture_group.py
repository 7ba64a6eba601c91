"""Captures that are made together: what they have in common."""

from dataclasses import dataclass
from typing import Self

from grabberd.documents.captures import GroupDocument
from grabberd.service.clock import Clock, iso_utc


@dataclass(frozen=True, slots=True)
class Group:
    """Captures of several devices that begin at the same moment.

    Attributes:
        id: of the group.
        devices: one capture of each.
    """

    id: str
    devices: tuple[str, ...]

    def document(self, start: "Moment | None") -> GroupDocument:
        """The group as each of its captures keeps it; its start is None while it is armed."""
        return GroupDocument(
            id=self.id,
            devices=list(self.devices),
            start_utc=None if start is None else start.utc,
            start_ns=None if start is None else start.ns,
        )


@dataclass(frozen=True, slots=True)
class Moment:
    """The same moment by both clocks.

    Attributes:
        ns: CLOCK_MONOTONIC; `utc`: ISO 8601.
    """

    ns: int
    utc: str

    @classmethod
    def now(cls, clock: Clock) -> Self:
        """This moment."""
        return cls(clock.now_ns(), iso_utc(clock.utc_now()))
