import numpy as np
import pytest

from core.measurement.rendering import errors_px, grid_of_discs
from core.measurement.test_progressive import drawn
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.measurement.threshold import (
    AS_GOOD,
    FRACTIONS,
    SIZES,
    Scene,
    best_fraction,
    predicted_sigma_px,
)

FIVE_PX = Scene(target_px=5.0, spread_px=0.8, noise=0.025, jitter_px=0.0, y_step=2)
DIAMETERS_PX = 5.0 * np.array(SIZES)


@pytest.mark.parametrize("fraction", [0.2, 0.33, 0.5])
@pytest.mark.parametrize("y_step", [1, 2])
def test_the_prediction_is_what_discs_of_these_sizes_show(y_step, fraction):
    squares = []
    for seed, diameter_px in enumerate(DIAMETERS_PX):
        rng = np.random.default_rng(seed)
        field, places = grid_of_discs(rng, diameter_px=diameter_px, spread_px=0.8, noise=0.02)
        whole = double_lines(field) if y_step == 1 else field
        packed = quantise(whole, 1, round(30 + fraction * 180))
        blobs = measure(packed, None, LocationSettings(method="locale", line_jitter_px=0.0))
        squares.append((errors_px(blobs, places)[0] ** 2).mean(axis=0))
    predicted = predicted_sigma_px(FIVE_PX._replace(y_step=y_step), fraction)
    assert predicted == pytest.approx(np.sqrt(np.mean(squares, axis=0)), rel=0.25)


@pytest.mark.parametrize("fraction", [0.2, 0.33, 0.5])
def test_of_progressive_pictures_it_is_what_polygons_drawn_by_opencv_show(fraction):
    """With all lines delivered, the error in y is that in x; of doubled ones it would be greater."""
    squares = []
    for seed, diameter_px in enumerate(DIAMETERS_PX):
        picture, places = drawn(seed, diameter_px, noise=0.025 * 160)
        packed = quantise(Field.progressive(picture), 1, round(20 + fraction * 160))
        blobs = measure(packed, None, LocationSettings(method="locale"))
        nearest = np.linalg.norm(blobs.xy_px[:, np.newaxis] - places, axis=2).argmin(axis=1)
        squares.append(((blobs.xy_px - places[nearest]) ** 2).mean(axis=0))
    scene = FIVE_PX._replace(y_step=1, lines_apart=1)
    assert predicted_sigma_px(scene, fraction) == pytest.approx(np.sqrt(np.mean(squares, axis=0)), rel=0.15)


def test_the_best_fraction_is_the_lowest_with_about_the_least_predicted_error_where_x_counts_three_times():
    def error(fraction):
        x, y = predicted_sigma_px(FIVE_PX, fraction)
        return np.hypot(3 * x, y)

    errors = [error(fraction) for fraction in FRACTIONS]
    enough = [one for one, of in zip(FRACTIONS, errors, strict=True) if of <= AS_GOOD * min(errors)]
    assert best_fraction(FIVE_PX) == enough[0]


def test_it_is_not_nearer_to_the_noise_than_allowed():
    assert best_fraction(FIVE_PX, least=0.35) >= 0.35
    assert best_fraction(FIVE_PX, least=0.9) == 0.9


def test_line_jitter_and_noise_make_it_worse():
    quiet = predicted_sigma_px(FIVE_PX, 0.3)
    assert predicted_sigma_px(FIVE_PX._replace(jitter_px=0.2), 0.3)[0] > quiet[0]
    assert min(predicted_sigma_px(FIVE_PX._replace(noise=0.1), 0.3)) > min(quiet)
