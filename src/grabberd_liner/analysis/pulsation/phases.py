"""The four phases of a pulsation: ISO's by the vacuum, and those that the wall shows.

    a  vacuum rises from 4 kPa to 4 kPa below its maximum       wall: opens, from 10 to 90 % of the stroke
    b  vacuum stays above that                                  wall: is open
    c  vacuum falls to 4 kPa                                    wall: closes
    d  vacuum stays below 4 kPa                                 wall: is closed

(ISO 3918, ISO 5707, ISO 6690: 4 kPa under the pulsation chamber's maximum vacuum and 4 kPa over atmosphere.)
The wall lags behind the vacuum, differently in opening and closing; `defined_by` tells the two kinds apart.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.pulsation.movement import basis
from grabberd_liner.analysis.pulsation.pulsation import WALL_THRESHOLD, Pulsation
from grabberd_liner.analysis.vacuum.vacuum_log import VacuumLog, reading_noise

ISO_THRESHOLD_KPA = 4.0
_SMOOTHED_S = 0.006
"""Width of the running mean: short against the slopes of .1 s, long against a logger's sampling."""
_NEARLY_ALL = 99.0
"""Percentile that counts as the maximum: a single overshoot does not move the threshold."""
_CORNER, _STEEP = 0.05, 0.6
_BENT = 0.5
"""Share of the distance between series and straight line: chosen on two solved walls, held on four others."""
_ANYWHERE = 12**-0.5
_SHARES = (WALL_THRESHOLD, 1 - WALL_THRESHOLD, 1 - WALL_THRESHOLD, WALL_THRESHOLD)
LASER_MM = 1.0
"""Distance from the open and from the closed wall between which laser studies time its movement."""
_NO_PHASES = "check the log: its chamber vacuum has to rise and fall by well over 8 kPa, cycle after cycle"


@dataclass(frozen=True, slots=True, eq=False)
class Phases:
    """Durations of the phases.

    Attributes:
        durations_s: (4,) durations of a, b, c, d, with σ.
        period_s: their sum, with σ.
        ratio: pulsator ratio (a + b) / (a + b + c + d), with σ.
        defined_by: `vacuum` (ISO) or `wall`.
        spread_s: (4,) standard deviation from cycle to cycle; NaN if unknown.
        cycles: number of whole cycles averaged.
    """

    durations_s: Estimate
    period_s: Estimate
    ratio: Estimate
    defined_by: str
    spread_s: Array
    cycles: int


def wall_phases(pulsation: Pulsation, threshold_mm: float | None = None) -> Phases:
    """Wall phases of the mean cycle: the wall opens or closes between two levels.

    σ includes the fields' noise, the σ of the cycle length, and what the movement may do between two fields.

    Args:
        pulsation: the mean cycle.
        threshold_mm: distance of the levels from the closed and from the open one; None: 10 % of the stroke.

    Raises:
        AnalysisError: the movement crosses a level more than once per phase, or the stroke is too short.
    """
    waveform = pulsation.waveform
    low, high = waveform.levels()
    from_end_mm = WALL_THRESHOLD * (high - low) if threshold_mm is None else threshold_mm
    if from_end_mm >= (high - low) / 2:
        raise AnalysisError(
            f"the stroke of {high - low:.2f} mm leaves nothing between {from_end_mm:g} mm from its ends",
            "use the times by 10 and 90 % of the stroke",
        )
    levels = low + from_end_mm, high - from_end_mm, high - from_end_mm, low + from_end_mm
    phase = np.array([_passage(pulsation, level, k < 2) for k, level in enumerate(levels)])
    gradient = _passage_gradient(pulsation, phase, threshold_mm)
    parts = np.mod(np.roll(phase, -1) - phase, 1.0)
    unseen = _unseen_variance_s2(pulsation, phase, parts)
    return _of_wall(pulsation, parts, np.roll(gradient, -1, axis=0) - gradient, unseen)


def _passage_gradient(pulsation: Pulsation, phase: Array, threshold_mm: float | None) -> Array:
    """(4, 2K + 2) derivatives of the passages by the coefficients, and by the relative size of the movement.

    A share of the stroke does not depend on that size; a distance in mm does.
    """
    waveform = pulsation.waveform
    share = np.array([0.0, 1.0, 1.0, 0.0] if threshold_mm is not None else _SHARES)[:, None]
    ends = waveform.level_terms()
    levels = (1 - share) * ends[0] + share * ends[1]
    size_mm = (threshold_mm or 0.0) * np.array([-1.0, 1.0, 1.0, -1.0])[:, None]
    by_all = np.hstack([basis(phase, waveform.harmonics) - levels, size_mm])
    return np.asarray(-by_all / waveform.slope(phase)[:, None])


