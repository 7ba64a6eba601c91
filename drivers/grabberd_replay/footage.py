"""Pictures that somebody brought, one after another, as a recording: what they are, and which of a camera's.

A folder and a video differ in how they are read, not in what follows: kind, rate and numbers of the pictures,
and which of them repeat another.
"""

import math
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.repeats import RepeatJudge, moved, repetitions
from grabberd.core.field import NTSC_HZ, PAL_HZ, TOP, Field, FieldOrder
from grabberd.errors import DeviceRefused, GrabberdError, PictureError
from grabberd.instrument.acquisition import REPEATED, GrabbedField
from grabberd_replay.decoder import KNOWN_BITS, STORED_BITS, Levels, Samples
from grabberd_replay.recording import (
    Batch,
    Pictures,
    Recording,
    Splitter,
    older_parity,
    parity_named,
    recognise,
    usual_rate_hz,
)
from grabberd_replay.timeline import LOOKED_AT, Numbered, Pace, Timeline, apart_ms

_WAITING = 25
"""Pictures that wait at most for one that repeats nothing."""
_BEFORE_NS, _FEWEST_CHANGED = 2_000_000_000, 3
"""Where none comes, it is frozen if so many changed in the time before: a camera's noise does not end."""


class RepeatMarks:
    """Passes a recording's pictures on, the repeated ones marked.

    Args:
        fields: number of fields in a picture.
    """

    def __init__(self, fields: int) -> None:
        self._by_parity = fields > 1
        self._judge = RepeatJudge(of_any_parity=not self._by_parity)
        self._changed: dict[int, Field] = {}
        self._changed_ns: deque[int] = deque(maxlen=_FEWEST_CHANGED)
        self._hides: dict[int, bool] = {}
        self._waiting: deque[list[tuple[GrabbedField, bool]]] = deque()

    def take(self, batch: Batch) -> Iterator[Batch]:
        """The pictures of which it is known by now what they are, after this one."""
        judged = [(one, self._judge.take(one.field)) for one in batch]
        self._waiting.append(judged)
        if not any(repeated for _, repeated in judged):
            yield from self._released({self._key(one.field): one.field for one, _ in judged})
        elif len(self._waiting) > _WAITING:
            yield from self._released({})

    def end(self) -> Iterator[Batch]:
        """All others, since no more pictures come."""
        yield from self._released({})

    def _released(self, after: dict[int, Field]) -> Iterator[Batch]:
        """Pictures that wait; `after` has the fields that were the first to change again."""
        for key in after:
            self._hides.pop(key, None)
        while self._waiting:
            batch: list[GrabbedField] = []
            for one, repeated in self._waiting.popleft():
                key = self._key(one.field)
                if not repeated:
                    self._changed[key] = one.field
                    self._changed_ns.append(one.time_ns)
                    self._hides.pop(key, None)
                    batch.append(one)
                    continue
                if key not in self._hides:
                    self._hides[key] = self._has_moved(key, after, one.time_ns)
                batch.append(one._replace(damage=REPEATED) if self._hides[key] else one)
            yield batch

    def _has_moved(self, key: int, after: dict[int, Field], time_ns: int) -> bool:
        before = self._changed.get(key)
        if before is not None and key in after:
            return moved(before, after[key])
        recent = [one for one in self._changed_ns if one >= time_ns - _BEFORE_NS]
        return len(recent) == _FEWEST_CHANGED

    def _key(self, field: Field) -> int:
        return field.parity if self._by_parity else 0


_GRABBED_SIZES = ((720, 576), (720, 288), (720, 480), (720, 240))
_SLOWEST_HZ = 1.0
"""No camera is as slow: 'grabberd inspect' states this rate to look at pictures whose rate nothing tells."""
_SAME_RATE = 0.02
"""Departure of the times' rate from a multiple of a stated one up to which they are of one clock."""


class Shown(NamedTuple):
    """A picture of a source.

    Attributes:
        name: what to call it in a message.
        samples: (lines, columns) as stored.
        time_s: its time; None if it has none.
        number: its number where a count tells it, else None.
    """

    name: str
    samples: Samples
    time_s: float | None = None
    number: int | None = None


