"""The cycle that explains all runs: search for its unknown length, then joint adjustment of length, phases
and waveform to all fields.

A run is a stretch of fields without a long gap. A length is rated by the probability that a periodic
movement, with a prior for its harmonics, gives to all runs together, each run's phase free (Bayesian
evidence): too short a one cannot explain the data; too long a one needs more harmonics than the movement
has, and does not explain why cycles agree. Runs shorter than a cycle are placed by their overlap with the
others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd_liner.analysis.pulsation.movement import Movement, Waveform, basis, basis_slope, prior_precision

HARMONICS = 8
_SEARCH_PLACES = 64
_STEPS_A_HARMONIC = 4
"""Rates per width of the highest harmonic's peak: no peak falls between two of them."""
_SPAN_S = 4.0
"""Only the beginning of each run is searched; the finer adjustment takes the rest."""
_ROUGH = 0.02
"""Residual of eight harmonics, in units of the movement's standard deviation."""
_SEEDS, _SWEEPS, _KEPT = 3, 2, 5
_HOPELESS = 500.0


class Candidate(NamedTuple):
    """A cycle length with the phase of each run's first field, in cycles, and its log evidence."""

    evidence: float
    period_s: float
    phases: Array


def search(runs: Sequence[Movement], shortest_s: float, longest_s: float) -> list[Candidate]:
    """Cycle lengths between two limits that are local maxima of the evidence, the best first."""
    started = [run.time_s - run.time_s[0] for run in runs]
    used = [times <= _SPAN_S for times in started]
    times = [time[use] for time, use in zip(started, used, strict=True)]
    values = [run.value_mm[use] for run, use in zip(runs, used, strict=True)]
    middle, spread = _scale(values)
    scaled = [(value - middle) / spread for value in values]
    sigma = np.concatenate([run.sigma_mm for run in runs]) / spread
    noise = float(np.hypot(_ROUGH, np.sqrt(np.mean(sigma**2))))
    span_s = max(float(time[-1]) for time in times)
    step_hz = 1 / (_STEPS_A_HARMONIC * HARMONICS * max(span_s, shortest_s))
    rates = np.arange(1 / longest_s, 1 / shortest_s + step_hz, step_hz)
    found = _peaks([_placed(times, scaled, noise, 1 / float(rate), _SEEDS, 1) for rate in rates])
    if len(runs) > 1:
        found = [_placed(times, scaled, noise, one.period_s, len(runs), _SWEEPS) for one in found]
    return found


def _peaks(found: Sequence[Candidate]) -> list[Candidate]:
    evidence = np.array([-np.inf, *(one.evidence for one in found), -np.inf])
    peak = np.flatnonzero((evidence[1:-1] >= evidence[:-2]) & (evidence[1:-1] >= evidence[2:]))
    best = sorted((found[int(k)] for k in peak), key=lambda one: one.evidence, reverse=True)
    return [one for one in best[:_KEPT] if one.evidence > best[0].evidence - _HOPELESS]


def _scale(values: Sequence[Array]) -> tuple[float, float]:
    joined = np.concatenate(values)
    return float((joined.min() + joined.max()) / 2), max(float(joined.std()), 1e-12)


def _placed(
    times: Sequence[Array], values: Sequence[Array], noise: float, period_s: float, seeds: int, sweeps: int
) -> Candidate:
    """Place the runs one after the other at their best phases, trying several as the first one."""
    places = _SEARCH_PLACES if len(times) > 1 else 1
    moments = [
        _moments(time / period_s, value, noise, places) for time, value in zip(times, values, strict=True)
    ]
    # Runs with much movement first: they fix the waveform that the others are fitted to.
    order = np.argsort([-float(value.var() * len(value)) for value in values])
    tries = [_arranged(moments, np.roll(order, -k), sweeps) for k in range(min(seeds, len(times)))]
    evidence, phases = max(tries, key=lambda one: one[0])
    return Candidate(evidence, period_s, phases)


def _moments(phase: Array, value: Array, noise: float, count: int) -> tuple[Array, Array]:
    """Normal matrices (places, m, m) and right hand sides (places, m) of a run, place by place."""
    places = np.arange(count) / count
    terms = basis(phase[None] + places[:, None], HARMONICS) / noise
    return np.einsum("pfi,pfj->pij", terms, terms, optimize=True), terms.transpose(0, 2, 1) @ (value / noise)


