"""The pressure difference across the liner's wall at which milk just stops flowing, by a sensor of the flow.

Overpressure is the difference in phase d less that at which the flow stops (Thompson et al., doi
10.3168/jds.2020-18854). Two ways to it need a sensor of flow, light or conductivity in the short milk tube:

    derived   the chamber pulsates: milk flows for as long as the difference is below that sought, so the
              duration of the flow, laid on the curve of the difference, gives it. Milk takes its time from
              the teat to the sensor, which shifts both ends of the flow alike and not its duration.
    raised    the chamber is held in phase d, and its vacuum raised slowly until milk starts to flow.

A gauge's zero is in both differences alike and cancels in the overpressure.
"""

from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.errors import AnalysisError, count_of
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.phases import edges
from grabberd_liner.analysis.pulsation.pulsation import LONGEST_S
from grabberd_liner.analysis.vacuum.vacuum_log import reading_noise

AT_REST_KPA = 0.5
"""The chamber is in the middle of phase d while its vacuum is no more than that above its lowest."""
_LEVEL_KPA = 0.05
_LEAST_SWING = 8.0
"""σ of a reading by which the flow's two levels have to be apart."""
_HALFWAY = (0.25, 0.75)
"""Shares of the flow's swing; it begins and ends halfway between its passages of both."""
_JUST = (0.1, 0.3)
"""The same where it just starts: at the first, and by the second it is certain."""
_LEAST_CYCLES, _MOST_UNLIKE = 3, 0.2
_LEVELS = 100
_BAND_KPA = 0.4
"""Half width of the band whose two crossings average to the level between them, where readings are quiet."""
_BY_CHANCE = 3.0
_GAP_STEPS = 3.0
_FASTEST_KPA_PER_S = 2.0
_SLOWEST_KPA_PER_S = 0.02
_LONGEST_WAY_S = 0.2
"""Of the milk from the teat to the sensor: σ of a start is what the vacuum rises by meanwhile."""
_AROUND_S = 0.5
_OF_MEDIAN = 1.2533
"""σ of a median by that of a mean."""
_SENSOR = (
    "look at the sensor's readings in the capture's channels: high while milk flows, low while it does not"
)


class DifferenceCurve(NamedTuple):
    """K readings of the pressure difference across the wall.

    Attributes:
        time_s: (K,) ascending.
        chamber_kpa: (K,) vacuum in the pulsation chamber, below atmosphere.
        difference_kpa: (K,) pulsation chamber over liner: the liner's vacuum less the chamber's.
        noise_kpa: σ of one reading of the difference.
        gauge_sigma_kpa: σ of its zero, common to all readings.
    """

    time_s: Array
    chamber_kpa: Array
    difference_kpa: Array
    noise_kpa: float = 0.0
    gauge_sigma_kpa: float = 0.0

    @property
    def closed_kpa(self) -> Estimate:
        """The difference in the middle of phase d: the median while the chamber's vacuum is at its lowest."""
        at_rest = self.difference_kpa[self.at_rest]
        return Estimate.of(np.median(at_rest), _OF_MEDIAN * self.noise_kpa / np.sqrt(len(at_rest)))

    @property
    def at_rest(self) -> Mask:
        """(K,) True while the chamber's vacuum is at its lowest."""
        low = self.chamber_kpa <= np.percentile(self.chamber_kpa, 1) + AT_REST_KPA + 3 * self.noise_kpa
        # Where it is raised slowly, some of these belong to the slope.
        return self.chamber_kpa <= np.median(self.chamber_kpa[low]) + _LEVEL_KPA + 2 * self.noise_kpa

    @property
    def rises_s(self) -> Array:
        """Times at which the chamber's vacuum rises through half its height."""
        low, high = np.percentile(self.chamber_kpa, (1, 99))
        if high - low < 10 * max(self.noise_kpa, AT_REST_KPA):
            return np.empty(0)
        found = _passages(self.time_s, self.chamber_kpa, (low + high) / 2, (high - low) / 10)
        return found.times_s[found.rising]

    @property
    def pulsates(self) -> bool:
        """True if the chamber's vacuum goes up and down cycle by cycle."""
        rises_s = self.rises_s
        return len(rises_s) > 1 and float(np.median(np.diff(rises_s))) < LONGEST_S


class FlowCurve(NamedTuple):
    """M readings of the flow, in any unit: `time_s` (M,) ascending, `level` (M,) higher while milk flows."""

    time_s: Array
    level: Array


class FlowStop(NamedTuple):
    """Result of one way.

    Attributes:
        difference_kpa: pressure difference at which milk just stops flowing; σ without the gauges' own.
        overpressure_kpa: the difference in phase d less that.
        duration_s: of the flow within a cycle; None if it was not used.
        averaged: number of cycles, of starts of the flow, or of states.
        common_kpa: part of σ that captures with the same gauges and inputs share.
    """

    difference_kpa: Estimate
    overpressure_kpa: Estimate
    duration_s: Estimate | None = None
    averaged: int = 1
    common_kpa: float = 0.0


