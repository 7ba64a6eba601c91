"""Offset of a vacuum logger's clock from the camera's, found from the wall's movement.

The wall follows the vacuum: it passes half its stroke a little after the chamber's vacuum passes half its
height. Observable is only that delay between two clocks, the sum of their offset and the wall's lag:

    wall's half stroke (camera's clock) - vacuum's half height (logger's clock) = offset + lag

The data cannot separate the two, so the lags of opening and closing are inputs. They depend on the liner and
its mounting and are measured once with a common signal on both clocks (a lamp in the picture that the logger
switches). All cycles are alike, so the offset is determined only up to multiples of the cycle; the coarse
difference of the clocks (`near_s`) selects one.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.pulsation.phases import edges, maximum_kpa, smoothed
from grabberd_liner.analysis.pulsation.pulsation import Pulsation, Run
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog
from grabberd_liner.arrays import Array

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