class Source(Protocol):
    """Pictures in order of time, all of one size.

    Attributes:
        path: where they are from.
        lines, columns: their size.
        rate_hz: pictures a second as a file's header has them; None if nothing tells.
        bits: significant bits of samples of 16; None where the pictures themselves have to show them.
        marked: order of the fields by the marks in the file; None if it has none.
        expected: number of pictures that there must be by the header; 0 if it does not tell.
        details: for the stream's.
        remarks: what a user should know of how they were stored.
    """

    path: Path
    lines: int
    columns: int
    rate_hz: float | None
    bits: int | None
    marked: FieldOrder | None
    expected: int
    details: dict[str, str]
    remarks: tuple[str, ...]

    @property
    def fault(self) -> str:
        """Failure that ended the pictures before their end; empty if none did."""
        ...

    def pictures(self) -> Generator[Shown, None, None]:
        """The pictures from the first on.

        Raises:
            PictureError: the next one cannot be read; those before it were delivered.
        """
        ...


class Options(NamedTuple):
    """Statements of the user about the pictures; None where there is none."""

    pictures: str | None = None
    field_order: str | None = None
    first_parity: str | None = None
    rate_hz: float | None = None
    bits: int | None = None

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: one is not allowed.
        """
        if self.rate_hz is not None and not _is_rate(self.rate_hz):
            raise ValueError(f"rate_hz is the number of fields a second, not {self.rate_hz!r}")
        if self.bits is not None and self.bits not in KNOWN_BITS:
            raise ValueError(f"bits is one of {', '.join(map(str, KNOWN_BITS))}, not {self.bits!r}")
        Pictures(self.pictures or Pictures.AUTO)
        older_parity(FieldOrder(self.field_order or FieldOrder.TOP_FIRST))
        parity_named(self.first_parity or "top")

    def refuse(self, path: Path, what: str, *without_effect: str) -> None:
        """Refuses the options that have no effect on a recording of this kind.

        Raises:
            DeviceRefused: one of them was given.
        """
        for name in without_effect:
            if getattr(self, name) is not None:
                raise DeviceRefused(f"{path}: '{name}' has no effect on {what}", f"leave '{name}' out")


def _is_rate(value: object) -> bool:
    """True for a number above 0; in a configuration anything may stand."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < math.inf


class _Look(NamedTuple):
    """First look at the pictures: samples of the first, times, and whether each repeats another."""

    first: Samples
    times_s: list[float]
    repeats: list[bool]


