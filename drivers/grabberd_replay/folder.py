"""A folder of pictures as a source: in the order, and with the numbers or times, that their names have.

Names are a count where most of their numbers step alike, and all others by a multiple of that: what is
missing is lost. Numbers that step unevenly are times, as are dates. Whatever else they are is said.
"""

import math
import re
from collections import Counter
from collections.abc import Generator, Iterator, Sequence
from datetime import UTC, datetime
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceRefused
from grabberd_replay.footage import Shown
from grabberd_replay.picture_file import SUFFIXES, read_picture

_DATE = re.compile(
    r"((?:19|20)\d\d)[-_.:]?([01]\d)[-_.:]?([0-3]\d)[T_ -]{0,2}([0-2]\d)[-_.:h]?([0-5]\d)[-_.:m]?([0-5]\d)"
    r"(?:[.,_s-]?(\d{1,9}))?(?!\d)"
)
_CLOCK = re.compile(
    r"(?<!\d)(?:([0-2]\d)[-_.:h]([0-5]\d)[-_.:m]([0-5]\d)[-_.,](\d{3,9})"
    r"|([0-2]\d)([0-5]\d)([0-5]\d)[.,]?(\d{3}))(?!.*\d)"
)
_HEXADECIMAL = re.compile(r"[0-9a-f]{1,8}")
_HALF_DAY_S, _DAY_S = 43_200, 86_400
_SECONDS = re.compile(r"(\d+)[.,](\d+)(?!.*\d)")
_UNITS_S = {"s": Fraction(1), "ms": Fraction(1, 10**3), "us": Fraction(1, 10**6), "ns": Fraction(1, 10**9)}
_SINCE_1970 = range(10**9, 4 * 10**9)
"""Seconds, of the years 2001 to 2096: numbers of that size in any unit are times, however they step."""
_RATES_HZ = (1, 500)
_HURRIED = 10
"""One step in so many may be shorter than any camera's: pictures that were written after a delay."""
_FEWEST_OF_SECOND = 3
"""Digits of a fraction that tells pictures of one second apart; fewer are a count within it."""
_MOSTLY = 0.5
_ALIKE = 0.8
"""Share of names that are alike but for their numbers, from which on another one is an oversight."""
_FEWEST_DIGITS = 3
"""Of a counter that may have begun anew."""
_BINARY = (1 << 8, 1 << 16, 1 << 32)
"""Numbers that a camera's counter of bytes has."""
_NAMED = 3


class Names(NamedTuple):
    """The pictures of a folder in the order in which they were taken.

    Attributes:
        paths: the pictures.
        numbers: number of each, from 0 on; None where they have times.
        times_s: time of each; None where they have numbers.
        remarks: what was concluded from the names, where it is not obvious.
    """

    paths: list[Path]
    numbers: list[int] | None
    times_s: list[float] | None
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, directory: Path) -> "Names":
        """The pictures in a folder; hidden files, as other computers leave them, are none.

        Raises:
            DeviceRefused: there are none, they are of several kinds, or their numbers are neither a count nor
                times.
        """
        found = [path for path in directory.iterdir() if path.suffix.lower() in SUFFIXES]
        paths = [path for path in found if not path.name.startswith(".")]
        _check_kinds(directory, paths)
        hidden = [f"{len(found) - len(paths)} hidden files are left out."] if len(found) > len(paths) else []
        timed = _by_dates(paths) or _by_clock(paths) or _by_seconds(paths)
        names = timed or _by_numbers(directory, paths) or _by_name(paths)
        return names._replace(remarks=(*hidden, *names.remarks))


def _check_kinds(directory: Path, paths: Sequence[Path]) -> None:
    if not paths:
        kinds = ", ".join(sorted(set(SUFFIXES.values())))
        raise DeviceRefused(
            f"{directory} has no pictures ({kinds})", "give a folder of pictures, a video or a capture file"
        )
    kinds_found = Counter(SUFFIXES[path.suffix.lower()] for path in paths)
    if len(kinds_found) > 1:
        listed = " and ".join(f"{count} {kind}" for kind, count in kinds_found.most_common())
        raise DeviceRefused(f"{directory} has {listed} pictures", "keep those of one kind in a folder")


def _by_dates(paths: Sequence[Path]) -> Names | None:
    times: list[Fraction] = []
    within: set[int] = set()
    finest = 0
    for path in paths:
        found = _DATE.search(path.stem)
        if found is None:
            return None
        *parts, fraction = found.groups()
        finest = max(finest, len(fraction or ""))
        within.add(int(fraction or 0))
        try:
            whole = datetime(*map(int, parts), tzinfo=UTC)  # type: ignore[misc, arg-type]
        except ValueError:
            return None
        times.append(int(whole.timestamp()) + Fraction(int(fraction or 0), 10 ** len(fraction or "")))
    is_counted = len(within) == max(within) - min(within) + 1 and 2 * max(within) < 10**finest
    if finest < _FEWEST_OF_SECOND and (is_counted or len({int(time) for time in times}) == 1):
        return None
    return _timed(paths, times, "dates")


