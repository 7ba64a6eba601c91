"""The offset of a logger's clock, found through a light that is in the picture and in its readings."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import NumberedField
from grabberd.core.measurement.flashing import FlashingPlace, Levels, flashing_places, tile_levels
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.vacuum.light_clock import (
    LightClock,
    LightSignal,
    agreement_at_best,
    relate_clocks,
)
from grabberd_liner.analysis.vacuum.vacuum import ChannelCurve
from grabberd_liner.arrays import Array

MOST_FIELDS = 3000
"""Fields that are looked at, those of a minute at 50 a second and of 25 s at 120: they give the offset to a
tenth of a millisecond. Each takes up to 26 kB, and several times that while they are searched.
"""
_LEAST_FIELDS, _FITS = 50, 4
_MOST_SCATTER_S = 3e-3
"""Median departure from equal steps that stamps may have, far below what a missing field makes."""
_LEAST_SWING = 0.8
"""Share of the readings that lie near one of both states of a light's input."""


class FoundLight(NamedTuple):
    """The light in the picture, and the clocks' relation that it tells.

    Attributes:
        clock: Relation of the clocks.
        x_px: Column of the light's middle, frame pixels; `y_px`: its frame line.
        logger: Name of the logger that recorded it with the capture; None for that of a log.
        delay_sigma_s: σ of what all of that one's readings are late by.
    """

    clock: LightClock
    x_px: float
    y_px: float
    logger: str | None = None
    delay_sigma_s: float = 0.0

    def sigma_s(self, curve: ChannelCurve, camera_s: Array) -> float:
        """σ of a recorded channel's times on the camera's clock, at times (F,) of the camera.

        What all readings of one logger are late by, its light has seen as well.
        """
        delays_s = 0.0 if curve.logger == self.logger else np.hypot(curve.delay_sigma_s, self.delay_sigma_s)
        scatter_s = np.sqrt(max(curve.time_sigma_s**2 - curve.delay_sigma_s**2, 0.0))
        return float(np.sqrt(self.clock.sigma_s(camera_s) ** 2 + delays_s**2 + scatter_s**2))


def find_light(fields: Iterable[NumberedField], first_ns: int, logged: LightSignal) -> FoundLight:
    """Finds the light in the fields and the offset between the camera's clock and the logger's.

    Args:
        fields: Fields of a capture.
        first_ns: Time from which the camera's seconds count.
        logged: The light's state in each reading of the logger.

    Raises:
        AnalysisError: There is no light in the picture that goes by the log, or it does not determine the
            offset.
    """
    time_s, levels, y_step = _levels(fields, first_ns)
    places = flashing_places(levels, y_step)
    if not places:
        raise AnalysisError(
            "no place in the picture goes on and off",
            "look at the picture for the light: it has to be in view, brighter than the threshold, and"
            " switched several times during the capture",
        )
    agreement = [agreement_at_best(LightSignal(time_s, place.lit), logged) for place in places]
    best: FlashingPlace = places[int(np.argmax(agreement))]
    return FoundLight(relate_clocks(LightSignal(time_s, best.lit), logged), best.x_px, best.y_px)


def _levels(fields: Iterable[NumberedField], first_ns: int) -> tuple[Array, Levels, int]:
    """Times in s, tile levels and the lines from row to row of the first fields."""
    numbers, times, levels, y_step = [], [], [], 1
    for field in fields:
        numbers.append(field.n)
        times.append((field.time_ns - first_ns) / 1e9)
        levels.append(tile_levels(field.packed))
        y_step = field.packed.y_step
        if len(times) == MOST_FIELDS:
            break
    if not times:
        raise AnalysisError("the capture has no fields", "choose a capture with fields")
    return steady_times(np.array(numbers), np.array(times)), np.stack(levels), y_step


def steady_times(number: NDArray[np.int64], time_s: Array) -> Array:
    """(F,) times of fields without the scatter of their stamps: a camera's fields come at equal steps.

    They stay as they are where they do not, as in a film that was cut.
    """
    if len(number) < _LEAST_FIELDS:
        return time_s
    kept = np.ones(len(number), np.bool_)
    for _ in range(_FITS):
        slope, start = np.polyfit(number[kept], time_s[kept], 1)
        departure = np.abs(time_s - start - slope * number)
        # Stamps are late now and then, by tens of milliseconds; those of half of the fields are not.
        kept = departure <= 4 * np.median(departure) + 1e-6
    fitted: Array = start + slope * number
    return fitted if np.median(departure) < _MOST_SCATTER_S else time_s


def logged_light(time_s: Array, level: Array, source: str = "the vacuum log's light") -> LightSignal:
    """The light's states in a log or a channel, from levels in any unit.

    Args:
        time_s: (K,) times of the readings.
        level: (K,) levels.
        source: What they are called for people.

    Raises:
        InputError: It has not two states.
    """
    low, high = np.percentile(level, (1, 99))
    near = np.minimum(np.abs(level - low), np.abs(level - high)) <= 0.25 * (high - low)
    if not high > low or near.mean() < _LEAST_SWING:
        raise InputError(
            f"{source} goes from {low:g} to {high:g} without two states",
            "record the voltage at the light, or 1 while it is on and 0 while it is off",
        )
    return LightSignal(time_s, level > (low + high) / 2)
