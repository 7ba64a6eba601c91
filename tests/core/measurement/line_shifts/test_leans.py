"""Leans that change slowly over either half are told from what single discs add."""

import numpy as np

from grabberd.core.measurement.line_shifts import line_shifts, smoothed, terms_of
from grabberd.core.measurement.locators.locator import Chords

SIZE = 288, 720
HEIGHT = 6


def places(count=80, seed=1):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, 720, count), rng.uniform(0, 288, count)


def test_a_quadratic_over_either_half_is_found():
    column, line = places()
    u, v = column % 360 / 180 - 1, line / 144 - 1
    lean = np.where(column < 360, 0.3 * v + 0.1 * u * v, -0.2 * v + 0.1 * v * v + 0.05)
    np.testing.assert_allclose(smoothed(lean, terms_of(column, line, SIZE)), lean, atol=1e-3)


def test_leans_without_order_are_left_as_they_are():
    column, line = places(400)
    lean = np.random.default_rng(2).normal(0, 0.1, 400)
    assert np.std(smoothed(lean, terms_of(column, line, SIZE))) < 0.03


def test_a_half_with_few_discs_has_no_leans_of_its_own():
    column, line = places(40)
    column[:29] %= 360
    column[29:] = 360 + column[29:] % 360
    smooth = smoothed(np.ones(40), terms_of(column, line, SIZE))
    np.testing.assert_allclose(smooth[:29], 1, atol=0.01)
    assert not smooth[29:].any()


def test_rows_that_lean_alike_shift_no_line():
    """Both views' discs lean the opposite way, and the left ones weigh more: what is left must be small."""
    rows, columns = 12, 12
    line = np.repeat(15.0 + 22 * np.arange(rows), columns)
    x = np.tile(30.0 + 60 * np.arange(columns), rows)
    line += np.where(x < 360, 0.0, 1.0)
    lean = np.where(x < 360, 1, -1) * 0.4 * (line / 144 - 1)
    first = np.floor(line - HEIGHT / 2 + 1).astype(np.int64)
    beside = 2 * (first[:, None] + np.arange(HEIGHT) - line[:, None])
    weight = np.broadcast_to(np.where(x < 360, 0.03, 0.06)[:, None] ** -2.0, beside.shape)
    share = np.full(beside.shape, 1 / HEIGHT)
    chords = Chords(np.arange(len(x)), first, x[:, None] + lean[:, None] * beside, weight, share)
    found = line_shifts(chords, line, SIZE, 0.12, known=True)
    off_px = (share * beside).sum(axis=1) * lean
    assert np.abs(off_px).max() < 0.45
    assert np.sqrt((found.x_px**2).mean()) < 0.006