class FootageRecording(Recording):
    """Pictures at their own times, or a period apart where they have none.

    Raises:
        DeviceRefused: their kind, rate or numbers cannot be known, or an option has no effect on them.
        PictureError: the first picture cannot be read.
    """

    def __init__(self, source: Source, options: Options) -> None:
        self._source = source
        look = _look(source)
        self._levels = Levels.of(look.first, options.bits or source.bits)
        interlaced = source.marked in (FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST)
        stated = Pictures(options.pictures or Pictures.AUTO)
        pictures = recognise(source.path, stated, source.lines, source.columns, interlaced=interlaced)
        _refuse_without_effect(source, options, pictures, look.first)
        pace = Pace.of(look.times_s) if len(look.times_s) > 1 else None
        _check_steady(source.path, pace, look.times_s)
        rate_hz = options.rate_hz or _rate_hz(source, pictures, pace)
        self._steps, self._timed = _steps(pace, pictures.fields / rate_hz), options.rate_hz is None
        self._pace, self._period_s = pace, pictures.fields / rate_hz
        marked = source.marked if interlaced and source.marked else FieldOrder.TOP_FIRST
        order = FieldOrder(options.field_order) if options.field_order else marked
        first_parity = parity_named(options.first_parity or "top")
        self._splitter = Splitter(pictures, order, first_parity, rate_hz)
        self.format = self._splitter.format(
            source.lines,
            source.columns,
            details={**source.details, **self._levels.details},
            remarks=(
                *source.remarks,
                *self._levels.remarks,
                *_of_fields(source, self._splitter, options),
                *_of_times(self._splitter, pace, options),
                *filter(None, [repetitions(look.repeats, _known_hz(rate_hz / pictures.fields))]),
            ),
        )

    def batches(self) -> Iterator[Batch]:
        """Fields of one picture at a time; what its number or its repetition leaves in doubt waits.

        Raises:
            PictureError: the pictures end too early, or lose their steady rate, or one is damaged.
        """
        marks = RepeatMarks(self._splitter.pictures.fields)
        fields = (
            self._splitter.batch(one.picture, one.number, self._time_s(one), one.damage)
            for one in self._numbered()
        )
        return _through(fields, marks.take, marks.end)

    def _time_s(self, one: Numbered[NDArray[np.uint8]]) -> float:
        return one.time_s if self._timed else one.number * self._period_s

    def _numbered(self) -> Iterator[Numbered[NDArray[np.uint8]]]:
        come = 0
        with closing(self._source.pictures()) as pictures:
            for count, one in enumerate(self._by_times(pictures) if self._pace else self._counted(pictures)):
                come = max(count, one.number) + 1
                yield one
        self._check_whole(come)

    def _by_times(self, pictures: Iterable[Shown]) -> Iterator[Numbered[NDArray[np.uint8]]]:
        assert self._pace is not None
        timeline: Timeline[NDArray[np.uint8]] = Timeline(self._source.path, self._pace, self._steps)
        return _through(pictures, lambda one: timeline.take(self._grey(one), one.time_s), timeline.end)

    def _counted(self, pictures: Iterable[Shown]) -> Iterator[Numbered[NDArray[np.uint8]]]:
        for count, one in enumerate(pictures):
            number = count if one.number is None else one.number
            yield Numbered(number, number * self._period_s, self._grey(one), None)

    def _check_whole(self, come: int) -> None:
        source = self._source
        if come < source.expected or source.fault:
            of = f" of {source.expected}" if source.expected else ""
            raise PictureError(
                f"{source.path} ends after {come}{of} pictures: it is truncated, or the "
                f"next one cannot be decoded{f' ({source.fault})' if source.fault else ''}",
                "copy it again; what came before it is kept",
            )

    def _grey(self, one: Shown) -> NDArray[np.uint8]:
        return self._levels.grey(one.name, one.samples)


def _known_hz(rate_hz: float) -> float:
    """A rate that a camera may have; 0 for one that was only made up to look at pictures without any."""
    return rate_hz if rate_hz > _SLOWEST_HZ else 0.0


T = TypeVar("T")
U = TypeVar("U")


def _through(
    pictures: Iterable[T], take: Callable[[T], Iterator[U]], end: Callable[[], Iterator[U]]
) -> Iterator[U]:
    """Pass pictures through a stage in which some wait; it is emptied before a failure is passed on."""
    try:
        for one in pictures:
            yield from take(one)
    except GrabberdError:
        yield from end()
        raise
    yield from end()


def _look(source: Source) -> _Look:
    judge = RepeatJudge(of_any_parity=True)
    first: Samples | None = None
    times: list[float] = []
    repeats: list[bool] = []
    with closing(source.pictures()) as pictures:
        for one in _as_far_as_possible(islice(pictures, LOOKED_AT)):
            if first is None:
                first, levels = one.samples, Levels.of(one.samples)
            grey = one.samples if one.samples.dtype == np.uint8 else one.samples >> max(levels.bits - 8, 0)
            repeats.append(judge.take(Field.progressive(np.asarray(grey, np.uint8))))
            if one.time_s is not None:
                times.append(one.time_s)
    assert first is not None, "a source has a picture, or says why it has none"
    return _Look(first, times if len(times) == len(repeats) else [], repeats)


def _as_far_as_possible(pictures: Iterator[Shown]) -> Iterator[Shown]:
    """All pictures up to a bad one, which ends the recording once it is its turn; the first must be good."""
    yield next(pictures)
    try:
        yield from pictures
    except GrabberdError:
        return


