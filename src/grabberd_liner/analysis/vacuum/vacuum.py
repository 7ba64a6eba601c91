"""The vacuum on both sides of the wall at the fields' times: a constant, a pulsator's settings, a log, or a
channel that was recorded with the capture itself, on the clock of its fields.

Vacuum is in kPa below atmosphere. Each source has a method `at(time_s)` that returns it with σ, at times of
the camera's clock.

Offset of a vacuum logger's clock from the camera's, found from the wall's movement.

The wall follows the vacuum: it passes half its stroke a little after the chamber's vacuum passes half its
height. Observable is only that delay between two clocks, the sum of their offset and the wall's lag:

    wall's half stroke (camera's clock) - vacuum's half height (logger's clock) = offset + lag

The data cannot separate the two, so the lags of opening and closing are inputs. They depend on the liner and
its mounting and are measured once with a common signal on both clocks (a lamp in the picture that the logger
switches). All cycles are alike, so the offset is determined only up to multiples of the cycle; the coarse
difference of the clocks (`near_s`) selects one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.channels.vacuum import LEAST_KPA, MOST_KPA
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.phases import ISO_THRESHOLD_KPA, edges, maximum_kpa, smoothed
from grabberd_liner.analysis.pulsation.pulsation import Pulsation, Run
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog, reading_noise

# Slack for rounding of times.
_ROOM_S = 1e-6


class VacuumSource(Protocol):
    """Source of a vacuum."""

    @property
    def sigma_kpa(self) -> float:
        """σ of its gauge or setting, common to all times."""
        ...

    def at(self, time_s: Array) -> Estimate:
        """(F,) kPa below atmosphere at times of the camera's clock, with σ."""
        ...


@dataclass(frozen=True, slots=True)
class ConstantVacuum:
    """A constant vacuum, as approximately in the liner; its σ is an input, never assumed."""

    kpa: float
    sigma_kpa: float

    def __post_init__(self) -> None:
        if not 0 <= self.kpa <= MOST_KPA or not self.sigma_kpa >= 0:
            raise InputError(
                f"a vacuum of {self.kpa:g} kPa (σ {self.sigma_kpa:g}) is impossible for a milking machine",
                f"give kPa below atmosphere, 0 to {MOST_KPA:g}",
            )

    def at(self, time_s: Array) -> Estimate:
        """(F,) the constant vacuum."""
        return Estimate(np.full(len(time_s), self.kpa), np.full(len(time_s), self.sigma_kpa))