def derived_flow_stop(curve: DifferenceCurve, flow: FlowCurve) -> FlowStop:
    """The difference at flow stop from the duration of the flow within a cycle.

    σ is what noise and times of the readings make, or the scatter from cycle to cycle where that is clearly
    greater, and what a sensor that rises otherwise than it falls may add to a duration.

    Raises:
        AnalysisError: the chamber does not pulsate, or the flow does not stop once in each of its cycles.
    """
    if not curve.pulsates:
        raise AnalysisError(
            "the chamber's vacuum does not pulsate, so milk flow has no duration within a cycle",
            "capture while the pulsator runs",
        )
    found = _passages_of_flow(flow, _HALFWAY)
    bounds_s = _bounds_s(curve)
    begins, ends = _pulses(found, bounds_s, (curve.time_s, flow.time_s))
    duration_s = found.times_s[ends] - found.times_s[begins]
    levels_kpa, width_s = _widths(curve, bounds_s[_cycle_of(found, begins, ends, bounds_s)[:, None] + [0, 1]])
    each_kpa = _levels_of(duration_s, levels_kpa, width_s)
    by_s = _kpa_per_s(float(each_kpa.mean()), levels_kpa, width_s)
    unlike_s, sampling_s = _edge_sigmas(found, begins, ends, flow)
    count = len(each_kpa)
    sampling_s *= np.sqrt(_alike(curve.rises_s, flow.time_s, count))
    least_kpa = np.hypot(sampling_s * by_s, curve.noise_kpa / np.sqrt(4 * count))
    own_kpa = np.hypot(_sigma_of_mean(each_kpa, float(least_kpa)), unlike_s * by_s)
    own_s = _sigma_of_mean(duration_s, float(sampling_s))
    return _flow_stop(
        curve,
        Estimate.of(each_kpa.mean(), own_kpa),
        Estimate.of(duration_s.mean(), np.hypot(own_s, unlike_s)),
        count,
    )


def raised_flow_stop(curve: DifferenceCurve, flow: FlowCurve) -> FlowStop:
    """The difference at flow stop from the start of the flow while the vacuum of a resting chamber is raised.

    Each start counts; σ is what noise, threshold and the milk's way to the sensor make, or their scatter
    where that is clearly greater.

    Raises:
        AnalysisError: the chamber pulsates, or no milk starts to flow while its vacuum rises slowly.
    """
    if curve.pulsates:
        raise AnalysisError(
            "the chamber's vacuum pulsates instead of being raised until milk starts to flow",
            "hold the pulsator in phase d, and raise the chamber's vacuum slowly",
        )
    found = _passages_of_flow(flow, _JUST)
    starts = [
        start
        for first_s, last_s in zip(found.first_s[found.rising], found.last_s[found.rising], strict=True)
        if (start := _start(curve, float(first_s), float(last_s))) is not None
    ]
    if not starts:
        raise AnalysisError(
            f"milk starts to flow {count_of(int(found.rising.sum()), 'time')}, but never while the chamber's "
            f"vacuum rises from rest by less than {_FASTEST_KPA_PER_S:g} kPa/s",
            "hold the chamber in phase d for seconds, then raise its vacuum by .5 kPa/s, until milk flows",
        )
    value, sigma = np.array(starts).T
    # Threshold and way of the milk err to the same side every time.
    own_kpa = _sigma_of_mean(value, float(np.sqrt(np.mean(sigma**2))))
    return _flow_stop(curve, Estimate.of(value.mean(), own_kpa), None, len(value))


def _flow_stop(
    curve: DifferenceCurve, difference_kpa: Estimate, duration_s: Estimate | None, count: int
) -> FlowStop:
    closed = curve.closed_kpa
    over_kpa = closed.value - difference_kpa.value
    # What is not the gauge's zero may be its gain, which counts in proportion.
    by_gain = abs(float(curve.gauge_sigma_kpa * over_kpa / closed.value))
    sigma = float(np.linalg.norm([float(closed.sigma), float(difference_kpa.sigma), by_gain]))
    return FlowStop(difference_kpa, Estimate.of(float(over_kpa), sigma), duration_s, count, by_gain)


class _Passages(NamedTuple):
    """Passages (E,) through a band: its first and its last limit, and the noise and swing of what passes."""

    rising: Mask
    first_s: Array
    last_s: Array
    noise: float = 0.0
    swing: float = 1.0

    @property
    def times_s(self) -> Array:
        return (self.first_s + self.last_s) / 2


def _passages(time_s: Array, values: Array, level: float, band: float) -> _Passages:
    return _Passages(*edges(time_s, values, level - band, level + band))


