"""Fields whose lines are shifted, and what location makes of them."""

import numpy as np
import pytest

from core.measurement.rendering import PITCH_PX, TOP, errors_px, grid_of_discs
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure

JITTER_PX = 0.3
WAYS = [("centroid", 1, False), ("centroid", 1, True), ("centroid", 8, False), ("weighted", 8, False)]
WAYS += [("template", 8, False), ("template", 8, True), ("edge", 8, False), ("correlation", 8, False)]
GREY_WAYS = [way for way in WAYS if way[1] > 1]


@pytest.fixture(scope="module")
def scenes():
    return [scene_of(seed) for seed in range(4)]


def scene_of(seed):
    """Discs on lines that are shifted, every third column of them a bit lower; and their places."""
    rng = np.random.default_rng(seed)
    field, places = grid_of_discs(rng, diameter_px=5.8, spread_px=0.8, noise=0.0)
    light = field.luma.astype(float)
    lower = places[:, 0] // PITCH_PX % 3
    for column in range(0, field.columns, PITCH_PX):
        block = light[:, column : column + PITCH_PX]
        block[:] = np.roll(block, column // PITCH_PX % 3, axis=0)
    columns, shift = np.arange(field.columns), rng.normal(0, JITTER_PX, field.rows)
    rows = [np.interp(columns, columns + s, row) for s, row in zip(shift, light, strict=True)]
    noisy = np.array(rows) + rng.normal(0, 3.6, light.shape)
    luma = np.clip(np.round(noisy), 0, 255).astype(np.uint8)
    return Field.intact(luma, TOP), places + np.outer(lower, (0, 2))


def located(scene, method, bits, doubled, *, line_shifts=True, **known):
    field, places = scene
    packed = quantise(double_lines(field) if doubled else field, bits, 70)
    blobs = measure(packed, None, LocationSettings(method=method, line_shifts=line_shifts, **known))
    error, blob = errors_px(blobs, places)
    return error, blobs.select(blob)


def errors_in_all(scenes, *way, **known):
    """Errors (N, 2) in all scenes, and their σ in x."""
    found = [located(scene, *way, **known) for scene in scenes]
    sigmas = [np.hypot(blobs.sigma_px[:, 0], blobs.common_px) for _, blobs in found]
    return np.concatenate([error for error, _ in found]), np.concatenate(sigmas)


def rms(values):
    return np.sqrt((values**2).mean(axis=0))


@pytest.mark.parametrize("way", WAYS)
def test_solving_for_the_shifts_makes_x_better_and_leaves_y(scenes, way):
    with_shifts, _ = errors_in_all(scenes, *way)
    without, _ = errors_in_all(scenes, *way, line_shifts=False)
    assert rms(with_shifts)[0] < 0.93 * rms(without)[0]
    np.testing.assert_array_equal(with_shifts[:, 1], without[:, 1])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("line_shifts", [True, False])
def test_the_error_in_x_is_pointing_and_what_lines_have_in_common(scenes, way, line_shifts):
    error, sigma = errors_in_all(scenes, *way, line_shifts=line_shifts, line_jitter_px=JITTER_PX)
    assert 0.8 < rms(error[:, 0] / sigma) < 1.2


@pytest.mark.parametrize("way", GREY_WAYS)
def test_the_line_jitter_of_the_field_is_found(scenes, way):
    _, blobs = located(scenes[0], *way)
    assert blobs.line_jitter_px == pytest.approx(JITTER_PX, rel=0.2)


@pytest.mark.parametrize("way", GREY_WAYS)
def test_the_error_in_common_reaches_further_once_the_shifts_are_solved_for(scenes, way):
    _, solved = located(scenes[0], *way)
    _, unsolved = located(scenes[0], *way, line_shifts=False)
    assert unsolved.line_jitter_px is None
    assert 1.0 < unsolved.common_reach_px < solved.common_reach_px < 20.0


def test_blobs_on_the_same_lines_err_alike_by_what_they_have_in_common(scenes):
    error, blobs = located(scenes[0], "template", 8, False)
    row = np.round(blobs.xy_px[:, 1] / 2)
    mean = np.array([error[row == one, 0].mean() for one in np.unique(row)])
    assert rms(mean) == pytest.approx(rms(blobs.common_px), rel=0.45)


def test_lines_that_are_known_to_be_steady_are_left_alone(scenes):
    _, blobs = located(scenes[0], "weighted", 8, False, line_jitter_px=0.0)
    assert not blobs.common_px.any()
    assert blobs.line_jitter_px is None


def test_a_field_without_targets_says_nothing_about_its_lines():
    dark = quantise(Field.intact(np.full((24, 40), 20, np.uint8), TOP), 8, 100)
    assert measure(dark, None, LocationSettings()).line_jitter_px is None


def test_a_long_bright_streak_does_not_hinder(scenes):
    field, places = scenes[0]
    luma = field.luma.copy()
    luma[3:-3, 3] = 255
    error, _ = located((Field.intact(luma, TOP), places), "centroid", 8, False, max_diameter_px=40.0)
    assert len(error) == len(places)


@pytest.mark.parametrize("bits", [1, 2, 8])
def test_unless_forbidden_shifts_are_taken_away_and_the_jitter_is_told_by_grey_values_alone(scenes, bits):
    packed = quantise(scenes[0][0], bits, 70)
    usual, asked, forbidden = (
        measure(packed, None, LocationSettings(line_shifts=one)) for one in (None, True, False)
    )
    np.testing.assert_array_equal(usual.xy_px, asked.xy_px)
    assert (usual.xy_px[:, 0] != forbidden.xy_px[:, 0]).any()
    assert (usual.line_jitter_px is not None) == (bits > 1)
