"""What the daemon has told its clients: what the auditor holds it to."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from tests.proofs.world.auditor import Sealed


class Span(NamedTuple):
    """When something was asked for and answered; no answer: the daemon crashed, or refused."""

    asked_ns: int
    answered_ns: int | None


@dataclass
class Asked:
    """A capture that a client was told to have.

    Attributes:
        device: Its camera.
        started: When it was asked for.
        fields: Length that was asked for.
        pre_fields: Fields before it that were.
        stopped: When its end was asked for.
        sealed_ns: When a client was first told that it is sealed.
        deleted: True once anybody asked for its deletion.
        notes: Those it may have: the last that was answered for, and later ones.
        pins: Likewise.
    """

    device: str
    started: Span
    fields: int | None
    pre_fields: int
    stopped: Span | None = None
    sealed_ns: int | None = None
    deleted: bool = False
    notes: list[str] = field(default_factory=lambda: [""])
    pins: list[bool] = field(default_factory=lambda: [False])


@dataclass
class Job:
    """A job that a client was told to have.

    Attributes:
        submitted_ns: When that was answered.
        submitted_utc_s: When it was asked for, in seconds since 1970.
        begun_ns: When its work has begun, each time.
        done_ns: When it was done, each time.
        ended: The state in which it was first seen ended, and when that was answered.
        cancelled: True once anybody asked for that.
    """

    submitted_ns: int
    submitted_utc_s: float = 0.0
    begun_ns: list[int] = field(default_factory=list)
    done_ns: list[int] = field(default_factory=list)
    ended: tuple[str, int] | None = None
    cancelled: bool = False


class Crash(NamedTuple):
    """An end of the daemon that it did not plan."""

    at_ns: int
    power_cut: bool


@dataclass
class Record:
    """All of a world.

    Attributes:
        captures: By id.
        jobs: By id.
        crashes: In order.
        files: Sealed captures as the auditor has read them.
        digests: Of sealed files, as first seen, by name.
        refusals: What clients were refused, with the times.
        states: Of the devices and loggers, and causes of faults, with the times at which they were seen.
        lies: What clients found wrong at once.
    """

    captures: dict[str, Asked] = field(default_factory=dict)
    jobs: dict[str, Job] = field(default_factory=dict)
    crashes: list[Crash] = field(default_factory=list)
    files: dict[str, "Sealed"] = field(default_factory=dict)
    digests: dict[str, bytes] = field(default_factory=dict)
    refusals: list[tuple[int, str]] = field(default_factory=list)
    states: list[tuple[int, str]] = field(default_factory=list)
    lies: list[str] = field(default_factory=list)
