"""What an analysis costs, beside splines whose σ is drawn by lot."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from tests.proofs.bench.analysed import Analysed

from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.jets import ORDERS
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms

Array = NDArray[np.float64]

TIMED = 50
DRAWS = 100
ROUNDS = 2


def cost(made: Analysed) -> str:
    """Of a chain of fields, beside bivariate splines whose σ is drawn by lot."""
    ours = min(_taken(lambda: made.analysed(made.fields[:TIMED])) for _ in range(ROUNDS))
    theirs = min(_taken(lambda: _by_lot(made)) for _ in range(ROUNDS))
    return (
        f"{TIMED} fields, everything with σ (surface, curvature, strain, tension, three sections, "
        f"volume, area): {ours:.1f} s of one core, to be 2. The curvature alone of as many, from scipy's "
        f"`RectBivariateSpline` with σ by {DRAWS} draws: {theirs:.1f} s; ratio {ours / theirs:.2f}."
    )


def _taken(work: Callable[[], object]) -> float:
    before = time.process_time()
    work()
    return time.process_time() - before


def _by_lot(made: Analysed) -> Array:
    """σ of both curvatures at the targets: spline, noise, spline again."""
    grid, rng = made.grid, np.random.default_rng(0)
    rows, columns = int(grid.row.max()) + 1, int(grid.column.max()) + 1
    u_mm, v_mm = np.arange(rows) * grid.u_pitch_mm, np.arange(columns) * grid.v_pitch_mm
    spread = []
    for _ in range(TIMED):
        drawn = [grid.nominal_mm + rng.normal(0, 0.02, grid.nominal_mm.shape) for _ in range(DRAWS)]
        spread.append(np.std([_curvature(grid, places, u_mm, v_mm) for places in drawn], axis=0))
    return np.array(spread)


def _curvature(grid: Grid, places: Array, u_mm: Array, v_mm: Array) -> Array:
    jets = np.zeros((len(grid), len(ORDERS), 3))
    for axis in range(3):
        heights = places[:, axis].reshape(len(u_mm), len(v_mm))
        spline = RectBivariateSpline(u_mm, v_mm, heights, kx=5, ky=5)
        for place, (i, j) in enumerate(ORDERS[:6]):
            jets[:, place, axis] = spline.ev(grid.u_mm, grid.v_mm, i, j)
    return curvature_per_m(outer_forms(jets, grid.outward))