def _unseen_variance_s2(pulsation: Pulsation, phase: Array, parts: Array) -> Array:
    """(4,) variance of the passages by what the wall does in the gap between the fields around them.

    It grows with the gap's share in the opening or closing, up to that of a passage anywhere in the gap; the
    constants are what rendered closures of 20 to 150 ms scattered by. Where a wall bends sharply, as it does
    when it has nearly opened, how the series bends in the gap is a guess: a straight line is another one.
    """
    gaps = [pulsation.gap(float(one)) for one in phase]
    gap_s = np.array([last - first for first, last in gaps]) * pulsation.period_s
    flank_s = np.repeat(parts[[0, 2]], 2) * pulsation.period_s
    share = np.minimum(np.hypot(_CORNER, _STEEP * (gap_s / flank_s) ** 2), _ANYWHERE)
    straight = np.array(
        [_straight(pulsation, float(one), *gap) for one, gap in zip(phase, gaps, strict=True)]
    )
    bent_s = _BENT * (phase - straight) * pulsation.period_s
    return np.minimum(np.hypot(share * gap_s, bent_s), _ANYWHERE * gap_s) ** 2


def _straight(pulsation: Pulsation, phase: float, first: float, last: float) -> float:
    """Phase at which a straight line between the fields around a passage passes the same level."""
    at, begin, end = pulsation.waveform.value(np.array([phase, first, last]))
    if begin == end:
        return phase
    return first + float(np.clip((at - begin) / (end - begin), 0.0, 1.0)) * (last - first)


def _passage(pulsation: Pulsation, level: float, rising: bool) -> float:
    found = pulsation.waveform.crossings(level)[0 if rising else 1]
    if len(found) != 1:
        raise AnalysisError(
            f"the wall passes {level:.2f} mm {len(found)} times in a cycle: there are no four wall phases",
            "look at the movement in the report; a liner that flutters or sticks has no distinct phases",
        )
    return float(found[0])


def _of_wall(pulsation: Pulsation, parts: Array, gradient: Array, unseen_s2: Array) -> Phases:
    """Durations with σ.

    Args:
        pulsation: the mean cycle.
        parts: (4,) shares of the cycle.
        gradient: (4, 2K + 2) their derivatives by the coefficients, and by the movement's relative size.
        unseen_s2: (4,) variance of the passage that each phase begins with.
    """
    by_all = np.column_stack([parts, pulsation.period_s * gradient])
    count = len(pulsation.period_covariance)
    covariance = np.zeros((count + 2, count + 2))
    covariance[0, 0] = pulsation.period_sigma_s**2
    covariance[0, 1:-1] = covariance[1:-1, 0] = pulsation.period_covariance
    covariance[1:-1, 1:-1] = pulsation.waveform.covariance
    covariance[-1, -1] = pulsation.size_sigma**2
    spread = np.diagonal(by_all @ covariance @ by_all.T) + unseen_s2 + np.roll(unseen_s2, -1)
    open_part = gradient[0] + gradient[1]
    ratio_variance = open_part @ covariance[1:, 1:] @ open_part
    ratio_variance += (unseen_s2[0] + unseen_s2[2]) / pulsation.period_s**2
    return Phases(
        Estimate(parts * pulsation.period_s, np.sqrt(spread)),
        Estimate.of(pulsation.period_s, pulsation.period_sigma_s),
        Estimate.of(parts[0] + parts[1], np.sqrt(ratio_variance)),
        "wall",
        np.full(4, np.nan),
        int(pulsation.cycles),
    )


class Edges(NamedTuple):
    """Times at which a vacuum crossed two levels, edge by edge.

    Attributes:
        rising: (E,) bool; `first_s`: (E,) time at which the edge crossed its first level (the lower one of a
            rising edge), `last_s`: its second level.
    """

    rising: Mask
    first_s: Array
    last_s: Array


def edges(time_s: Array, kpa: Array, low_kpa: float, high_kpa: float) -> Edges:
    """Edges between two levels; several crossings of one level by noise count as one.

    An edge begins at the last reading beyond the level it leaves and ends at the first beyond the other.
    """
    state = np.where(kpa <= low_kpa, 0, np.where(kpa >= high_kpa, 1, -1))
    outside = np.flatnonzero(state >= 0)
    turn = np.flatnonzero(np.diff(state[outside]) != 0)
    start, end = outside[turn], outside[turn + 1]
    rising = state[start] == 0
    leaves, reaches = np.where(rising, low_kpa, high_kpa), np.where(rising, high_kpa, low_kpa)
    return Edges(rising, _crossed(time_s, kpa, start, leaves), _crossed(time_s, kpa, end - 1, reaches))


