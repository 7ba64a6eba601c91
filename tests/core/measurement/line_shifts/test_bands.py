import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.measurement.line_shifts import band_factor, band_half_solve, band_of, band_solve


@given(st.integers(0, 2**31), st.integers(1, 5), st.integers(1, 12))
def test_the_solution_is_that_of_the_full_matrix(seed, height, blobs):
    rng = np.random.default_rng(seed)
    count = height + 6
    at = rng.integers(0, 7, blobs)[:, None] + np.arange(height)
    root = rng.normal(size=(blobs, height, height))
    matrices = root @ root.swapaxes(1, 2)
    full = np.eye(count) * 0.5
    for place, matrix in zip(at, matrices, strict=True):
        full[np.ix_(place, place)] += matrix
    right = rng.normal(size=(count, 3))
    row, column = np.tril_indices(height)
    lower = band_factor(band_of(at[:, row], at[:, column], matrices[:, row, column], (height, count)), 0.5)
    np.testing.assert_allclose(full @ band_solve(lower, right), right, atol=1e-8)
    np.testing.assert_allclose(2 * np.log(lower[0]).sum(), np.linalg.slogdet(full)[1], atol=1e-8)
    half = band_half_solve(lower, right)
    np.testing.assert_allclose(half.T @ half, right.T @ band_solve(lower, right), rtol=1e-8, atol=1e-8)