def _passages_of_flow(flow: FlowCurve, shares: tuple[float, float]) -> _Passages:
    """Passages of the flow through a band of its swing.

    Raises:
        AnalysisError: the flow has no two levels.
    """
    ends = np.percentile(flow.level, (2, 98))
    above = flow.level > ends.mean()
    if not above.any() or above.all():
        raise AnalysisError(f"the reading of milk flow is {ends.mean():.3g} all the time", _SENSOR)
    low, high = float(np.median(flow.level[~above])), float(np.median(flow.level[above]))
    noise, swing = reading_noise(flow.level), high - low
    if swing < _LEAST_SWING * noise:
        raise AnalysisError(
            f"milk flow cannot be told from noise: readings change by {swing:.3g}, their σ is {noise:.2g}",
            _SENSOR,
        )
    # A threshold within the noise would be passed by chance.
    first = low + max(shares[0] * swing, _LEAST_SWING / 2 * noise)
    found = edges(flow.time_s, flow.level, first, first + (shares[1] - shares[0]) * swing)
    return _Passages(*found, noise, swing)


def _bounds_s(curve: DifferenceCurve) -> Array:
    """(C + 1,) bounds of the cycles, each in the middle of a phase d."""
    low, high = np.percentile(curve.chamber_kpa, (1, 99))
    found = _passages(curve.time_s, curve.chamber_kpa, (low + high) / 2, (high - low) / 10)
    falls = np.flatnonzero(~found.rising[:-1])
    return np.asarray((found.times_s[falls] + found.times_s[falls + 1]) / 2)


def _pulses(found: _Passages, bounds_s: Array, readings_s: tuple[Array, Array]) -> tuple[Indices, Indices]:
    """Indices of the passages with which the flow begins and ends, of the cycles in which it does so once.

    Raises:
        AnalysisError: these are too few.
    """
    begins = np.flatnonzero(found.rising[:-1])
    ends = begins + 1
    middle_s = (found.times_s[begins] + found.times_s[ends]) / 2
    cycle = np.searchsorted(bounds_s, middle_s) - 1
    count = len(bounds_s) - 1
    times = np.bincount(cycle[(cycle >= 0) & (cycle < count)], minlength=max(count, 0))
    whole = np.array([_whole(readings_s, *bounds_s[k : k + 2]) for k in range(count)], bool)
    good = (times == 1) & whole if count > 0 else whole
    # The first or the last flow may be cut off.
    if good.sum() < _LEAST_CYCLES or (whole & ~good).sum() > 1 + _MOST_UNLIKE * count:
        raise AnalysisError(
            f"milk flow begins and ends once in {int(good.sum())} of {max(count, 0)} cycles only",
            f"capture some twenty cycles while milk flows freely; {_SENSOR}",
        )
    use = (cycle >= 0) & (cycle < count)
    use[use] = good[cycle[use]]
    return begins[use], ends[use]


def _whole(readings_s: tuple[Array, Array], first_s: float, last_s: float) -> bool:
    """True if no reading is missing between two times."""
    for time_s in readings_s:
        inside = time_s[(time_s >= first_s) & (time_s <= last_s)]
        steps = np.diff(inside)
        if len(inside) < 4 or steps.max() > _GAP_STEPS * np.median(np.diff(time_s)):
            return False
    return True


def _cycle_of(found: _Passages, begins: Indices, ends: Indices, bounds_s: Array) -> Indices:
    middle_s = (found.times_s[begins] + found.times_s[ends]) / 2
    return np.asarray(np.searchsorted(bounds_s, middle_s) - 1)


def _widths(curve: DifferenceCurve, cycles_s: Array) -> tuple[Array, Array]:
    """Durations for which the difference is below each of L levels in each of C cycles (C, 2).

    Returns:
        (L,) levels in kPa, and (C, L) durations, NaN where a cycle does not pass a level.
    """
    band = max(_BAND_KPA, 3 * curve.noise_kpa)
    low, high = np.percentile(curve.difference_kpa, (1, 99))
    levels_kpa = np.linspace(low + 2 * band, high - 2 * band, _LEVELS)
    width_s = np.full((len(cycles_s), _LEVELS), np.nan)
    for column, level in enumerate(levels_kpa):
        found = _passages(curve.time_s, curve.difference_kpa, level, band)
        falls_s, rises_s = (np.append(found.times_s[use], np.inf) for use in (~found.rising, found.rising))
        first = falls_s[np.searchsorted(falls_s[:-1], cycles_s[:, 0])]
        at = np.searchsorted(rises_s[:-1], cycles_s[:, 1]) - 1
        last = np.where(at >= 0, rises_s[at], -np.inf)
        inside = (first < cycles_s[:, 1]) & (last > first)
        width_s[inside, column] = (last - first)[inside]
    return levels_kpa, width_s


