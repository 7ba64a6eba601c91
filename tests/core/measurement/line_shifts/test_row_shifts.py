"""At 1 bit, the shifts of lines come from the middles of the rows of all discs on them."""

import numpy as np
import pytest

from core.measurement.rendering import errors_px, grid_of_discs
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.measurement.line_shifts import FURTHEST_PX, MIDDLE_PX2, Rows, moved_by_shifts

JITTER_PX = 0.2
HEIGHT = 5


def picture(rows, doubled=False):
    field = Field.intact(np.zeros((rows, 64), np.uint8), 0)
    return quantise(double_lines(field) if doubled else field, 1, 80)


def stack(tops, x, shift_of_row):
    """Rows of upright discs of equal rows, whose ends are not rounded, so that only shifts move them."""
    row = np.add.outer(tops, np.arange(HEIGHT))
    middle = np.asarray(x)[:, np.newaxis] + shift_of_row[row]
    of = np.repeat(np.arange(len(tops)), HEIGHT)
    centres = np.stack([middle.mean(axis=1), row.mean(axis=1)], axis=1)
    return Rows(of, row.ravel(), middle.ravel() - 2, middle.ravel() + 2), centres


def least_squares(rows, centres, line_parts, jitter_px):
    """(M,) movement of discs by the most likely shifts, from dense normal equations."""
    off = (rows.first + rows.last) / 2 - centres[rows.of, 0]
    normal = line_parts.T @ line_parts / MIDDLE_PX2 + np.eye(line_parts.shape[1]) / jitter_px**2
    shift = np.linalg.solve(normal, line_parts.T @ off / MIDDLE_PX2)
    return np.bincount(rows.of, line_parts @ shift) / HEIGHT


@pytest.mark.parametrize("doubled", [False, True])
def test_they_are_those_of_least_squares(doubled):
    rng = np.random.default_rng(3)
    packed = picture(24, doubled)
    line_shift = rng.normal(0, JITTER_PX, 24)
    half = np.arange(48) if doubled else 2 * np.arange(24)
    parts = np.zeros((len(half), 24))
    np.add.at(parts, (np.arange(len(half)), half // 2), 0.5)
    np.add.at(parts, (np.arange(len(half)), np.minimum((half + 1) // 2, 23)), 0.5)
    rows, centres = stack(rng.integers(2, len(half) - 8, 40), rng.uniform(10, 50, 40), parts @ line_shift)
    found = moved_by_shifts(rows, packed, centres, np.zeros(40), JITTER_PX)
    assert found == pytest.approx(least_squares(rows, centres, parts[rows.row], JITTER_PX), abs=1e-12)


def test_the_lean_of_discs_is_no_shift():
    rows, centres = stack(np.arange(2, 12), np.full(10, 30.0), np.zeros(24))
    lean = np.full(10, 0.1)
    leaning = lean[0] * 2 * (rows.row - centres[rows.of, 1])
    rows = rows._replace(first=rows.first + leaning, last=rows.last + leaning)
    assert moved_by_shifts(rows, picture(24), centres, lean, JITTER_PX) == pytest.approx(0.0, abs=1e-12)


def test_a_row_far_from_its_disc_counts_no_more_than_rounding_explains():
    def moved(by_px):
        rows, centres = stack(np.array([4]), [30.0], by_px * (np.arange(24) == 4))
        return moved_by_shifts(rows, picture(24), centres, np.zeros(1), JITTER_PX)[0]

    assert moved(3 * FURTHEST_PX) < 2.5 * moved(FURTHEST_PX)
    assert abs(moved(100.0)) < FURTHEST_PX


@pytest.mark.parametrize(("doubled", "gain"), [(True, 0.04), (False, 0.01)])
def test_of_discs_side_by_side_they_take_away_part_of_the_error_along_the_lines(doubled, gain):
    square = dict.fromkeys((None, False), 0.0)
    for seed in range(4):
        field, places = grid_of_discs(
            np.random.default_rng(seed),
            diameter_px=5.5,
            spread_px=0.8,
            noise=0.02,
            parity=seed % 2,
            jitter_px=JITTER_PX,
        )
        packed = quantise(double_lines(field) if doubled else field, 1, 66)
        for solved in square:
            settings = LocationSettings(line_jitter_px=JITTER_PX, line_shifts=solved)
            square[solved] += (errors_px(measure(packed, None, settings), places)[0][:, 0] ** 2).mean()
    assert square[None] < (1 - gain) ** 2 * square[False]
