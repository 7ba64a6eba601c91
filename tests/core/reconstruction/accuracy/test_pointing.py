from dataclasses import replace

import numpy as np
import pytest

from core.reconstruction.repeated import grid, series_of
from grabberd.core.reconstruction.accuracy import PAPER_PX, pointing_precision

FIELDS, TARGETS = 32, 108


def repeated(sigma_px, seed=1, fields=FIELDS):
    series = series_of(np.tile(grid(TARGETS), (fields, 1, 1)))
    noise = np.random.default_rng(seed).normal(size=series.image_px.shape) * sigma_px
    return replace(series, image_px=series.image_px + noise)


def test_the_papers_test_gives_its_own_numbers_back():
    precision = pointing_precision(repeated(PAPER_PX))
    assert (precision.fields, precision.targets) == (FIELDS, TARGETS)
    assert precision.both_px == pytest.approx(PAPER_PX, rel=0.03)


def test_the_views_are_told_apart():
    precision = pointing_precision(repeated(np.array([[0.1, 0.2], [0.3, 0.4]])))
    assert precision.left_px == pytest.approx((0.1, 0.2), rel=0.05)
    assert precision.right_px == pytest.approx((0.3, 0.4), rel=0.05)
    assert precision.both_px == pytest.approx(np.sqrt([0.05, 0.1]), rel=0.05)


def test_one_measurement_has_no_precision():
    assert pointing_precision(repeated(PAPER_PX, fields=1)) is None


def test_targets_that_come_and_go_do_not_count_as_scatter():
    series = repeated(PAPER_PX)
    gone = np.random.default_rng(2).random(series.seen.shape) < 0.3
    assert pointing_precision(series.without(gone)).both_px == pytest.approx(PAPER_PX, rel=0.04)
