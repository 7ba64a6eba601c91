"""Numbers of pictures by their own times: a gap is lost pictures, an even drift the camera's pace.

Recorders round times, or stamp a picture when it came, so that times jitter; a picture that was dropped
leaves a gap of whole periods. One picture alone does not tell which it was, so a few numberings are followed
side by side until those after it have decided (as for a live camera: docs/reference/numbering.md).
"""

from collections import deque
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import NTSC_HZ
from grabberd.core.ledger import UNCERTAIN
from grabberd.errors import PictureError

LOOKED_AT = 64
"""Pictures by whose times the period and the jitter are found."""
_CLOCK_OFF = 5e-4
"""Departure of a camera's clock, or of times in whole milliseconds, from a nominal rate."""
_NTSC_PICTURE_HZ, _FILM_HZ = NTSC_HZ / 2, 24000 / 1001
_STEADY = 0.3
"""Share of a period within which a time belongs to its number."""
_LEAST_SIGMA, _MOST_SIGMA = 0.03, 0.15
"""Jitter in periods: below the first it is of no importance, beyond the second it hides gaps."""
_TICK_S = 0.001
"""Step of the coarsest times: Matroska's."""
_LOSS, _OUTLIER, _NEW_PHASE = 6.0, 8.0, 12.0
"""Costs, in nats, of a gap, of a time that is off by any amount, and of another phase after it."""
_KEPT, _WORSE, _CLEAR = 12, 25.0, 4.0
"""Numberings that are followed; costs by which the others are dropped, and by which the best is believed."""
_WAITING = 20
"""Pictures after which a number is decided at the latest."""
_GAIN = 0.2
"""Share of a time's departure that the phase follows at most; less where times jitter more."""
_TOO_MANY_OFF, _OF_LATE = 6, 12
"""Pictures off their time, among the latest, that are a change of the rate."""
_MOST_PICTURES = 1 << 30
_AS_WELL = 0.98
_SPARSEST = 4.0
"""Periods from one picture to the next, at which so many are missing that none can be known."""
_SEARCHED = 0.1
"""Share by which the rate may differ from that of the middle step."""

T = TypeVar("T")


class Numbered(NamedTuple, Generic[T]):
    """A picture with its number.

    Attributes:
        number: Steps of the period since the first picture.
        time_s: Time of its exposure since the first one, by the steady pace: without the jitter of its own.
        picture: What was numbered.
        damage: "number uncertain by up to 1" where its time does not decide; else None.
    """

    number: int
    time_s: float
    picture: T
    damage: str | None


class Pace(NamedTuple):
    """Pace of a recording by the times of its first pictures.

    Attributes:
        period_s: Time from picture to picture.
        sigma: Jitter of the times, in periods.
        late: Periods by which the first picture's time is later than the others let expect.
    """

    period_s: float
    sigma: float
    late: float = 0.0

    @classmethod
    def of(cls, times_s: Sequence[float]) -> "Pace | None":
        """The pace of these pictures; None for fewer than two different times."""
        times = np.asarray(times_s, np.float64) - times_s[0]
        steps = np.diff(times)
        if not (steps > 0).any():
            return None
        # Where many pictures are missing, the lesser steps are of one period. Half of a period would fit as
        # well as the whole: the longest of those that fit is the one. A small enough part fits anything.
        usual_s, *lesser_s = np.quantile(steps[steps > 0], (0.5, 0.25, 0.1))
        tried_s = [usual_s, *(step for step in lesser_s if step * _SPARSEST > usual_s)]
        tried = [_in_step(1 / float(step), times) for step in tried_s]
        best = max(abs(found) for _, found in tried)
        rate_hz, found = next(one for one in tried if abs(one[1]) > _AS_WELL * best)
        sigma = float(np.sqrt(-2 * np.log(np.clip(abs(found), 1e-9, 1.0)))) / (2 * np.pi)
        period_s = _nominal_s(1 / rate_hz, _TICK_S / float(times.max()))
        late = -float(np.angle(found)) / (2 * np.pi)
        # The angle leaves whole periods open: the second picture is at least one after the first.
        late += max(0, 1 - round(float(times[1]) / period_s + late))
        return cls(period_s, max(sigma, _LEAST_SIGMA, _TICK_S / 3 / period_s), late)

    @property
    def is_steady(self) -> bool:
        """True if the times jitter so little that a gap is told from them."""
        return self.sigma <= max(_MOST_SIGMA, _TICK_S / 3 / self.period_s)