@dataclass(frozen=True, slots=True)
class PulsatorWave:
    """The chamber's vacuum according to the pulsator's settings: a trapezoid.

    Attributes:
        rate_per_min: pulsations a minute; `ratio`: (a + b) / (a + b + c + d), between 0 and 1.
        a_s, c_s: durations of ISO's phases a and c, from the test report of the pulsator.
        system_kpa: the chamber's maximum vacuum, with `sigma_kpa`.
        start_s: camera time at which phase a begins, with `start_sigma_s`.
    """

    rate_per_min: float
    ratio: float
    a_s: float
    c_s: float
    system_kpa: float
    sigma_kpa: float
    start_s: float = 0.0
    start_sigma_s: float = 0.0

    def __post_init__(self) -> None:
        problems = [text for wrong, text in self._problems() if wrong]
        if problems:
            raise InputError(f"the pulsator's settings cannot be used: {'; '.join(problems)}", "correct them")

    def _problems(self) -> list[tuple[bool, str]]:
        return [
            (not 20 <= self.rate_per_min <= 180, f"rate_per_min {self.rate_per_min:g} is not from 20 to 180"),
            (not 0.1 < self.ratio < 0.9, f"ratio {self.ratio:g} is not between .1 and .9 (60:40 is .6)"),
            (self.a_s <= 0 or self.c_s <= 0, "phases a and c must be longer than 0"),
            (
                not LEAST_KPA <= self.system_kpa <= MOST_KPA,
                f"system_kpa {self.system_kpa:g} is not from {LEAST_KPA:g} to {MOST_KPA:g}",
            ),
            (self.rate_per_min > 0 and self._room_s < 0, "phases a and c leave no room for b and d"),
        ]

    @property
    def period_s(self) -> float:
        """Length of the cycle."""
        return 60 / self.rate_per_min

    @property
    def _edge(self) -> float:
        """Lengthening of a slope beyond the thresholds, per second of its phase."""
        return ISO_THRESHOLD_KPA / max(self.system_kpa - 2 * ISO_THRESHOLD_KPA, 1.0)

    @property
    def _room_s(self) -> float:
        """Remainder of the shorter of phases b and d, after the slopes."""
        both = (self.a_s + self.c_s) * self._edge
        return min(self.ratio * self.period_s - self.a_s, (1 - self.ratio) * self.period_s - self.c_s) - both

    def kpa(self, time_s: Array) -> Array:
        """(F,) the trapezoid: straight slopes from 0 to the system's vacuum, through both thresholds."""
        rise, fall = self._edge * self.a_s, self._edge * self.c_s
        closes, full = self.ratio * self.period_s, self.system_kpa
        corners = [-rise, self.a_s + rise, closes - fall, closes + self.c_s + fall, self.period_s - rise]
        since = np.mod(time_s - self.start_s, self.period_s)
        again = self.period_s + self.a_s + rise
        return np.interp(since, [*corners, again], [0.0, full, full, 0.0, 0.0, full])

    def at(self, time_s: Array) -> Estimate:
        """(F,) the trapezoid, with σ from the vacuum's σ and, on the slopes, that of the start."""
        kpa = self.kpa(time_s)
        slope = _slope(self.kpa, time_s, max(self.start_sigma_s, 1e-3))
        share = kpa / self.system_kpa * self.sigma_kpa
        return Estimate(kpa, np.hypot(share, slope * self.start_sigma_s))

    def log(self, first_s: float, last_s: float, step_s: float = 1e-3) -> VacuumLog:
        """The wave in the form of a log, so that its start can be found like a log's offset."""
        time_s = np.arange(first_s, last_s, step_s)
        return VacuumLog(time_s, self.kpa(time_s))


@dataclass(frozen=True, slots=True, eq=False)
class LoggedVacuum:
    """One column of a log, on the camera's clock.

    Attributes:
        log: readings of the logger; `kpa`: (K,) the column used.
        offset_s: camera's time minus logger's, with `offset_sigma_s`.
        sigma_kpa: σ of the gauge, common to all readings.
    """

    log: VacuumLog
    kpa: Array
    offset_s: float
    offset_sigma_s: float
    sigma_kpa: float = 0.0

    def at(self, time_s: Array) -> Estimate:
        """(F,) vacuum interpolated between readings; σ from noise, the gauge and, on slopes, the offset.

        Raises:
            InputError: the log does not cover the times, or has a gap there; gaps are never filled.
        """
        own_s = time_s - self.offset_s
        self._check(time_s, own_s)

        def reading(at_s: Array) -> Array:
            return np.interp(at_s, self.log.time_s, self.kpa)

        slope = _slope(reading, own_s, max(self.offset_sigma_s, 2 * self.log.step_s))
        noise = np.hypot(reading_noise(self.kpa), self.sigma_kpa)
        return Estimate(reading(own_s), np.hypot(noise, slope * self.offset_sigma_s))

    def _check(self, time_s: Array, own_s: Array) -> None:
        covered = self.log.time_s[[0, -1]] + self.offset_s
        outside = (time_s < covered[0] - _ROOM_S) | (time_s > covered[1] + _ROOM_S)
        hint = (
            "give a log of the whole capture, check its offset, or analyse only the fields it covers"
            if self.log.channel is None
            else "the capture's channels say why; give the vacuum as a log or a constant instead"
        )
        if outside.any():
            raise InputError(
                f"{self.log.source} covers {covered[0]:.2f} to {covered[1]:.2f} s of the"
                f" camera's time, the fields {time_s.min():.2f} to {time_s.max():.2f} s:"
                f" {int(outside.sum())} of {len(time_s)} fields have no vacuum",
                hint,
            )
        for begin, end in self.log.gaps_s:
            inside = (own_s > begin) & (own_s < end)
            if inside.any():
                raise InputError(
                    f"{self.log.source} has a gap from {begin:.3f} to {end:.3f} s of its time, where"
                    f" {int(inside.sum())} fields are",
                    hint,
                )


def _slope(function: Callable[[Array], Array], time_s: Array, reach_s: float) -> Array:
    """(F,) mean slope within ± `reach_s`, per s."""
    return (function(time_s + reach_s) - function(time_s - reach_s)) / (2 * reach_s)


