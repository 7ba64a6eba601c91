"""Search for an unknown cycle length: the one that explains all runs best.

A run is a stretch of fields without a long gap. The movement is one periodic function of the phase, with a
prior for its harmonics; a cycle length is rated by the probability that it gives to all runs together, with
each run's phase free (Bayesian evidence). Too short a length cannot explain the data; too long a one needs
more harmonics than the movement has, and does not explain why cycles agree. Runs shorter than a cycle are
placed by their overlap with the others.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.pulsation.movement import Movement
from grabberd_liner.analysis.pulsation.waveform import basis, prior_precision

Array = NDArray[np.float64]

HARMONICS = 8
_PLACES = 64
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
    places = _PLACES if len(times) > 1 else 1
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


def _arranged(
    moments: Sequence[tuple[Array, Array]], order: NDArray[np.intp], sweeps: int
) -> tuple[float, Array]:
    place = np.zeros(len(moments), np.intp)
    normal, right = (moment[0].copy() for moment in moments[order[0]])
    laid = {int(order[0])}
    evidence = float(_evidence(normal[None], right[None])[0])
    for run in [*order[1:], *np.tile(order[1:], sweeps - 1)]:
        matrices, rights = moments[run]
        if int(run) in laid:
            normal, right = normal - matrices[place[run]], right - rights[place[run]]
        laid.add(int(run))
        gains = _evidence(normal + matrices, right + rights)
        place[run] = int(gains.argmax())
        evidence = float(gains.max())
        normal, right = normal + matrices[place[run]], right + rights[place[run]]
    return evidence, place / _PLACES


def _evidence(normal: Array, right: Array) -> Array:
    """(places,) log evidence, up to a constant common to all phases."""
    precision = prior_precision(HARMONICS, 1.0)
    factor = np.linalg.cholesky(normal + np.diag(precision))
    half = np.linalg.solve(factor, right[..., None])[..., 0]
    log_determinant = 2 * np.log(np.diagonal(factor, axis1=-2, axis2=-1)).sum(axis=-1)
    evidence: Array = ((half**2).sum(axis=-1) - log_determinant + np.log(precision).sum()) / 2
    return evidence