def _crossed(time_s: Array, kpa: Array, before: Indices, level: Array) -> Array:
    step = kpa[before + 1] - kpa[before]
    share = np.clip((level - kpa[before]) / np.where(step == 0, 1.0, step), 0.0, 1.0)
    return time_s[before] + share * (time_s[before + 1] - time_s[before])


def smoothed(log: VacuumLog) -> Array:
    """(K,) pulsation vacuum, running mean over 6 ms: it reduces noise without moving slopes."""
    width, kpa = _width(log), log.pulsation_kpa
    if width >= len(kpa):
        return kpa
    # The ends stay unsmoothed: a mean over fewer readings would shift slopes there.
    whole = np.convolve(kpa, np.full(width, 1 / width), mode="valid")
    return np.concatenate([kpa[: width // 2], whole, kpa[len(kpa) - width // 2 :]])


def _width(log: VacuumLog) -> int:
    return max(1, round(_SMOOTHED_S / log.step_s) // 2 * 2 + 1)


def maximum_kpa(log: VacuumLog) -> float:
    """The chamber's maximum vacuum: its 99th percentile less the bias by noise."""
    noise = reading_noise(log.pulsation_kpa) / np.sqrt(_width(log))
    return float(np.percentile(smoothed(log), _NEARLY_ALL) - 2 * noise)


def iso_phases(log: VacuumLog) -> Phases:
    """Phases a to d of a logged vacuum, averaged over its whole cycles; cycles with a gap are ignored.

    Raises:
        AnalysisError: the log has no whole cycle.
    """
    time_s, even = log.time_s, smoothed(log)
    high = maximum_kpa(log) - ISO_THRESHOLD_KPA
    found = edges(time_s, even, ISO_THRESHOLD_KPA, high)
    rises = np.flatnonzero(found.rising)
    rises = rises[rises + 2 < len(found.rising)]
    begins, ends = found.first_s[rises], found.first_s[np.minimum(rises + 2, len(found.rising) - 1)]
    for gap_begins, gap_ends in log.gaps_s:
        whole = (ends <= gap_begins) | (begins >= gap_ends)
        rises, begins, ends = rises[whole], begins[whole], ends[whole]
    if not len(rises):
        raise AnalysisError(
            f"{time_s[-1] - time_s[0]:.2f} s of pulsation vacuum hold no whole cycle", _NO_PHASES
        )
    durations = np.column_stack(
        [
            found.last_s[rises] - found.first_s[rises],
            found.first_s[rises + 1] - found.last_s[rises],
            found.last_s[rises + 1] - found.first_s[rises + 1],
            found.first_s[rises + 2] - found.last_s[rises + 1],
        ]
    )
    return _averaged(durations, log.step_s)


def _averaged(durations: Array, step_s: float) -> Phases:
    """Means over (C, 4) cycles; their σ is never below that of the sampling."""
    count = len(durations)
    period, ratio = durations.sum(axis=1), durations[:, :2].sum(axis=1) / durations.sum(axis=1)
    # A duration is the difference of two times, each uniform within a step: σ = step · √(2 / 12).
    sampling_s = step_s / np.sqrt(6.0)
    return Phases(
        _mean(durations, sampling_s),
        _mean(period, sampling_s),
        _mean(ratio, sampling_s / float(period.mean())),
        "vacuum",
        durations.std(axis=0, ddof=1) if count > 1 else np.full(4, np.nan),
        count,
    )


def _mean(values: Array, least: float) -> Estimate:
    count = len(values)
    spread = values.std(axis=0, ddof=1) if count > 1 else np.zeros(values.shape[1:])
    return Estimate(values.mean(axis=0), np.maximum(spread, least) / np.sqrt(count))


_BY_WALL = "phases of ISO 3918, by the wall's movement"
_BY_LASER = (
    "limits of a laser study, 1 mm less than fully open and 1 mm more than fully closed (Spencer and Jones "
    "2000), which are those of the place that its laser meets"
)
_BY_VACUUM = "ISO 3918 and ISO 6690, by the pulsation chamber's vacuum"
_RATIO = "(a + b) / (a + b + c + d)"

MOVEMENT: tuple[Quantity, Quantity] = (
    Quantity(
        "stroke_mm",
        "stroke",
        "mm",
        "Size of the wall's first principal movement in the mean cycle, told as that of the target that "
        "moves most, from the closed level to the open one; each is the mean over the part of the cycle that "
        "is within 1 % of the stroke of it.",
        "movement of the liner's wall as in laser measurements; here in space, of all targets together",
    ),
    Quantity(
        "rate_per_min", "pulsation rate", "1/min", "Cycles a minute.", "ISO 3918, by the wall's movement"
    ),
)
"""Stroke and rate."""
WALL: Mapping[str, Quantity] = {
    letter: Quantity(
        f"liner_{word}_s", f"liner {word} time", "s", f"Time {what}: wall phase {letter}.", _BY_WALL
    )
    for letter, word, what in (
        ("a", "opening", "in which the wall moves from 10 to 90 % of its stroke"),
        ("b", "open", "for which the wall stays beyond 90 % of its stroke"),
        ("c", "closing", "in which the wall moves back from 90 to 10 % of its stroke"),
    )
} | {
    "ratio": Quantity(
        "wall_ratio", "ratio by the wall's movement", "1", f"{_RATIO} of the wall phases.", _BY_WALL
    )
}
"""Durations of wall phases and their ratio; the duration of d is the massage's."""
WALL_1MM: Mapping[str, Quantity] = {
    letter: Quantity(
        f"liner_{word}_1mm_s",
        f"liner {word} time by 1 mm",
        "s",
        f"Time for which the wall {what}, of the target that moves most.",
        _BY_LASER,
    )
    for letter, word, what in (
        ("a", "opening", "moves from 1 mm from its closed level to 1 mm from its open one"),
        ("b", "open", "stays within 1 mm of its open level"),
        ("c", "closing", "moves from 1 mm from its open level to 1 mm from its closed one"),
        ("d", "closed", "stays within 1 mm of its closed level"),
    )
} | {
    "ratio": Quantity(
        "wall_ratio_1mm", "ratio by the wall's movement, by 1 mm", "1", f"{_RATIO} of these times.", _BY_LASER
    )
}
"""The same by the limits of laser studies."""
VACUUM: Mapping[str, Quantity] = {
    letter: Quantity(
        f"phase_{letter}_s",
        f"phase {letter}",
        "s",
        f"Duration of phase {letter} of the chamber's vacuum: {what}.",
        _BY_VACUUM,
    )
    for letter, what in (
        ("a", "it rises from 4 kPa to 4 kPa below its maximum"),
        ("b", "it stays above 4 kPa below its maximum"),
        ("c", "it falls from 4 kPa below its maximum to 4 kPa"),
    )
}
"""Durations of ISO's phases; that of d has a limit."""
PULSATOR_RATIO = Quantity(
    "pulsator_ratio", "pulsator ratio", "1", f"{_RATIO} of the phases of the chamber's vacuum.", _BY_VACUUM
)
LAGS: tuple[Quantity, Quantity] = (
    Quantity(
        "opening_lag_s",
        "lag of the opening wall",
        "s",
        "Delay from half the height of the rising vacuum to half the stroke of the opening wall.",
        "response of the liner to the pulsator; by a light in the picture, or on one clock",
    ),
    Quantity(
        "closing_lag_s",
        "lag of the closing wall",
        "s",
        "Delay from half the height of the falling vacuum to half the stroke of the closing wall.",
        "response of the liner to the pulsator; by a light in the picture, or on one clock",
    ),
)
"""Opening and closing."""


def movement_quantities(pulsation: Pulsation | None, reason: str) -> tuple[Finding, ...]:
    """Stroke and rate, or the reason why there are none."""
    if pulsation is None:
        return tuple(Finding.missing(quantity, reason) for quantity in MOVEMENT)
    found = (pulsation.stroke_mm, pulsation.rate_per_min)
    return tuple(Finding.of(*one) for one in zip(MOVEMENT, found, strict=True))


def wall_quantities(phases: Phases | None, reason: str) -> tuple[Finding, ...]:
    """Durations of the wall's phases and its ratio, or the reason why there are none."""
    return _of_phases(WALL, phases, reason)


def laser_quantities(pulsation: Pulsation | None, reason: str) -> tuple[Finding, ...]:
    """Durations of the wall's phases by 1 mm from its ends, and their ratio, or why there are none."""
    if pulsation is None:
        return _of_phases(WALL_1MM, None, reason)
    try:
        return _of_phases(WALL_1MM, wall_phases(pulsation, LASER_MM), reason)
    except AnalysisError as error:
        return _of_phases(WALL_1MM, None, error.message)


def vacuum_quantities(phases: Phases | None, reason: str) -> tuple[Finding, ...]:
    """Durations of ISO's phases and the pulsator ratio, or the reason why there are none."""
    return _of_phases({**VACUUM, "ratio": PULSATOR_RATIO}, phases, reason)


def lag_quantities(lags_s: Sequence[Estimate], clock_sigma_s: float, reason: str) -> tuple[Finding, ...]:
    """Lags of the opening and of the closing wall.

    Args:
        lags_s: both, with the σ of their noise; empty if they are unknown.
        clock_sigma_s: σ of the vacuum's clock against the camera's.
        reason: why they are unknown.
    """
    if not lags_s:
        return tuple(Finding.missing(quantity, reason) for quantity in LAGS)
    whole = [Estimate(one.value, np.hypot(one.sigma, clock_sigma_s)) for one in lags_s]
    return tuple(Finding.of(quantity, one, clock_sigma_s) for quantity, one in zip(LAGS, whole, strict=True))


def _of_phases(quantities: Mapping[str, Quantity], phases: Phases | None, reason: str) -> tuple[Finding, ...]:
    if phases is None:
        return tuple(Finding.missing(quantity, reason) for quantity in quantities.values())
    value, sigma = phases.durations_s
    known = {letter: Estimate(value[k], sigma[k]) for k, letter in enumerate("abcd")}
    known["ratio"] = phases.ratio
    return tuple(Finding.of(quantity, known[key]) for key, quantity in quantities.items())


MET, NOT_MET, NOT_CERTAIN = "met", "not met", "not certain"
_CERTAIN = 2.0
"""σ that a value has to be away from its limit for a verdict."""
_OPEN, _CLOSED = 1, 3
NO_CURVE = "the pulsation chamber's vacuum is not known as a curve: its phases have no durations"
"""Why the phases have no durations, where there are none."""
_SOURCE = "ISO 5707; phases as in ISO 3918 and ISO 6690, by the pulsation chamber's vacuum"


class Limit(NamedTuple):
    """A least value that a standard asks for."""

    quantity: Quantity
    least: float


LIMITS: tuple[Limit, ...] = (
    Limit(
        Quantity(
            "phase_b_share",
            "phase b of the cycle",
            "1",
            "Duration of phase b of the chamber's vacuum by that of the cycle; at least .30.",
            _SOURCE,
        ),
        0.30,
    ),
    Limit(
        Quantity(
            "phase_d_share",
            "phase d of the cycle",
            "1",
            "Duration of phase d of the chamber's vacuum by that of the cycle; at least .15.",
            _SOURCE,
        ),
        0.15,
    ),
    Limit(
        Quantity(
            "phase_d_s",
            "phase d",
            "s",
            "Duration of phase d of the chamber's vacuum; at least .150 s.",
            _SOURCE,
        ),
        0.150,
    ),
)


def pulsator_limits(phases: Phases | None, reason: str = NO_CURVE) -> tuple[Finding, ...]:
    """The phases of a vacuum, each with its verdict: met, not met, or not certain within 2 σ of the limit.

    Args:
        phases: of the vacuum; None if it has none.
        reason: why it has none.
    """
    if phases is None or phases.defined_by != "vacuum":
        return tuple(Finding.missing(limit.quantity, reason) for limit in LIMITS)
    duration = Estimate(phases.durations_s.value[_CLOSED], phases.durations_s.sigma[_CLOSED])
    values = (_share(phases, _OPEN), _share(phases, _CLOSED), duration)
    return tuple(
        Finding.of(limit.quantity, value)._replace(verdict=verdict(value, limit.least))
        for limit, value in zip(LIMITS, values, strict=True)
    )


def verdict(found: Estimate, least: float) -> str:
    """Verdict on a least value: met, not met, or not certain within 2 σ of it."""
    margin = float(found.value) - least
    if abs(margin) < _CERTAIN * float(found.sigma):
        return NOT_CERTAIN
    return MET if margin >= 0 else NOT_MET


def _share(phases: Phases, index: int) -> Estimate:
    """Share of the cycle; the errors of phase and cycle may go together, so both count in full."""
    part, part_sigma = phases.durations_s.value[index], phases.durations_s.sigma[index]
    period, period_sigma = float(phases.period_s.value), float(phases.period_s.sigma)
    share = part / period
    return Estimate.of(share, part_sigma / period + share * period_sigma / period)