@dataclass(frozen=True, slots=True, eq=False)
class ChannelCurve:
    """K readings of one channel.

    Attributes:
        name: Quantity that it is of.
        time_s: (K,) when each was taken, from the capture's first field on, ascending.
        kpa: (K,) vacuum below atmosphere; of a channel that measures none, its own numbers.
        sigma_kpa: σ of its calibration, common to all readings.
        time_sigma_s: σ of its clock against that of the fields.
        delay_sigma_s: the part of it that is the same for all readings of its logger.
        logger: name of that logger.
        origin: Where it comes from, for people.
        remark: What to know before relying on its times, or None.
    """

    name: str
    time_s: Array
    kpa: Array
    sigma_kpa: float
    time_sigma_s: float
    origin: str
    remark: str | None = None
    delay_sigma_s: float = 0.0
    logger: str = ""

    def log(self) -> VacuumLog:
        """The readings in the form of a log.

        Raises:
            InputError: There are too few, or they are not vacuum in kPa.
        """
        return VacuumLog(self.time_s, self.kpa, channel=self.name)

    def source(self, offset_s: float, sigma_kpa: float) -> LoggedVacuum:
        """The vacuum at the fields' times.

        Args:
            offset_s: The camera's time less that of the readings.
            sigma_kpa: σ of the calibration.

        Raises:
            InputError: As `log`.
        """
        log = self.log()
        return LoggedVacuum(log, log.pulsation_kpa, offset_s, 0.0, sigma_kpa)


_HALF_BAND = 0.1
"""Half width, as a share of the vacuum, of the band whose two crossings average to half its height."""
_UNLIKE_RATE = 0.02
"""Relative difference of the cycles of log and wall above which they do not belong together."""


class WallLag(NamedTuple):
    """Delay from the vacuum's half height to the wall's half stroke.

    Attributes:
        opening_s: delay in opening; `closing_s`: delay in closing; `sigma_s`: σ of each.
    """

    opening_s: float
    closing_s: float
    sigma_s: float


@dataclass(frozen=True, slots=True)
class Offset:
    """The clocks' difference: camera's time = logger's time + offset.

    Attributes:
        opening_shift_s: offset + lag from the opening, with `opening_sigma_s`; `closing_shift_s` and
            `closing_sigma_s` likewise. Known up to multiples of `period_s`.
        lag: lag of the wall, or None if unknown.
        events: number of slopes of the vacuum used.
        period_s: length of the cycle.
    """

    opening_shift_s: float
    opening_sigma_s: float
    closing_shift_s: float
    closing_sigma_s: float
    lag: WallLag | None
    events: int
    period_s: float

    @property
    def offset_s(self) -> float:
        """Camera's time minus logger's: the mean from opening and closing.

        Raises:
            InputError: the wall's lag is unknown, so offset and lag cannot be separated.
        """
        return float(np.mean(self._each()))

    @property
    def sigma_s(self) -> float:
        """σ of the offset: noise, the lag's σ, and half the disagreement of opening and closing.

        Raises:
            InputError: the wall's lag is unknown.
        """
        first, second = self._each()
        lag_s = self.lag.sigma_s if self.lag is not None else 0.0
        noise_s = np.hypot(self.opening_sigma_s, self.closing_sigma_s) / 2
        return float(np.sqrt(noise_s**2 + lag_s**2 + ((first - second) / 2) ** 2))

    def _each(self) -> tuple[float, float]:
        if self.lag is None:
            raise InputError(
                f"the wall follows the log by {self.opening_shift_s:.4f} s (opening) and"
                f" {self.closing_shift_s:.4f} s (closing), the clocks' offset and the wall's lag in one sum:"
                " the data cannot separate them",
                "give the wall's lag of opening and closing with its σ, or the offset itself",
            )
        return self.opening_shift_s - self.lag.opening_s, self.closing_shift_s - self.lag.closing_s