def _refuse_without_effect(source: Source, options: Options, pictures: Pictures, first: Samples) -> None:
    path = source.path
    if pictures is not Pictures.FRAMES:
        options.refuse(path, f"pictures that are {pictures}, which have one field each", "field_order")
    if pictures not in (Pictures.FIELDS, Pictures.DOUBLED):
        options.refuse(path, f"pictures that are {pictures}", "first_parity")
    if first.dtype == np.uint8:
        options.refuse(path, f"pictures that are not stored with {STORED_BITS} bits a sample", "bits")
    if source.bits is not None:
        options.refuse(path, f"pictures that are known to have {source.bits} bits a sample", "bits")


def _check_steady(path: Path, pace: Pace | None, times_s: list[float]) -> None:
    if pace is not None and not pace.is_steady:
        least, most = apart_ms(times_s)
        raise DeviceRefused(
            f"{path}: its pictures come {least:.4g} to {most:.4g} ms apart, at no steady rate: which of a "
            "camera's pictures they are cannot be known",
            "record at a constant rate: a camera's own, and no phone's that adapts it to the light",
        )


def _rate_hz(source: Source, pictures: Pictures, pace: Pace | None) -> float:
    """Fields a second by the pictures' own times, or by the header, or else by the standard."""
    if pace is not None:
        return pictures.fields / pace.period_s
    if source.rate_hz:
        return pictures.fields * source.rate_hz
    return usual_rate_hz(source.path, pictures, source.lines)


def _steps(pace: Pace | None, period_s: float) -> int:
    """Periods of the stated rate from picture to picture, where the times are a multiple of it; else 1."""
    ratio = 1.0 if pace is None else pace.period_s / period_s
    return max(1, round(ratio)) if abs(ratio - round(ratio)) < _SAME_RATE * ratio else 1


def _of_times(splitter: Splitter, pace: Pace | None, options: Options) -> Iterator[str]:
    if pace is None or options.rate_hz is None:
        return
    own_hz = splitter.pictures.fields / pace.period_s
    ratio = splitter.rate_hz / own_hz
    if abs(ratio - round(ratio)) >= _SAME_RATE or round(ratio) == 0:
        yield (
            f"Its own times are of {own_hz:.6g} fields a second; it is played at {splitter.rate_hz:g}, as "
            "'rate_hz' asks."
        )


def _of_fields(source: Source, splitter: Splitter, options: Options) -> Iterator[str]:
    marked, pictures = source.marked, splitter.pictures
    if pictures is Pictures.PROGRESSIVE:
        return
    if pictures is Pictures.FRAMES and marked is FieldOrder.PROGRESSIVE:
        yield (
            "It is marked as progressive, but has the size of interlaced frames and is played as such; "
            "recorders often forget the mark: 'grabberd inspect' tells by what moves, 'pictures' decides."
        )
    if pictures is Pictures.FRAMES and marked not in (None, FieldOrder.PROGRESSIVE, splitter.order):
        yield f"It is marked as {marked}, but played as {splitter.order}, as the option 'field_order' asks."
    is_stated = options.field_order is not None or marked not in (None, FieldOrder.PROGRESSIVE)
    if pictures is Pictures.FRAMES and not is_stated:
        yield (
            "Nothing tells which field of a frame is the older: the top one is taken for it, as in PAL. If "
            "what moves jumps back and forth, it is wrong: 'grabberd inspect' finds it, 'field_order' states "
            "it."
        )
    if pictures is not Pictures.FRAMES and options.first_parity is None:
        first = "top" if splitter.first_parity == TOP else "bottom"
        yield f"Nothing tells the parity of its first field: {first} is assumed; 'first_parity' states it."
    if (source.columns, source.lines) not in _GRABBED_SIZES:
        yield (
            f"Its size {source.columns}x{source.lines} is that of no grabber (720x576, 720x480, or half the "
            "lines): if it was scaled, lines of both fields are mixed, and no option separates them."
        )
    if all(abs(splitter.rate_hz - usual) > 0.01 * usual for usual in (PAL_HZ, NTSC_HZ)):
        yield (
            f"It has {splitter.rate_hz:g} fields a second where PAL has {PAL_HZ:g} and NTSC {NTSC_HZ:.2f}: "
            "correct a wrong rate with rate_hz; pictures are 'progressive' if they have no fields, and "
            "'doubled' if each was interpolated from a field."
        )