def _in_step(rate_hz: float, times_s: NDArray[np.float64]) -> tuple[float, complex]:
    """The rate near this one at which all times fall together, whatever is missing between them: no count can
    go wrong; and their mean on the unit circle, whose length tells how closely.
    """
    span_s = float(times_s.max())
    found = 0j
    for width_hz, least in ((_SEARCHED * rate_hz, 0), (1 / (8 * span_s), 32)):
        reach = max(least, int(np.ceil(8 * width_hz * span_s)))
        tried_hz = rate_hz + width_hz * np.linspace(-1, 1, 2 * reach + 1)
        mean = np.exp(2j * np.pi * np.outer(tried_hz, times_s)).mean(axis=1)
        best = int(np.abs(mean).argmax())
        rate_hz, found = float(tried_hz[best]), complex(mean[best])
    return rate_hz, found


def _nominal_s(period_s: float, uncertain: float) -> float:
    """The period of a usual rate, where it is one."""
    rate = 1 / period_s
    usual = min(
        (max(float(round(rate)), 1.0), NTSC_HZ, _NTSC_PICTURE_HZ, _FILM_HZ), key=lambda one: abs(one - rate)
    )
    return 1 / usual if abs(usual * period_s - 1) < _CLOCK_OFF + uncertain else period_s


class _Path(NamedTuple):
    """A numbering of the pictures so far.

    Attributes:
        cost: What it takes to believe it.
        number, phase_s: Of the last picture: its number, and where it should have been by the pace.
        period_s: The pace by then.
        waiting: Numbers, times and shares of a period off of the pictures that are not decided yet.
    """

    cost: float
    number: int
    phase_s: float
    period_s: float
    waiting: tuple[tuple[int, float, float], ...]


