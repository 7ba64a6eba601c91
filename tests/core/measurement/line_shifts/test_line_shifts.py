"""Chords made up with known shifts, and what is found of these."""

import numpy as np
import pytest

from grabberd.core.measurement.line_shifts import line_shifts, unsolved
from grabberd.core.measurement.locators.locator import Chords

LINES = 288
SIZE = LINES, 720
HEIGHT = 4


def made_up(seed, *, jitter=0.12, sigma=0.04, lean=0.08, rows=25, columns=12, wild=0, stagger=0.0):
    """Chords of a grid of blobs, their centres' lines, and the shifts."""
    rng = np.random.default_rng(seed)
    shift = rng.normal(0, jitter, LINES)
    centre = 5 + 10.8 * np.repeat(np.arange(rows), columns) + stagger * rng.uniform(-0.5, 0.5, rows * columns)
    first = np.floor(centre - HEIGHT / 2 + 1).astype(np.int64)
    line = first[:, None] + np.arange(HEIGHT)
    count = rows * columns
    x = rng.uniform(20, 700, count)
    slope = rng.normal(0, lean, count)
    middle = x[:, None] + slope[:, None] * 2 * (line - centre[:, None]) + shift[line]
    middle += rng.normal(0, sigma, middle.shape)
    middle[:wild] += rng.uniform(-3, 3, (wild, HEIGHT))
    share = np.full(middle.shape, 1 / HEIGHT)
    return Chords(np.arange(count), first, middle, np.full(middle.shape, sigma**-2), share), centre, shift


def left_over(chords, centre, shift, expected=0.12):
    """What the shifts leave in x, and the estimate."""
    found = line_shifts(chords, centre, SIZE, expected)
    line = chords.line[:, None] + np.arange(HEIGHT)
    return (chords.share * shift[line]).sum(axis=1) - found.x_px, found


@pytest.mark.parametrize("jitter", [0.05, 0.12, 0.3])
@pytest.mark.parametrize("expected", [0.06, 0.2])
def test_the_line_jitter_comes_out_of_the_data(jitter, expected):
    found = [left_over(*made_up(seed, jitter=jitter), expected)[1].line_jitter_px for seed in range(40)]

    assert np.mean(found) == pytest.approx(jitter, rel=0.06)


@pytest.mark.parametrize("stagger", [0.0, 8.0])
@pytest.mark.parametrize("sigma", [0.02, 0.1])
def test_what_remains_is_as_large_as_it_says(stagger, sigma):
    runs = [left_over(*made_up(seed, stagger=stagger, sigma=sigma)) for seed in range(40)]
    in_sigmas = np.concatenate([error / found.common_px for error, found in runs])
    assert np.sqrt((in_sigmas**2).mean()) == pytest.approx(1, abs=0.1)


def test_blobs_that_share_only_some_of_their_lines_let_more_of_the_shifts_be_known():
    in_rows, staggered = (left_over(*made_up(1, stagger=stagger))[1] for stagger in (0.0, 9.0))
    assert staggered.common_px.mean() < 0.9 * in_rows.common_px.mean()
    assert staggered.common_reach_px > 1.2 * in_rows.common_reach_px


def test_without_any_jitter_nothing_is_corrected():
    error, found = left_over(*made_up(3, jitter=0.0))
    assert np.abs(error).max() < 0.02
    assert found.line_jitter_px < 0.02


def test_a_few_wild_blobs_do_no_harm_to_the_others():
    runs = [left_over(*made_up(seed, wild=6)) for seed in range(20)]
    in_sigmas = np.concatenate([(error / found.common_px)[6:] for error, found in runs])
    assert np.sqrt((in_sigmas**2).mean()) < 1.2
    assert np.mean([found.line_jitter_px for _, found in runs]) == pytest.approx(0.12, rel=0.1)


def test_a_lonely_blob_learns_nothing_and_says_so():
    chords, centre, _ = made_up(5, rows=1, columns=1)
    found = line_shifts(chords, centre, SIZE, 0.12)
    assert abs(found.x_px[0]) < 0.05
    np.testing.assert_allclose(
        found.common_px, unsolved(chords.share, found.line_jitter_px).common_px, rtol=0.05
    )


def test_the_shifts_do_not_depend_on_the_order_of_the_blobs():
    chords, centre, _ = made_up(6)
    turned = Chords(*(values[::-1] for values in chords))
    one, other = line_shifts(chords, centre, SIZE, 0.12), line_shifts(turned, centre[::-1], SIZE, 0.12)
    np.testing.assert_allclose(one.x_px, other.x_px[::-1], atol=1e-9)


def test_shares_without_chords_keep_the_whole_jitter():
    chords, centre, _ = made_up(7, rows=1)
    empty = chords._replace(weight=np.zeros_like(chords.weight))
    found = line_shifts(empty, centre, SIZE, 0.12)
    assert not found.x_px.any()
    np.testing.assert_allclose(found.common_px, unsolved(chords.share, 0.12).common_px, rtol=1e-6)