def _arranged(moments: Sequence[tuple[Array, Array]], order: Indices, sweeps: int) -> tuple[float, Array]:
    place = np.zeros(len(moments), np.intp)
    normal, right = (moment[0].copy() for moment in moments[order[0]])
    laid = {int(order[0])}
    evidence = float(_log_evidence(normal[None], right[None])[0])
    for run in [*order[1:], *np.tile(order[1:], sweeps - 1)]:
        matrices, rights = moments[run]
        if int(run) in laid:
            normal, right = normal - matrices[place[run]], right - rights[place[run]]
        laid.add(int(run))
        gains = _log_evidence(normal + matrices, right + rights)
        place[run] = int(gains.argmax())
        evidence = float(gains.max())
        normal, right = normal + matrices[place[run]], right + rights[place[run]]
    return evidence, place / _SEARCH_PLACES


def _log_evidence(normal: Array, right: Array) -> Array:
    """(places,) log evidence, up to a constant common to all phases."""
    precision = prior_precision(HARMONICS, 1.0)
    factor = np.linalg.cholesky(normal + np.diag(precision))
    half = np.linalg.solve(factor, right[..., None])[..., 0]
    log_determinant = 2 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    return ((half**2).sum(axis=-1) - log_determinant + np.log(precision).sum()) / 2


