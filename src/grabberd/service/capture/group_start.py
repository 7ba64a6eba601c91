"""Captures of one or of several devices begin: all of them, at the same moment, or none."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from typing import NamedTuple, TypeVar

from grabberd.errors import GrabberdError, GroupRefused
from grabberd.service.capture.capture_group import Moment
from grabberd.service.capture.capture_request import Planned
from grabberd.service.capture.capture_start import CaptureStart
from grabberd.service.capture.recording import Recording
from grabberd.service.capture.recording_start import Taken
from grabberd.service.clock import Clock, iso_utc

Room = Callable[[float, float | None], None]
"""Raises StorageError where the disk has none for so many bytes a second, for so many seconds."""
T = TypeVar("T")


class Member(NamedTuple):
    """One of those that begin together."""

    beginning: CaptureStart
    planned: Planned


def start(members: Sequence[Member], room: Room, clock: Clock) -> None:
    """Begins captures; fields are taken from this moment on, or from the ring for a pre-trigger.

    Raises:
        CaptureRunning, NotReady, InputError, CalibrationMismatch: see `CaptureStart.check_free`.
        StorageError: a file cannot be created, or the disk has no room for all of them.
        GroupRefused: some of several cannot begin; the others do not either.
    """
    with _held(members), _armed(members):
        _begin(members, room, clock)


def arm(members: Sequence[Member], clock: Clock) -> None:
    """Keeps the rings as captures want them, until they are triggered or disarmed.

    Raises:
        CaptureRunning, NotReady, InputError, CalibrationMismatch, GroupRefused: as `start`.
    """
    with _held(members), _armed(members):
        now_utc = iso_utc(clock.utc_now())
        for beginning, planned in members:
            beginning.wait(planned, now_utc)


def trigger(members: Sequence[Member], room: Room, clock: Clock) -> None:
    """Has armed captures begin, with so many slots of the ring as they want, as far as those are there.

    Raises:
        Conflict: one is not armed.
        NotReady, CalibrationMismatch, StorageError, GroupRefused: as `start`; they stay armed.
    """
    with _held(members):
        _each(members, lambda one: one.beginning.check_armed(one.planned.id))
        _each(members, lambda one: one.beginning.check_streams())
        _begin(members, room, clock)


@contextmanager
def _held(members: Sequence[Member]) -> Iterator[None]:
    """Nobody else begins anything with these devices; in one order, so that nobody waits for ever."""
    with ExitStack() as stack:
        for one in sorted(members, key=lambda member: member.beginning.name):
            stack.enter_context(one.beginning.lock)
        yield


@contextmanager
def _armed(members: Sequence[Member]) -> Iterator[None]:
    """The rings are as the captures want them; their thresholds are let go of where it comes to nothing."""
    _each(members, lambda one: one.beginning.check_free(one.planned.request))
    try:
        _each(members, lambda one: one.beginning.arm(one.planned.request))
        yield
    except GrabberdError:
        for one in members:
            one.beginning.release()
        raise


def _begin(members: Sequence[Member], room: Room, clock: Clock) -> None:
    room(sum(one.beginning.bytes_per_s for one in members), _longest_s(members))
    moment = Moment.now(clock)
    # All of them take fields before the first file is made, which takes its time.
    taken = {one.beginning.name: one.beginning.take(one.planned) for one in members}
    for one, session in zip(members, _attached(members, taken, moment), strict=True):
        one.beginning.begin(session)


def _longest_s(members: Sequence[Member]) -> float | None:
    """None where one of them has no length."""
    lengths = [(one.planned.request.fields, one.beginning.stream.rate_hz) for one in members]
    if any(fields is None for fields, _ in lengths):
        return None
    return max(fields / rate_hz for fields, rate_hz in lengths if fields is not None)


def _attached(members: Sequence[Member], taken: dict[str, Taken], moment: Moment) -> list[Recording]:
    def attach(one: Member) -> Recording:
        return one.beginning.attach(one.planned, taken[one.beginning.name], moment)

    tried = _tried(members, attach)
    try:
        return _all_of(members, tried)
    except GrabberdError:
        for fields in taken.values():
            fields.give_up()
        for session in tried:
            if isinstance(session, Recording):
                session.discard()
        raise


def _each(members: Sequence[Member], work: Callable[[Member], object]) -> None:
    _all_of(members, _tried(members, work))


def _tried(members: Sequence[Member], work: Callable[[Member], T]) -> list[T | GrabberdError]:
    """What comes of it for each, done for all at the same time: one that takes long delays no other."""

    def attempt(one: Member) -> T | GrabberdError:
        try:
            return work(one)
        except GrabberdError as error:
            return error

    if len(members) == 1:
        return [attempt(members[0])]
    with ThreadPoolExecutor(len(members), "beginning") as pool:
        return list(pool.map(attempt, members))


def _all_of(members: Sequence[Member], tried: Sequence[T | GrabberdError]) -> list[T]:
    """What came of it.

    Raises:
        GrabberdError: it came to nothing for one; GroupRefused: for some of several.
    """
    refusals = {
        one.beginning.name: what
        for one, what in zip(members, tried, strict=True)
        if isinstance(what, GrabberdError)
    }
    if refusals and len(members) == 1:
        raise next(iter(refusals.values()))
    if refusals:
        raise GroupRefused(refusals)
    return [what for what in tried if not isinstance(what, GrabberdError)]