def find_offset(log: VacuumLog, pulsation: Pulsation, lag: WallLag | None, near_s: float) -> Offset:
    """The offset of a log's clock from the camera's, with σ.

    Args:
        log: log with the pulsation vacuum.
        pulsation: pulsation whose capture 0 gives the camera's times.
        lag: lag of the wall behind the vacuum, or None if unknown.
        near_s: approximate offset, to within half a cycle, which selects the cycle.

    Raises:
        InputError: near that offset the log does not cover the capture.
        AnalysisError: log and wall pulsate differently.
    """
    top = maximum_kpa(log)
    middle, band = top / 2, _HALF_BAND * top
    found = edges(log.time_s, smoothed(log), middle - band, middle + band)
    times = (found.first_s + found.last_s) / 2
    _check_rate(times[found.rising], pulsation)
    opening = _shift(times[found.rising], pulsation, True, near_s)
    closing = _shift(times[~found.rising], pulsation, False, near_s)
    period_s = pulsation.period_s
    lags = (lag.opening_s, lag.closing_s) if lag is not None else (0.0, 0.0)
    first = _nearest(opening[0] - lags[0], near_s, period_s) + lags[0]
    second = _nearest(closing[0] - lags[1], first - lags[0], period_s) + lags[1]
    events = opening[2] + closing[2]
    return Offset(first, opening[1], second, closing[1], lag, events, period_s)


def _nearest(value: float, wanted: float, period_s: float) -> float:
    return float(value + round((wanted - value) / period_s) * period_s)


def _check_rate(rises_s: Array, pulsation: Pulsation) -> None:
    if len(rises_s) < 2:
        raise AnalysisError(
            f"the log's pulsation vacuum rises {len(rises_s)} times", "give a log of several pulsations"
        )
    cycle_s = float(np.median(np.diff(rises_s)))
    if abs(cycle_s / pulsation.period_s - 1) > _UNLIKE_RATE:
        raise AnalysisError(
            f"the vacuum's cycle is {cycle_s:.3f} s, the wall's {pulsation.period_s:.3f} s: they are not"
            " of one pulsator, or not of one time",
            "give the log of this capture's own pulsation chamber",
        )


def _shift(events_s: Array, pulsation: Pulsation, rising: bool, near_s: float) -> tuple[float, float, int]:
    """Shift of the wall against the vacuum, its σ, and the number of slopes of the vacuum."""
    phase, phase_sigma_s = _half_stroke(pulsation, rising)
    period_s = pulsation.period_s
    turns, weights = [], []
    for run in pulsation.runs:
        if run.capture == 0 and np.isfinite(run.start_sigma_s):
            own = _within(events_s, run, near_s, period_s)
            turns.append((run.start_s + phase * period_s - own) / period_s)
            weights.append(np.full(len(own), run.start_sigma_s))
    turn = np.concatenate([np.empty(0), *turns])
    if not len(turn):
        raise InputError(
            f"with an offset near {near_s:.2f} s the vacuum log does not cover the capture",
            "give the log of the capture's time, and roughly how far its clock differs",
        )
    # A circular mean: shifts just below and just above a whole cycle are neighbours.
    mean = np.angle(np.exp(2j * np.pi * turn).mean()) / (2 * np.pi)
    spread_s = (np.mod(turn - mean + 0.5, 1.0) - 0.5) * period_s
    events_sigma_s = float(np.sqrt((spread_s**2).sum() / max(len(turn) - 1, 1) / len(turn)))
    sigma_s = np.sqrt(events_sigma_s**2 + phase_sigma_s**2 + np.mean(np.concatenate(weights) ** 2))
    return float(mean * period_s), float(sigma_s), len(turn)


def _within(events_s: Array, run: Run, near_s: float, period_s: float) -> Array:
    """Events from half a cycle before a run to half a cycle after it."""
    camera_s = events_s + near_s
    room_s = period_s / 2
    return events_s[(camera_s >= run.first_s - room_s) & (camera_s <= run.last_s + room_s)]


def _half_stroke(pulsation: Pulsation, rising: bool) -> tuple[float, float]:
    """Phase at which the wall passes half its stroke, and its σ in s from noise."""
    waveform = pulsation.waveform
    middle = sum(waveform.levels()) / 2
    found = waveform.crossings(middle)[0 if rising else 1]
    if len(found) != 1:
        raise AnalysisError(
            f"the wall passes half its stroke {len(found)} times in the mean cycle",
            "give the offset itself; this movement does not determine it",
        )
    slope = abs(float(waveform.slope(found)[0]))
    return float(found[0]), float(waveform.sigma(found)[0]) / slope * pulsation.period_s
