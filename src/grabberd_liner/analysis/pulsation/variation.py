"""Variation from cycle to cycle: of its start, its length and its stroke."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.movement import Movement
from grabberd_liner.analysis.pulsation.pulsation import Pulsation

Array = NDArray[np.float64]

_WHOLE = 0.8
"""Share of a cycle's fields that have to be present."""


class Variation(NamedTuple):
    """C whole cycles of all runs, in order.

    Attributes:
        start_s: (C,) start of each cycle (wall phase a) by its movement in time, with σ.
        stroke: (C,) stroke relative to the mean cycle's, with σ.
        lengths_s: time from the start of each cycle to that of the next, if both are whole, with σ.
    """

    start_s: Estimate
    stroke: Estimate
    lengths_s: Estimate


def variation(movements: Sequence[Movement], pulsation: Pulsation) -> Variation:
    """Shift and size of every whole cycle against the mean one."""
    rows = [
        row for capture, movement in enumerate(movements) for row in _cycles(movement, capture, pulsation)
    ]
    table = np.array(rows).reshape(-1, 6)
    start = Estimate(table[:, 2], table[:, 3])
    follows = np.flatnonzero((np.diff(table[:, 0]) == 0) & (np.diff(table[:, 1]) == 1))
    lengths = np.diff(table[:, 2])[follows]
    spread = np.hypot(table[follows, 3], table[follows + 1, 3])
    return Variation(start, Estimate(table[:, 4], table[:, 5]), Estimate(lengths, spread))


def _cycles(movement: Movement, capture: int, pulsation: Pulsation) -> list[tuple[float, ...]]:
    """(run, cycle, start, σ, stroke, σ) of the whole cycles of a capture."""
    at = pulsation.at(movement.time_s, capture)
    step_s = float(np.median(np.diff(movement.time_s)))
    least = _WHOLE * pulsation.period_s / step_s
    rows: list[tuple[float, ...]] = []
    for run, cycle in sorted({(int(r), int(c)) for r, c in zip(at.run, at.cycle, strict=True) if r >= 0}):
        use = (at.run == run) & (at.cycle == cycle)
        if use.sum() >= least:
            begun_s = pulsation.runs[run].start_s + cycle * pulsation.period_s
            shift, shift_sigma, stroke, stroke_sigma = _against(movement, use, at.phase[use], pulsation)
            rows.append((run, cycle, begun_s + shift, shift_sigma, stroke, stroke_sigma))
    return rows


def _against(
    movement: Movement, use: NDArray[np.bool_], phase: Array, pulsation: Pulsation
) -> tuple[float, float, float, float]:
    """Least squares of level, size and delay of one cycle against the mean one."""
    mean, slope = pulsation.waveform.value(phase), pulsation.waveform.slope(phase) / pulsation.period_s
    # Never better than the periodic model itself: its residuals include what is not noise.
    sigma = np.maximum(movement.sigma_mm[use], pulsation.residual_mm)
    design = np.column_stack([np.ones_like(mean), mean, -slope]) / sigma[:, None]
    covariance = np.linalg.inv(design.T @ design)
    _, size, delayed = covariance @ design.T @ (movement.value_mm[use] / sigma)
    shift = float(delayed / size)
    sigmas = np.sqrt(np.diagonal(covariance))
    return shift, float(sigmas[2] / size), float(size), float(sigmas[1])