def _by_clock(paths: Sequence[Path]) -> Names | None:
    """Names with times of day, which may go on after midnight: only hour and minute order their seconds."""
    found = [_CLOCK.search(path.stem) for path in paths]
    if any(one is None for one in found):
        return None
    clocks = [[group for group in one.groups() if group] for one in found if one]
    times = [3600 * int(h) + 60 * int(m) + Fraction(f"{s}.{part}") for h, m, s, part in clocks]
    if max(times) - min(times) > _HALF_DAY_S:
        times = [time + _DAY_S if time < _HALF_DAY_S else time for time in times]
    return _timed(paths, times, "times of day")


def _by_seconds(paths: Sequence[Path]) -> Names | None:
    found = [_SECONDS.search(path.stem) for path in paths]
    if any(one is None for one in found):
        return None
    return _timed(paths, [Fraction(f"{one[1]}.{one[2]}") for one in found if one], "times in seconds")


def _timed(paths: Sequence[Path], times: Sequence[Fraction], what: str) -> Names | None:
    """Names with times that differ, at a rate that a camera may have; None if they are no such times."""
    ordered = sorted(zip(times, paths, strict=True))
    steps = sorted(later - earlier for (earlier, _), (later, _) in pairwise(ordered))
    if not steps or steps[0] <= 0:
        return None
    if _RATES_HZ[0] * steps[len(steps) // 2] > 1 or _RATES_HZ[1] * steps[len(steps) // _HURRIED] < 1:
        return None
    first = ordered[0][0]
    since = [float(time - first) for time, _ in ordered]
    return Names([path for _, path in ordered], None, since, (f"Its names are read as {what}.",))


def _by_numbers(directory: Path, paths: Sequence[Path]) -> Names | None:
    """Names in which a number differs from all others, as a count or times; None if there is no such number.

    Of several, as a count beside a time, times decide, and else the count that lacks most: a program's own
    count of what it saved goes on where pictures are lost.
    """
    pieces = _pieces(paths)
    kinds = Counter(tuple(one[::2]) for one in pieces)
    (usual, often), *others = kinds.most_common()
    if others and (hexadecimal := _by_hexadecimal(paths)):
        return hexadecimal
    if others and often >= _ALIKE * len(paths):
        odd, like = (
            next(path for path, one in zip(paths, pieces, strict=True) if (tuple(one[::2]) == usual) is alike)
            for alike in (False, True)
        )
        raise DeviceRefused(
            f"{directory}: {odd.name} is named unlike the others, such as {like.name}, so they are no count",
            "move it to another folder, or name it like the others",
        )
    if others or len(paths) < 2:
        return None
    columns = [[int(one[at]) for one in pieces] for at in range(1, len(pieces[0]), 2)]
    varying = [values for values in columns if len({*values}) > 1]
    if len(varying) == 1:
        _check_distinct(directory, paths, varying[0])
    distinct = [values for values in varying if len({*values}) == len(paths)]
    found = [one for one in (_of_number(paths, values) for values in distinct) if one]
    if len(varying) == 1 and not found:
        raise _neither(directory, sorted(varying[0]))
    if len({tuple(one.paths) for one in found}) > 1:  # a checksum may look like times
        found = [one for one in found if one.numbers]
    if len({tuple(one.paths) for one in found}) != 1:
        return None
    return max(found, key=lambda one: one.numbers[-1] if one.numbers else math.inf)


def _by_hexadecimal(paths: Sequence[Path]) -> Names | None:
    """Names that differ in a hexadecimal number of several digits, letters among them, that is a count."""
    stems = [path.stem.casefold() for path in paths]
    # Digits that are the same in all make no difference, and may be letters of the text before the number.
    start = next((at for at, letters in enumerate(zip(*stems, strict=False)) if len({*letters}) > 1), 0)
    digits = [stem[start:] for stem in stems]
    if not all(_HEXADECIMAL.fullmatch(one) and len(one) == len(digits[0]) for one in digits):
        return None
    ordered = sorted(zip([int(one, 16) for one in digits], paths, strict=True))
    names = _count(ordered, [])
    return names and names._replace(remarks=(*names.remarks, "Its names are read as a hexadecimal count."))


def _pieces(paths: Sequence[Path]) -> list[list[str]]:
    """Stems cut into texts and numbers by turns; a sign before the first is one where not all have it."""
    stems = [path.stem.casefold() for path in paths]
    signed = {bool(re.match(r"-\d", stem)) for stem in stems} == {True, False}
    return [re.split(r"(^-?\d+|\d+)" if signed else r"(\d+)", stem) for stem in stems]


def _check_distinct(directory: Path, paths: Sequence[Path], values: Sequence[int]) -> None:
    ordered = sorted(zip(values, paths, strict=True))
    for (earlier, first), (later, second) in pairwise(ordered):
        if earlier == later:
            raise DeviceRefused(
                f"{directory}: {first.name} and {second.name} have the same number", "leave one of them out"
            )


def _of_number(paths: Sequence[Path], values: Sequence[int]) -> Names | None:
    remarks: list[str] = []
    ordered = sorted(zip(values, paths, strict=True))
    unwrapped = _unwrapped([value for value, _ in ordered], remarks)
    ordered = sorted(zip(unwrapped, (path for _, path in ordered), strict=True))
    return _count(ordered, remarks) or _stamps(ordered)


def _unwrapped(values: list[int], remarks: list[str]) -> list[int]:
    """Numbers, ascending, of a counter that may have gone from 9999 or 65535 to 0 or 1 among them."""
    last, digits = values[-1], len(str(values[-1]))
    capacities = (10**digits, *_BINARY)
    gaps = [(later - earlier, at) for at, (earlier, later) in enumerate(pairwise(values), start=1)]
    widest, at = max(gaps)
    if digits < _FEWEST_DIGITS or last + 1 not in capacities or values[0] > 1 or 2 * widest < last:
        return values
    remarks.append(f"Its count goes on from {last} with {values[0]:0{digits}d}.")
    beyond = last + 1 - values[0]
    return [value + beyond if k < at else value for k, value in enumerate(values)]


def _count(ordered: Sequence[tuple[int, Path]], remarks: list[str]) -> Names | None:
    steps = [later - earlier for (earlier, _), (later, _) in pairwise(ordered)]
    step = min(steps)
    is_count = steps.count(step) >= _MOSTLY * len(steps) and all(one % step == 0 for one in steps)
    first = ordered[0][0]
    if not is_count or any(int(first * unit) in _SINCE_1970 for unit in _UNITS_S.values()):
        return None
    missing = list(_missing(ordered, step))
    if missing:
        more = f" and {len(missing) - _NAMED} more" if len(missing) > _NAMED else ""
        listed = ", ".join(missing[:_NAMED])
        remarks.append(f"By the count in its names {listed}{more}: their fields are lost.")
    numbers = [(value - first) // step for value, _ in ordered]
    return Names([path for _, path in ordered], numbers, None, tuple(remarks))


def _missing(ordered: Sequence[tuple[int, Path]], step: int) -> Iterator[str]:
    """Runs of missing pictures, each in a few words."""
    for (earlier, before), (later, _) in pairwise(ordered):
        if lacking := (later - earlier) // step - 1:
            what = "1 picture is" if lacking == 1 else f"{lacking} pictures are"
            yield f"{what} missing after {before.name}"


def _stamps(ordered: Sequence[tuple[int, Path]]) -> Names | None:
    """Names whose numbers are times, in the unit that gives a camera's rate; None if no unit does."""
    paths = [path for _, path in ordered]
    for name, unit in _UNITS_S.items():
        if unit == 1 and ordered[0][0] not in _SINCE_1970:
            continue
        if timed := _timed(paths, [value * unit for value, _ in ordered], f"times in {name}"):
            return timed
    return None


def _neither(directory: Path, values: Sequence[int]) -> DeviceRefused:
    steps = [later - earlier for earlier, later in pairwise(values)]
    return DeviceRefused(
        f"{directory}: the numbers in its names step by {min(steps)} to {max(steps)}: neither a count nor "
        "times in ms, us or ns",
        "name the pictures by the times at which they were taken, such as 12.340.png in seconds",
    )


def _by_name(paths: Sequence[Path]) -> Names:
    """In the order of their names, numbers among them by their value."""
    ordered = sorted(
        paths, key=lambda path: [_piece(one) for one in re.split(r"(\d+)", path.name.casefold())]
    )
    said = () if len(paths) == 1 else ("Its names tell an order, but neither a count nor times.",)
    return Names(ordered, list(range(len(ordered))), None, said)


def _piece(text: str) -> tuple[int, str]:
    return (int(text), text) if text.isdecimal() else (-1, text)


_LOSSY = (
    "Its pictures are JPEG, which is lossy: targets are displaced by more than their sigma says. Record PNG "
    "or TIFF."
)


class FolderSource:
    """The pictures of a folder.

    Raises:
        DeviceRefused: there are none, or their names contradict one another.
        PictureError: the first picture cannot be read.
    """

    rate_hz: float | None = None
    bits: int | None = None
    marked: FieldOrder | None = None
    expected = 0
    fault = ""

    def __init__(self, directory: Path) -> None:
        self.path = directory
        self._names = Names.of(directory)
        first = self._names.paths[0]
        self._header, _ = read_picture(first)
        self.lines, self.columns = self._header.lines, self._header.columns
        self.details = self._header.details
        lossy = (_LOSSY,) if SUFFIXES[first.suffix.lower()] == "JPEG" else ()
        self.remarks = (*self._names.remarks, *lossy)

    def pictures(self) -> Generator[Shown, None, None]:
        """The pictures, each read when it is its turn.

        Raises:
            PictureError: one is missing, damaged, or unlike the first.
        """
        names = self._names
        for at, path in enumerate(names.paths):
            _, samples = read_picture(path, self._header)
            time_s = names.times_s[at] if names.times_s else None
            yield Shown(str(path), samples, time_s, names.numbers[at] if names.numbers else None)