# Fit and σ depend on each other: σ is rescaled by the residuals, and the fit repeated, three times.
_ROUNDS, _RESCALED = 20, 3
_CLOSE_S = 1e-7
_STILL = 0.25
"""Slopes below this share of the steepest do not contribute to the period: movement there may be noise."""
_CHANCE = 0.03
"""Share of the stroke to which ends of different movements may agree by chance."""
_ANYHOW = 1e3
"""Loose prior of the polygon's corners, in units of the movement's standard deviation."""
_LEAST_SIGMA = 1e-3
"""Floor of σ in units of the movement: exact points would otherwise weigh infinitely much."""
_BAND = 0.8
"""Highest harmonic as a share of the Nyquist frequency of the fields."""
_FEWEST, _MOST = 4, 30
_SHARP = 64
"""Harmonics of all cycles together: they resolve 8 ms of a cycle of a second."""
_CORNERS = (4.0, 8.0, 16.0, 32.0)
_PLACES = 200
_MANY = 400


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The adjusted movement.

    Attributes:
        period_s: length of the cycle.
        phases: (S,) phase of each run's first field, in cycles; the first run's is held.
        waveform: the movement in mm over the phase.
        covariance: (S + 2K + 1,)² covariance of the period, the further runs' phases and the coefficients.
        residual_mm: root mean square of the residuals.
        misfit_mm: the same per degree of freedom: how badly cycles repeat, however many harmonics there are.
        expected_mm: its expectation from the points' σ.
        evidence: log probability of the movement, up to a constant common to all fits of it.
        shared_period_sigma_s: σ of the period from only that movement that is seen in two cycles or runs.
    """

    period_s: float
    phases: Array
    waveform: Waveform
    covariance: Array
    residual_mm: float
    misfit_mm: float
    expected_mm: float
    evidence: float
    shared_period_sigma_s: float

    @property
    def period_sigma_s(self) -> float:
        """σ of the period."""
        return float(np.sqrt(self.covariance[0, 0]))


def harmonics(period_s: float, step_s: float) -> int:
    """Number of harmonics that fields `step_s` apart can resolve."""
    return int(np.clip(_BAND * period_s / step_s / 2, _FEWEST, _MOST))


def sharpened(movements: Sequence[Movement], fit: Fit) -> Fit:
    """The same movement with the harmonics that its cycles resolve together, and its own corner.

    Fields of different cycles fall between each other. A real liner closes within one or two fields; with the
    harmonics of one cycle's fields its flanks would be several times as long.
    """
    best = adjust(movements, fit.period_s, fit.phases, _SHARP)
    for corner in _CORNERS:
        sharper = adjust(movements, fit.period_s, fit.phases, _SHARP, corner)
        if sharper.evidence <= best.evidence:
            break
        best = sharper
    # Steep flanks would fix the period better than fields do that fall beside them.
    covariance = best.covariance.copy()
    covariance[0, 0] = max(covariance[0, 0], fit.covariance[0, 0])
    return replace(best, covariance=covariance)


def adjust(
    movements: Sequence[Movement], period_s: float, phases: Array, count: int, corner: float = 0.0
) -> Fit:
    """Least squares over period, phases and `count` harmonics with their prior; σ from the residuals.

    Args:
        movements: one movement per run, without long gaps.
        period_s: starting value of the period.
        phases: (S,) starting values of the phases of each run's first field.
        count: number of harmonics.
        corner: harmonic up to which the prior expects a jump.
    """
    problem = _Problem.of(movements, count, corner)
    state = _State(period_s, phases.copy(), np.zeros(2 * count + 1))
    sigma = problem.sigma
    for _ in range(_RESCALED):
        state, normal = _converged(problem, state, sigma)
        left = problem.value - _terms(problem, state)[0] @ state.coefficients
        information = normal.copy()
        information[np.diag_indices(len(normal))] -= _precision(problem, len(state.phases))
        # The prior takes up some of the coefficients: the trace counts those that the data determine.
        freedom = max(len(left) - float(np.trace(np.linalg.solve(normal, information))), 1.0)
        # With more harmonics than the fields determine, residuals say nothing of the noise: σ only grows.
        sigma = problem.sigma * np.sqrt(max(float(((left / problem.sigma) ** 2).sum()) / freedom, 1.0))
    state, normal = _converged(problem, state, sigma)
    covariance: Array = np.linalg.inv(normal).astype(np.float64)
    runs = len(state.phases)
    return Fit(
        period_s=state.period_s,
        phases=state.phases,
        waveform=Waveform(
            np.asarray(state.coefficients + problem.mean, np.float64), covariance[runs:, runs:]
        ),
        covariance=covariance,
        residual_mm=float(np.sqrt((left**2).mean())),
        misfit_mm=float(np.sqrt((left**2).sum() / freedom)),
        expected_mm=float(np.sqrt((np.concatenate([run.sigma_mm for run in movements]) ** 2).mean())),
        evidence=_evidence(problem, state),
        shared_period_sigma_s=_shared_sigma_s(problem, state, sigma),
    )


def _evidence(problem: "_Problem", state: "_State") -> float:
    """Log evidence of the best coefficients by Laplace's approximation, with the points' σ."""
    terms = _terms(problem, state)[0] / problem.sigma[:, None]
    precision = problem.precision
    best = _with_coefficients(problem, state, problem.sigma).coefficients
    left = problem.value / problem.sigma - terms @ best
    room = np.linalg.slogdet(terms.T @ terms + np.diag(precision))[1] - np.log(precision).sum()
    return -float((left**2).sum() + (best**2 * precision).sum() + room) / 2


def _shared_sigma_s(problem: "_Problem", state: "_State", sigma: Array) -> float:
    """σ of the period for an arbitrary waveform: a polygon with as many corners as fields in a cycle.

    Movement that is seen only once then contributes nothing, nor does a plateau that is seen twice.
    """
    sigma = np.maximum(sigma, _CHANCE * float(np.ptp(problem.value)))
    phase = state.phases[problem.run] + problem.since_s / state.period_s
    slope = basis_slope(phase, problem.count) @ state.coefficients
    slope[np.abs(slope) < _STILL * np.abs(slope).max()] = 0.0
    columns = [-slope * problem.since_s / state.period_s**2]
    columns += [slope * (problem.run == run) for run in range(1, len(state.phases))]
    polygon = _polygon(phase, max(round(state.period_s / problem.step_s), 1))
    design = np.column_stack([*columns, polygon]) / sigma[:, None]
    loose = np.full(polygon.shape[1], 1 / (_ANYHOW**2 * problem.variance))
    weak = np.concatenate([[1 / state.period_s**2], np.ones(len(state.phases) - 1), loose])
    return float(np.sqrt(np.linalg.inv(design.T @ design + np.diag(weak))[0, 0]))


def _polygon(phase: Array, corners: int) -> Array:
    """(F, corners) weights of a periodic polygon's corners in its values at phases."""
    place = np.mod(phase, 1.0) * corners
    first = np.floor(place).astype(np.intp)
    share = place - first
    rows, shares = np.arange(len(phase)), np.zeros((len(phase), corners))
    shares[rows, first % corners] = 1 - share
    shares[rows, (first + 1) % corners] += share
    return shares


