"""Sizes, pixel formats and rates that a camera without a video standard offers, and the choice among them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from grabberd.core.field import LARGEST_SIDE_PX
from grabberd_v4l2 import abi
from grabberd_v4l2.node import Node

Size = tuple[int, int]
"""Pixels per line, and lines."""

LEAST_HZ = 5
"""Minimum rate: slower streams look like a grabber that has stopped."""
ENOUGH_HZ = 25
"""Rate below which a mode is chosen only if requested, or if there is no faster one."""
_NEAR = 2e-3
"""Relative tolerance of a requested rate: 59.94 is accepted as 60."""
_MOST_IN_WORDS = 24
_SQUARE = (640, 480)


class Mode(NamedTuple):
    """A size in a pixel format.

    Attributes:
        fourcc: Pixel format.
        columns, lines: Size.
        rates_hz: Pictures per second, the highest first; empty if the camera does not report them.
    """

    fourcc: str
    columns: int
    lines: int
    rates_hz: tuple[Fraction, ...]

    @property
    def size(self) -> Size:
        """Pixels per line, and lines."""
        return self.columns, self.lines


class Wish(NamedTuple):
    """A stream that may be requested.

    Attributes:
        mode: Size and format.
        rate_hz: Pictures per second; None leaves it to the camera.
    """

    mode: Mode
    rate_hz: Fraction | None


def offered(
    node: Node, formats: Iterable[str], size: Size | None = None, rate_hz: float | None = None
) -> Iterator[Mode]:
    """All modes with these formats.

    If the camera reports a range, `size` and `rate_hz` are used if they are within it, otherwise the largest.
    """
    for fourcc in formats:
        sizes = [_size_of(one, size) for one in node.frame_sizes(fourcc)] or [size or _SQUARE]
        for columns, lines in sizes:
            intervals = node.frame_intervals(fourcc, columns, lines)
            rates = {rate for one in intervals for rate in _rates_of(one, rate_hz)}
            yield Mode(fourcc, columns, lines, tuple(sorted(rates, reverse=True)))


def wishes(
    modes: Iterable[Mode], ranks: Mapping[str, int], size: Size | None, rate_hz: float | None
) -> list[Wish]:
    """The streams to request, the best first.

    They are sorted by whether the rate reaches `ENOUGH_HZ`, then by the format's rank, the size and the rate.

    Args:
        modes: Modes that the camera offers.
        ranks: Allowed formats with their rank; the lowest is the best.
        size: The only size, or None for any.
        rate_hz: The only rate, or None for any of at least `LEAST_HZ`.
    """
    found = [
        Wish(mode, rate)
        for mode in modes
        if mode.fourcc in ranks and size in (None, mode.size) and _can_be_read(mode.size)
        for rate in _wanted(mode.rates_hz, rate_hz)
    ]
    return sorted(found, key=lambda wish: _order(wish, ranks), reverse=True)


def is_near(rate_hz: float | Fraction, wanted_hz: float | Fraction) -> bool:
    """True if a rate is the requested one within the tolerance."""
    return abs(float(rate_hz) / float(wanted_hz) - 1) <= _NEAR


def in_words(modes: Sequence[Mode]) -> str:
    """The modes as a list, e.g. "YUYV 640×480 at 30, 15; MJPG 1280×720 at 60"."""
    words = [f"{mode.fourcc} {mode.columns}×{mode.lines}{_rates_in_words(mode)}" for mode in modes]
    more = f"; and {len(words) - _MOST_IN_WORDS} more" if len(words) > _MOST_IN_WORDS else ""
    return ("; ".join(words[:_MOST_IN_WORDS]) + more) or "nothing"


def _size_of(entry: abi.FrmSizeEnum, wanted: Size | None) -> Size:
    if entry.type == abi.FRMSIZE_TYPE_DISCRETE:
        return int(entry.discrete.width), int(entry.discrete.height)
    span = entry.stepwise
    if wanted is not None:
        columns, lines = wanted
        fits = (
            span.min_width <= columns <= span.max_width
            and span.min_height <= lines <= span.max_height
            and not (columns - span.min_width) % max(span.step_width, 1)
            and not (lines - span.min_height) % max(span.step_height, 1)
        )
        if fits:
            return wanted
    return int(span.max_width), int(span.max_height)


def _rates_of(entry: abi.FrmIvalEnum, wanted_hz: float | None) -> Iterator[Fraction]:
    if entry.type == abi.FRMIVAL_TYPE_DISCRETE:
        yield from _rate(entry.discrete)
        return
    span = entry.stepwise
    for most in _rate(span.min):
        least = next(_rate(span.max), Fraction(0))
        if wanted_hz is not None and least <= wanted_hz <= most:
            yield Fraction(wanted_hz).limit_denominator(1001)
        else:
            yield most


def _rate(interval: abi.Fraction) -> Iterator[Fraction]:
    """The rate of an interval; nothing if the driver fills it with zeros."""
    if interval.numerator and interval.denominator:
        yield Fraction(interval.denominator, interval.numerator)


def _can_be_read(size: Size) -> bool:
    columns, lines = size
    return not lines % 2 and 0 < columns <= LARGEST_SIDE_PX and 0 < lines <= LARGEST_SIDE_PX


def _wanted(rates_hz: Sequence[Fraction], rate_hz: float | None) -> Iterator[Fraction | None]:
    if not rates_hz:
        yield None if rate_hz is None else Fraction(rate_hz).limit_denominator(1001)
    for one in rates_hz:
        if one >= LEAST_HZ if rate_hz is None else is_near(one, rate_hz):
            yield one


def _order(wish: Wish, ranks: Mapping[str, int]) -> tuple[bool, int, int, Fraction, int]:
    mode, rate_hz = wish.mode, wish.rate_hz or Fraction(0)
    is_enough = wish.rate_hz is None or rate_hz >= ENOUGH_HZ
    preferred = -list(ranks).index(mode.fourcc)
    return is_enough, -ranks[mode.fourcc], mode.columns * mode.lines, rate_hz, preferred


def _rates_in_words(mode: Mode) -> str:
    rates = ", ".join(f"{float(rate):.4g}" for rate in mode.rates_hz)
    return f" at {rates}" if rates else ""