class Timeline(Generic[T]):
    """Numbers pictures, one after another.

    Args:
        source: What the pictures are of, for messages.
        pace: The pace to begin with.
        steps: Numbers that a step of the pace has, where a greater rate was stated than the pictures show.
    """

    def __init__(self, source: object, pace: Pace, steps: int = 1) -> None:
        self._source, self._steps = source, steps
        self._period_s, self._sigma = pace.period_s / steps, pace.sigma * steps
        self._gain = min(_GAIN, 0.01 / self._sigma)
        self._first_s = -pace.late * pace.period_s
        self._paths: list[_Path] = []
        self._pictures: deque[T] = deque()
        self._off: deque[bool] = deque(maxlen=_OF_LATE)
        self._begin_s = self._last_s = 0.0

    def take(self, picture: T, time_s: float | None) -> Iterator[Numbered[T]]:
        """The pictures whose numbers are decided now.

        Args:
            picture: The next one.
            time_s: Its time; None if it has none, so that it simply follows.

        Raises:
            PictureError: the rate has changed, or the time is none that a recording can have.
        """
        self._pictures.append(picture)
        if not self._paths:
            self._begin_s = time_s or 0.0
            self._paths = [_Path(0.0, 0, self._first_s, self._period_s, ((0, self._first_s, 0.0),))]
        else:
            # A picture whose time does not pass the one before has none of its own.
            since_s = self._begin_s - 1.0 if time_s is None else time_s - self._begin_s
            known = since_s > self._last_s
            self._check(since_s)
            followed = [one for path in self._paths for one in self._next(path, since_s if known else None)]
            best = sorted(followed, key=lambda one: one.cost)[:_KEPT]
            self._paths = _distinct([one for one in best if one.cost <= best[0].cost + _WORSE])
            self._last_s = since_s if known else self._last_s
        yield from self._decided(_WAITING)

    def end(self) -> Iterator[Numbered[T]]:
        """All others, since no more pictures come."""
        yield from self._decided(0)

    def _check(self, since_s: float) -> None:
        if since_s / self._period_s >= _MOST_PICTURES:
            raise PictureError(
                f"{self._source}: a picture is {since_s:.0f} s after the start, as no recording is",
                "its times are damaged: convert it once more; what came before it is kept",
            )

    def _next(self, path: _Path, since_s: float | None) -> Iterator[_Path]:
        if since_s is None:
            yield self._step(path, self._steps, 0.0)
            return
        ahead = (since_s - path.phase_s) / path.period_s
        least = self._steps  # no two pictures are of one moment, whatever their times
        # It may have been lost, or be late by any amount.
        for step in {least, *(max(least, round(ahead) + beside) for beside in (-1, 0, 1))}:
            off = ahead - step
            yield self._step(path, step, off)
            if step > least:  # a camera that started again
                settled = self._step(path, step, 0.0)
                waiting = (*path.waiting, (settled.number, since_s, off))
                cost = settled.cost + _NEW_PHASE + abs(off)
                yield settled._replace(cost=cost, phase_s=since_s, waiting=waiting)

    def _step(self, path: _Path, step: int, off: float) -> _Path:
        """The path after a picture so many steps on, which is off its time by so many periods."""
        cost = path.cost + min(0.5 * (off / self._sigma) ** 2, _OUTLIER * (1 + min(abs(off), 1)))
        cost += _LOSS if step > self._steps else 0.0
        number, phase_s, period_s = path.number + step, path.phase_s + step * path.period_s, path.period_s
        if abs(off) <= _STEADY:
            phase_s += self._gain * off * period_s
            period_s += self._gain**2 / 2 * off * period_s / step
        return _Path(cost, number, phase_s, period_s, (*path.waiting, (number, phase_s, off)))

    def _decided(self, most: int) -> Iterator[Numbered[T]]:
        while self._pictures:
            best = self._paths[0]
            number, time_s, off = best.waiting[0]
            others = [one for one in self._paths[1:] if one.waiting[0][0] != number]
            if others and len(self._pictures) <= most:
                return
            doubt = any(one.cost < best.cost + _CLEAR for one in others)
            doubt |= self._is_off_again(off, time_s)
            self._paths = [
                one._replace(waiting=one.waiting[1:]) for one in self._paths if one.waiting[0][0] == number
            ]
            damage = f"{UNCERTAIN} 1" if doubt else None
            yield Numbered(number, time_s - self._first_s, self._pictures.popleft(), damage)

    def _is_off_again(self, off: float, time_s: float) -> bool:
        """True if more than a single one of the latest pictures is off its time."""
        self._off.append(abs(off) > _STEADY)
        if sum(self._off) >= _TOO_MANY_OFF:
            period_ms = self._period_s * 1e3
            raise PictureError(
                f"{self._source}: about {time_s:.3f} s its pictures no longer come {period_ms:.4g} ms apart: "
                "its rate varies, and a picture's number cannot be known",
                "record at a constant rate; what came before it is kept",
            )
        return self._off[-1] and sum(self._off) > 1


def _distinct(paths: Sequence[_Path]) -> list[_Path]:
    """The best of the paths that have come to the same number and about the same phase."""
    best: dict[tuple[int, int], _Path] = {}
    for path in paths:
        best.setdefault((path.number, round(4 * path.phase_s / path.period_s)), path)
    return list(best.values())


def apart_ms(times_s: Sequence[float]) -> tuple[float, float]:
    """Least and greatest time from one picture to the next, in ms."""
    steps = [(b - a) * 1e3 for a, b in pairwise(times_s)]
    return min(steps), max(steps)