def placed(run: Movement, fit: Fit) -> float:
    """Best-fitting phase of a further run's first field, by a search over the whole cycle."""
    use = slice(0, _MANY)
    since = (run.time_s[use] - run.time_s[0]) / fit.period_s
    places = np.arange(_PLACES) / _PLACES
    left = run.value_mm[use] - fit.waveform.value(since[None] + places[:, None])
    return float(places[(left**2).sum(axis=1).argmin()])


@dataclass(frozen=True, slots=True, eq=False)
class _Problem:
    """All fields in sequence: time since the run's first field, run, value relative to the middle."""

    since_s: Array
    run: Indices
    value: Array
    sigma: Array
    middle: float
    variance: float
    count: int
    corner: float
    step_s: float

    @property
    def precision(self) -> Array:
        """Prior precision of the coefficients."""
        return prior_precision(self.count, self.variance, self.corner)

    @property
    def mean(self) -> Array:
        """Coefficients of the middle, to which the values are relative."""
        return np.concatenate([[self.middle], np.zeros(2 * self.count)])

    @classmethod
    def of(cls, runs: Sequence[Movement], count: int, corner: float) -> "_Problem":
        value = np.concatenate([run.value_mm for run in runs])
        middle, spread = float((value.min() + value.max()) / 2), float(value.std())
        sigma = np.concatenate([run.sigma_mm for run in runs])
        return cls(
            np.concatenate([run.time_s - run.time_s[0] for run in runs]),
            np.repeat(np.arange(len(runs)), [len(run.time_s) for run in runs]),
            value - middle,
            np.maximum(sigma, _LEAST_SIGMA * spread),
            middle,
            spread**2,
            count,
            corner,
            float(np.median(np.concatenate([np.diff(run.time_s) for run in runs]))),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    period_s: float
    phases: Array
    coefficients: Array


def _precision(problem: _Problem, runs: int) -> Array:
    return np.concatenate([np.zeros(runs), problem.precision])


def _terms(problem: _Problem, state: _State) -> tuple[Array, Array]:
    phase = state.phases[problem.run] + problem.since_s / state.period_s
    return basis(phase, problem.count), basis_slope(phase, problem.count)


def _normal(problem: _Problem, state: _State, sigma: Array) -> tuple[Array, Array]:
    terms, slopes = _terms(problem, state)
    slope = slopes @ state.coefficients
    columns = [-slope * problem.since_s / state.period_s**2]
    columns += [slope * (problem.run == run) for run in range(1, len(state.phases))]
    design = np.column_stack([*columns, terms]) / sigma[:, None]
    left = (problem.value - terms @ state.coefficients) / sigma
    precision = _precision(problem, len(state.phases))
    pull = np.concatenate([np.zeros(len(state.phases)), state.coefficients]) * precision
    return design.T @ design + np.diag(precision), design.T @ left - pull


def _with_coefficients(problem: _Problem, state: _State, sigma: Array) -> _State:
    """The best coefficients of this period and these phases."""
    terms = _terms(problem, state)[0] / sigma[:, None]
    normal = terms.T @ terms + np.diag(problem.precision)
    best: Array = np.linalg.solve(normal, terms.T @ (problem.value / sigma)).astype(np.float64)
    return replace(state, coefficients=best)


def _converged(problem: _Problem, state: _State, sigma: Array) -> tuple[_State, Array]:
    state = _with_coefficients(problem, state, sigma)
    runs = len(state.phases)
    for _ in range(_ROUNDS):
        normal, right = _normal(problem, state, sigma)
        # A touch of damping keeps period and phases solvable while the waveform is still flat; steps are
        # limited to three per cent of a cycle, since the equations are linear only near the solution.
        normal[np.arange(runs), np.arange(runs)] += 1e-9 * np.diagonal(normal)[:runs] + 1e-12
        step = np.linalg.solve(normal, right)
        stretch = np.clip(step[0], -0.03 * state.period_s, 0.03 * state.period_s)
        phases = state.phases + np.concatenate([[0.0], np.clip(step[1:runs], -0.03, 0.03)])
        state = _State(state.period_s + float(stretch), phases, state.coefficients + step[runs:])
        if abs(stretch) < _CLOSE_S:
            break
    return state, _normal(problem, state, sigma)[0]
