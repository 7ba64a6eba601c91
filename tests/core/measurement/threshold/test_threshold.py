import numpy as np
import pytest

from core.measurement.rendering import grid_of_discs
from grabberd.core.measurement import ThresholdRule, background_of, choose_threshold, trinder_levels
from grabberd.core.measurement.threshold import DOUBLED, INTACT, WHOLE, Scene, best_fraction
from grabberd.errors import MeasurementError

AUTOMATIC = ThresholdRule()


def histogram_of(field):
    return np.bincount(field.luma.ravel(), minlength=256)


@pytest.fixture(scope="module")
def targets():
    """Background 30, targets 180 above it, noise 3.6."""
    field, _ = grid_of_discs(np.random.default_rng(5), background=30, contrast=180, noise=0.02)
    return histogram_of(field)


def test_a_fixed_threshold_is_taken_as_it_is_whatever_the_picture():
    assert choose_threshold(np.zeros(256, int), ThresholdRule("fixed", 77), 1) == 77


def test_trinders_formula_gives_23_levels_for_a_spread_of_1_4_and_5_pixels():
    assert trinder_levels(spread_px=0.7, target_px=5.0) == pytest.approx(22.9, abs=0.05)


def test_trinders_levels_count_from_the_background(targets):
    assert choose_threshold(targets, ThresholdRule("trinder"), 8) == 30 + 23


def test_trinders_threshold_rises_with_the_spread_and_falls_with_the_size():
    assert trinder_levels(0.9, 5.0) > trinder_levels(0.7, 5.0) > trinder_levels(0.7, 6.0)


@pytest.mark.parametrize("bits", [2, 4, 5, 8])
def test_automatic_is_low_for_grey(targets, bits):
    assert (choose_threshold(targets, AUTOMATIC, bits) - 30) / 180 == pytest.approx(0.13, abs=0.02)


@pytest.mark.parametrize(("lines", "jitter_px"), [(DOUBLED, 0.12), (INTACT, 0.12), (WHOLE, 0.0)])
def test_automatic_at_one_bit_is_the_fraction_with_the_least_predicted_error(targets, lines, jitter_px):
    chosen = (choose_threshold(targets, AUTOMATIC, 1, lines) - 30) / 180
    scene = Scene(5.0, spread_px=0.7, noise=0.025, jitter_px=jitter_px, y_step=lines[0], lines_apart=lines[1])
    assert chosen == pytest.approx(best_fraction(scene), abs=0.03)


def test_a_rule_may_name_its_own_fraction(targets):
    half = choose_threshold(targets, ThresholdRule(fraction=0.5), 1)
    assert (half - 30) / 180 == pytest.approx(0.5, abs=0.04)


@pytest.mark.parametrize("kind", ["automatic", "trinder"])
def test_a_brighter_background_raises_the_threshold_as_much(targets, kind):
    rule = ThresholdRule(kind)
    assert choose_threshold(np.roll(targets, 25), rule, 8) == choose_threshold(targets, rule, 8) + 25


def test_automatic_stays_four_sigma_above_a_noisy_background():
    field, _ = grid_of_discs(np.random.default_rng(5), background=60, contrast=100, noise=0.06)
    histogram = histogram_of(field)
    background = background_of(histogram)
    assert choose_threshold(histogram, AUTOMATIC, 8) >= background.level + 4 * background.noise - 0.5


def test_a_single_target_is_enough():
    histogram = np.zeros(256, int)
    histogram[28:33] = [20_000, 50_000, 67_320, 50_000, 20_000]
    histogram[190:210] = 1
    assert choose_threshold(histogram, ThresholdRule(fraction=0.3), 1) == pytest.approx(30 + 0.3 * 175, abs=3)


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
def test_a_picture_without_targets_is_refused_with_what_was_found(noise):
    field, _ = grid_of_discs(np.random.default_rng(5), contrast=0)
    grey = field.luma + np.random.default_rng(6).normal(0, 180 * noise, field.luma.shape)
    histogram = np.bincount(np.clip(np.round(grey), 0, 255).astype(int).ravel(), minlength=256)
    with pytest.raises(MeasurementError, match=r"no targets stand out: .* the background is 3") as refusal:
        choose_threshold(histogram, AUTOMATIC, 1)
    assert "light" in refusal.value.hint


def test_a_white_picture_is_refused_too():
    with pytest.raises(MeasurementError, match="no targets stand out"):
        choose_threshold(np.eye(256, dtype=int)[255] * 1000, AUTOMATIC, 8)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"kind": "otsu"}, "unknown kind 'otsu'; choose from fixed, trinder, automatic"),
        ({"kind": "fixed"}, "needs a value from 0 to 254, not None"),
        ({"kind": "fixed", "value": 255}, "not 255"),
        ({"spread_px": 0.0}, "spread_px 0.0"),
        ({"fraction": 1.0}, "fraction 1.0"),
    ],
)
def test_a_rule_that_makes_no_sense_is_refused(arguments, complaint):
    with pytest.raises(ValueError, match=complaint):
        ThresholdRule(**arguments)
