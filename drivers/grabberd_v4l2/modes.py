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
"""Slower streams look like a grabber that has stopped."""
ENOUGH_HZ = 25
"""A rate below it is not chosen unless asked for, as long as there is another."""
_NEAR = 2e-3
"""Part by which a rate may differ from the one asked for: 59.94 is 60."""
_MOST_IN_WORDS = 24
_SQUARE = (640, 480)


class Mode(NamedTuple):
    """A size in a pixel format.

    Attributes:
        fourcc: pixel format.
        columns, lines: size.
        rates_hz: pictures per second, the highest first; empty if the camera does not tell.
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
        mode: size and format.
        rate_hz: pictures per second; None leaves it to the camera.
    """

    mode: Mode
    rate_hz: Fraction | None


def offered(
    node: Node, formats: Iterable[str], size: Size | None = None, rate_hz: float | None = None
) -> Iterator[Mode]:
    """All modes of these formats.

    Where the camera tells a range, `size` and `rate_hz` are taken from it if they are within, else the
    largest.
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

    A rate of `ENOUGH_HZ` comes before all else, then the format's rank, then the size and the rate.

    Args:
        modes: what the camera offers.
        ranks: formats that may be used, with their rank; the lowest is the best.
        size: the only size, or None for any.
        rate_hz: the only rate, or None for any of at least `LEAST_HZ`.
    """
    found = [
        Wish(mode, rate)
        for mode in modes
        if mode.fourcc in ranks and size in (None, mode.size) and _can_be_read(mode.size)
        for rate in _wanted(mode.rates_hz, rate_hz)
    ]
    return sorted(found, key=lambda wish: _order(wish, ranks), reverse=True)


def is_near(rate_hz: float | Fraction, wanted_hz: float | Fraction) -> bool:
    """True if a rate is the one that was asked for, as exactly as people write it."""
    return abs(float(rate_hz) / float(wanted_hz) - 1) <= _NEAR


def in_words(modes: Sequence[Mode]) -> str:
    """The modes as a list, e.g. "YUYV 640×480 at 30, 15; MJPG 1280×720 at 60"."""
    words = [f"{mode.fourcc} {mode.columns}×{mode.lines}{_rates_in_words(mode)}" for mode in modes]
    more = f"; and {len(words) - _MOST_IN_WORDS} more" if len(words) > _MOST_IN_WORDS else ""
    return ("; ".join(words[:_MOST_IN_WORDS]) + more) or "nothing"


def _size_of(told: abi.FrmSizeEnum, wanted: Size | None) -> Size:
    if told.type == abi.FRMSIZE_TYPE_DISCRETE:
        return int(told.discrete.width), int(told.discrete.height)
    span = told.stepwise
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


def _rates_of(told: abi.FrmIvalEnum, wanted_hz: float | None) -> Iterator[Fraction]:
    if told.type == abi.FRMIVAL_TYPE_DISCRETE:
        yield from _rate(told.discrete)
        return
    span = told.stepwise
    for most in _rate(span.min):
        least = next(_rate(span.max), Fraction(0))
        if wanted_hz is not None and least <= wanted_hz <= most:
            yield Fraction(wanted_hz).limit_denominator(1001)
        else:
            yield most


def _rate(interval: abi.Fraction) -> Iterator[Fraction]:
    """The rate of an interval; none if the driver fills it with zeros."""
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