def _levels_of(duration_s: Array, levels_kpa: Array, width_s: Array) -> Array:
    """(C,) the level below which the difference is for as long as milk flows, cycle by cycle.

    Raises:
        AnalysisError: it is on none of the flanks.
    """
    each = np.full(len(duration_s), np.nan)
    for row, (lasts, widths) in enumerate(zip(duration_s, width_s, strict=True)):
        known = np.isfinite(widths)
        if known.sum() > 1:
            ascending = np.maximum.accumulate(widths[known])
            each[row] = np.interp(lasts, ascending, levels_kpa[known], left=np.nan, right=np.nan)
    if not np.isfinite(each).all():
        known_s = width_s[np.isfinite(width_s)]
        limits = f"{known_s.min():.3f} to {known_s.max():.3f} s" if len(known_s) else "no duration"
        raise AnalysisError(
            f"milk flows for {np.median(duration_s):.3f} s of a cycle, and the flanks of the pressure "
            f"difference hold {limits}: it stops on neither of them",
            f"capture while milk flows freely, and check which reading means that it flows; {_SENSOR}",
        )
    return each


def _kpa_per_s(at_kpa: float, levels_kpa: Array, width_s: Array) -> float:
    """Change of a level with the duration below it."""
    known = np.isfinite(width_s).all(axis=0)
    slope = np.gradient(width_s[:, known].mean(axis=0), levels_kpa[known])
    return 1 / float(np.interp(at_kpa, levels_kpa[known], slope))


def _edge_sigmas(found: _Passages, begins: Indices, ends: Indices, flow: FlowCurve) -> tuple[float, float]:
    """σ of a duration by a sensor that rises otherwise than it falls, and by the readings of each.

    A sensor that is as slow at the flow's end as at its beginning shifts both alike.
    """
    step_s = float(np.median(np.diff(flow.time_s)))
    passing_s = [float(np.median(found.last_s[at] - found.first_s[at])) for at in (begins, ends)]
    # A flow that jumps from one reading to the next passes half of its swing in half a step.
    steep = [min(1.0, step_s / 2 / max(one, 1e-9)) for one in passing_s]
    sampling_s = step_s / np.sqrt(12) * np.linalg.norm(steep)
    noise_s = np.linalg.norm(passing_s) * np.sqrt(2) * found.noise / found.swing
    # A passage's length has twice the noise of its middle.
    by_chance_s = 2 * _OF_MEDIAN * noise_s / np.sqrt(len(begins))
    unlike_s = abs(passing_s[1] - passing_s[0])
    return unlike_s * float(unlike_s > 2 * by_chance_s), float(np.hypot(sampling_s, noise_s))


def _alike(rises_s: Array, readings_s: Array, count: int) -> float:
    """Share of the variance of one reading's time that is left in the mean over cycles.

    It is 1 / count, but for a pulsator in step with the logger, whose readings fall on the same phases.
    """
    step_s = float(np.median(np.diff(readings_s)))
    rises = len(rises_s)
    # 1 on average where the phases are random, and above 3 in 5 % of cases.
    resultant = float(abs(np.exp(2j * np.pi * rises_s / step_s).sum()) ** 2) / rises
    common = (resultant - 1) / (rises - 1) if resultant > _BY_CHANCE else 0.0
    return common + (1 - common) / count


def _sigma_of_mean(values: Array, expected: float) -> float:
    """σ of the mean: as expected, or by the scatter of the values where that is clearly greater."""
    count = len(values)
    if count < 2:
        return expected
    scatter = float(values.std(ddof=1)) / np.sqrt(count)
    clearly = np.sqrt(1 + 2 * np.sqrt(2 / (count - 1)))
    return float(scatter) if scatter > clearly * expected else expected


def _start(curve: DifferenceCurve, first_s: float, last_s: float) -> tuple[float, float] | None:
    """The difference at a start of the flow, with σ; None unless the chamber's vacuum rises slowly then."""
    around = np.abs(curve.time_s - first_s) <= _AROUND_S
    before = curve.at_rest & (curve.time_s < first_s - _AROUND_S)
    if around.sum() < 4 or not before.any() or first_s - curve.time_s[0] < 2 * _AROUND_S:
        return None
    slope, value = np.polyfit(curve.time_s[around] - first_s, curve.difference_kpa[around], 1)
    if not _SLOWEST_KPA_PER_S < -slope < _FASTEST_KPA_PER_S:
        return None
    certain_kpa = float(np.interp(last_s, curve.time_s, curve.difference_kpa))
    return float(value), float(
        np.linalg.norm(
            [curve.noise_kpa / np.sqrt(around.sum()), (value - certain_kpa) / 2, slope * _LONGEST_WAY_S]
        )
    )
