"""The pulsation from the wall's movement: cycle length, rate, and phase of every field.

A capture is one run of fields, with occasional missing fields; across a gap longer than a cycle the number of
cycles is unknown, so a new run begins and counting restarts. Bursts too short for a cycle are runs like
others: their common movement aligns them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.cycle_fit import Fit, adjust, harmonics, placed, search, sharpened
from grabberd_liner.analysis.pulsation.movement import Movement, Waveform, rotated

SHORTEST_S, LONGEST_S = 0.4, 3.0
WALL_THRESHOLD = 0.1
"""A wall phase begins where the movement has left the closed or open position by this share of the stroke."""

_LEAST_FIELDS, _MOST_RUNS = 4, 12
_NOISE_LIKE = 0.5
"""Mean squared step between fields over that of white noise, above which a movement counts as noise."""
_UNLIKE = 0.15
"""Residual in units of the movement, above which cycles do not repeat each other."""
_UNCERTAIN = 0.008
"""Relative σ of the cycle length above which it is not determined."""
_HOLE = 0.1
"""Share of a cycle that may be unseen in one piece."""
_FLANK, _FLANK_STEP = 0.25, 0.001
"""Share of the steepest slope from which on a place is on a flank, and the steps in which that is sought."""
_LONGER = (
    "capture at least one and a half cycles, or several bursts that begin at different times of the cycle"
)


class Run(NamedTuple):
    """Fields of one capture without a gap longer than a cycle.

    Attributes:
        capture: index of the capture; `first_s`, `last_s`: times of the run's first and last field.
        start_s: start of its first field's cycle (wall phase a), with `start_sigma_s`; infinite if nothing
            moved in it, which leaves its place in the cycle of the other runs unknown.
    """

    capture: int
    first_s: float
    last_s: float
    start_s: float
    start_sigma_s: float


class Moment(NamedTuple):
    """Phases of F times within the pulsation.

    Attributes:
        run: (F,) index of the run, -1 outside all runs whose start is known.
        cycle: (F,) number of the cycle in its run, from 0.
        phase: (F,) in [0, 1), from the beginning of wall phase a; NaN outside all runs.
    """

    run: Indices
    cycle: Indices
    phase: Array


@dataclass(frozen=True, slots=True, eq=False)
class Pulsation:
    """Periodic model of the wall's movement.

    Attributes:
        period_s: length of the cycle, with `period_sigma_s`.
        waveform: first principal movement in mm over the phase, counted from wall phase a.
        period_covariance: (2K + 1,) covariance of the period with the waveform's coefficients.
        runs: runs in the order of captures and times.
        seen: (F,) phases of all fields, ascending.
        field_harmonics: number of harmonics that the fields of one cycle resolve.
        residual_mm: root mean square residual of the movement; `expected_mm`: expected from the points' σ.
        size_sigma: relative σ of the whole waveform, as in `Movement`.
    """

    period_s: float
    period_sigma_s: float
    waveform: Waveform
    period_covariance: Array
    runs: tuple[Run, ...]
    seen: Array
    field_harmonics: int
    residual_mm: float
    expected_mm: float
    size_sigma: float

    @property
    def rate_per_min(self) -> Estimate:
        """Cycles a minute."""
        rate = np.float64(60 / self.period_s)
        return Estimate.of(rate, rate * self.period_sigma_s / self.period_s)

    @property
    def stroke_mm(self) -> Estimate:
        """Movement from the closed level to the open one."""
        low, high = self.waveform.level_terms()
        terms, covariance = high - low, self.waveform.covariance
        stroke_mm = terms @ self.waveform.coefficients
        own_mm = np.sqrt(terms @ covariance @ terms)
        return Estimate.of(stroke_mm, np.hypot(own_mm, stroke_mm * self.size_sigma))

    def reached_s(self, phase: Array) -> Array:
        """Times (P,) at which the first capture first reached phases.

        Raises:
            AnalysisError: it shows no movement by which its fields have a phase.
        """
        own = [run for run in self.runs if run.capture == 0 and np.isfinite(run.start_sigma_s)]
        if not own:
            raise AnalysisError(
                "the capture's own fields show no movement, so their place in its bursts' cycle is unknown",
                "capture while the liner opens or closes, a whole cycle at best",
            )
        run = own[0]
        times: Array = run.start_s + phase * self.period_s
        return times + self.period_s * (times < run.first_s)

    def speed_mm_per_s(self, phase: Array) -> Array:
        """(P,) of the target that moves most, at phases of the mean cycle."""
        return np.abs(self.waveform.slope(phase)) / self.period_s

    @property
    def cycles(self) -> float:
        """Number of cycles that all runs span."""
        return sum(run.last_s - run.first_s for run in self.runs) / self.period_s

    def gap(self, phase: float) -> tuple[float, float]:
        """Phases of the two fields, of any cycles, that come nearest before and after a phase, ascending."""
        place = np.mod(phase, 1.0)
        after = int(np.searchsorted(self.seen, place)) % len(self.seen)
        before_by, after_by = np.mod([place - self.seen[after - 1], self.seen[after] - place], 1.0)
        if len(self.seen) == 1:
            return phase - before_by, phase - before_by + 1.0
        return float(phase - before_by), float(phase + after_by)

    def at(self, time_s: Array, capture: int = 0) -> Moment:
        """Phases within the pulsation of the times (F,) of a capture."""
        which = np.full(len(time_s), -1, np.intp)
        turns = np.full(len(time_s), np.nan)
        for index, run in enumerate(self.runs):
            # The slack keeps the run's own first and last field inside after rounding.
            inside = (time_s >= run.first_s - 1e-9) & (time_s <= run.last_s + 1e-9)
            if run.capture == capture and np.isfinite(run.start_sigma_s):
                which[inside] = index
                turns[inside] = (time_s[inside] - run.start_s) / self.period_s
        whole = np.floor(turns)
        return Moment(which, np.where(which < 0, 0, np.nan_to_num(whole)).astype(np.intp), turns - whole)


def fit_pulsation(movements: Sequence[Movement]) -> Pulsation:
    """The pulsation of one capture or of several together.

    Args:
        movements: one movement per capture; the captures' clocks may differ.

    Raises:
        AnalysisError: nothing pulsates, the fields together show no more than a cycle, or the movement does
            not repeat itself.
    """
    _check_movement(movements)
    runs = _split(movements, SHORTEST_S)
    likely = _likely([run for _, run in runs])
    runs = _split(movements, likely.period_s)
    every = [run for _, run in runs]
    fit = _whole(every, likely)
    _check_length(fit, every)
    fit = sharpened(every, fit)
    _check_repetition(fit, every)
    return _pulsation(fit, runs)


def _check_movement(movements: Sequence[Movement]) -> None:
    """Check that there is movement: it changes little from field to field, whereas noise is independent."""
    values = np.concatenate([movement.value_mm for movement in movements])
    steps = np.concatenate([np.diff(movement.value_mm) for movement in movements])
    sigma = float(np.sqrt(np.mean(np.concatenate([movement.sigma_mm for movement in movements]) ** 2)))
    spread = float(values.std())
    if spread < 3 * sigma or float((steps**2).mean()) > _NOISE_LIKE * 2 * spread**2:
        raise AnalysisError(
            f"nothing pulsates: the targets move by {spread:.3f} mm (σ {sigma:.3f} mm)",
            "run the pulsator, and check that the capture shows the liner",
        )


def _split(movements: Sequence[Movement], gap_s: float) -> list[tuple[int, Movement]]:
    """Cut the captures at gaps longer than this; runs of fewer than four fields are left out."""
    runs = []
    for capture, movement in enumerate(movements):
        cuts = np.flatnonzero(np.diff(movement.time_s) > gap_s) + 1
        for part in np.split(np.arange(len(movement.time_s)), cuts):
            if len(part) >= _LEAST_FIELDS:
                runs.append((capture, movement.only(part)))
    if not runs:
        raise AnalysisError("there are no four fields without a gap of a cycle between them", _LONGER)
    return runs


def _span_s(run: Movement) -> float:
    return float(run.time_s[-1] - run.time_s[0])


def _likely(runs: Sequence[Movement]) -> Fit:
    """Period and waveform from the longest runs."""
    ordered = sorted(runs, key=_span_s, reverse=True)
    alone = _best(ordered[:1])
    if len(runs) == 1 or not _lacks(alone, ordered[:1]):
        return alone
    return _best(ordered[:_MOST_RUNS])


def _best(runs: Sequence[Movement]) -> Fit:
    fits = [
        adjust(
            [_first(run, 6 * one.period_s) for run in runs],
            one.period_s,
            one.phases,
            harmonics(one.period_s, _step_s(runs)),
        )
        for one in search(runs, SHORTEST_S, LONGEST_S)
    ]
    return max(fits, key=lambda fit: fit.evidence)


def _whole(runs: Sequence[Movement], fit: Fit) -> Fit:
    """Adjust all runs, six times longer each time: as far as the period is known well enough."""
    span_s, longest_s = 6 * fit.period_s, max(map(_span_s, runs))
    count = harmonics(fit.period_s, _step_s(runs))
    while True:
        short = [_first(run, span_s) for run in runs]
        phases = np.array([placed(run, fit) for run in short])
        fit = adjust(short, fit.period_s, phases, count)
        if span_s >= longest_s:
            return fit
        span_s *= 6


def _first(run: Movement, span_s: float) -> Movement:
    use = run.time_s <= run.time_s[0] + span_s
    return run.only(use)


def _step_s(runs: Sequence[Movement]) -> float:
    return float(np.median(np.concatenate([np.diff(run.time_s) for run in runs])))


def _phases(fit: Fit, runs: Sequence[Movement]) -> Array:
    """(F,) phases of all fields, ascending."""
    since = [p + (run.time_s - run.time_s[0]) / fit.period_s for p, run in zip(fit.phases, runs, strict=True)]
    return np.sort(np.mod(np.concatenate(since), 1.0))


def _hole(fit: Fit, runs: Sequence[Movement]) -> float:
    """The widest part of the cycle without fields."""
    phase = _phases(fit, runs)
    return float(np.diff(np.concatenate([phase, [phase[0] + 1]])).max())


def _lacks(fit: Fit, runs: Sequence[Movement]) -> bool:
    """True if the runs do not determine the length of their cycle."""
    return _hole(fit, runs) > _HOLE or fit.shared_period_sigma_s > _UNCERTAIN * fit.period_s


def _check_length(fit: Fit, runs: Sequence[Movement]) -> None:
    if _lacks(fit, runs):
        spans = ", ".join(f"{_span_s(run):.2f}" for run in runs[:5])
        raise AnalysisError(
            f"the fields (runs of {spans} s) do not show a cycle and enough of the next: the best length is"
            f" {fit.period_s:.3f} s, but what is seen twice gives it σ {fit.shared_period_sigma_s:.3f} s, and"
            f" {100 * _hole(fit, runs):.0f} % of it is not seen at all",
            _LONGER,
        )


def _check_repetition(fit: Fit, runs: Sequence[Movement]) -> None:
    values = np.concatenate([run.value_mm for run in runs])
    if fit.misfit_mm > _UNLIKE * float(values.std()):
        raise AnalysisError(
            f"the movement does not repeat itself: cycles of {fit.period_s:.3f} s leave"
            f" {fit.misfit_mm:.2f} mm of {values.std():.2f} mm",
            "capture while the pulsator runs evenly; check the points with 'grabberd accuracy' or the report",
        )


def _pulsation(fit: Fit, runs: Sequence[tuple[int, Movement]]) -> Pulsation:
    """The pulsation with its phase counted from where the wall begins to open."""
    count = len(runs)
    low, high = fit.waveform.levels()
    rising = fit.waveform.crossings(low + WALL_THRESHOLD * (high - low))[0]
    start = _last_before(rising, fit.waveform.extremes()[1])
    waveform = fit.waveform.turned(start)
    since = np.mod(fit.phases - start, 1.0)
    slope = max(abs(float(fit.waveform.slope(np.array(start)))), 1e-12)
    own = float(fit.waveform.sigma(np.array(start))) / slope
    spread = np.sqrt(np.concatenate([[0.0], np.diagonal(fit.covariance)[1:count]]) + own**2)
    if count > 1:
        # On a plateau the swing of the series would give a phase, and a small σ to it.
        moves = [_moves(run, phase, fit) for (_, run), phase in zip(runs, fit.phases, strict=True)]
        spread[~np.array(moves)] = np.inf
    return Pulsation(
        period_s=fit.period_s,
        period_sigma_s=fit.period_sigma_s,
        waveform=waveform,
        period_covariance=rotated(fit.covariance[0, count:], start),
        runs=tuple(
            Run(
                capture,
                float(run.time_s[0]),
                float(run.time_s[-1]),
                float(run.time_s[0] - turn * fit.period_s),
                float(sigma * fit.period_s),
            )
            for (capture, run), turn, sigma in zip(runs, since, spread, strict=True)
        ),
        seen=np.sort(np.mod(_phases(fit, [run for _, run in runs]) - start, 1.0)),
        field_harmonics=harmonics(fit.period_s, _step_s([run for _, run in runs])),
        residual_mm=fit.residual_mm,
        expected_mm=fit.expected_mm,
        size_sigma=runs[0][1].size_sigma,
    )


def _moves(run: Movement, phase: float, fit: Fit) -> bool:
    """True if any field of a run is on a flank of the waveform."""
    steepest = np.abs(fit.waveform.slope(np.arange(0.0, 1.0, _FLANK_STEP))).max()
    at = phase + (run.time_s - run.time_s[0]) / fit.period_s
    return bool(np.abs(fit.waveform.slope(at)).max() > _FLANK * steepest)


def _last_before(phases: Array, end: float) -> float:
    """The last of some phases before the phase `end`."""
    return float(phases[np.mod(end - phases, 1.0).argmin()])
