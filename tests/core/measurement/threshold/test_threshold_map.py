import numpy as np
import pytest

from core.measurement.rendering import TOP, errors_px, grid_of_discs
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import (
    LocationSettings,
    ThresholdRule,
    choose_threshold,
    measure,
    threshold_map,
    with_seen_size,
)
from grabberd.core.measurement.threshold import INTACT
from grabberd.errors import MeasurementError

RULE = ThresholdRule(fraction=0.25)


def in_uneven_light(field, *, unevenness):
    """The same picture, brighter at the left than at the right."""
    light = 1 + unevenness * np.cos(np.linspace(0, np.pi, field.columns))
    return Field.intact(np.clip(np.round(field.luma * light), 0, 255).astype(np.uint8), field.parity)


@pytest.fixture(scope="module")
def scene():
    return grid_of_discs(np.random.default_rng(3), background=40, contrast=120, noise=0.02)


def test_in_even_light_the_map_is_the_common_threshold(scene):
    field, _ = scene
    common = choose_threshold(np.bincount(field.luma.ravel(), minlength=256), RULE, 1)
    found = threshold_map(field.luma, RULE, 1)
    assert found.shape == field.luma.shape
    assert found.dtype == np.uint8
    assert np.abs(found.astype(int) - common).max() <= 4


def test_in_uneven_light_the_map_follows_background_and_contrast(scene):
    found = threshold_map(in_uneven_light(scene[0], unevenness=0.5).luma, RULE, 1)
    for column, light in [(40, 1.48), (360, 1.0), (680, 0.52)]:
        assert np.median(found[:, column]) == pytest.approx((40 + 0.25 * 120) * light, rel=0.1)


def test_with_a_map_targets_look_alike_in_bright_and_dark_parts(scene):
    field, places = in_uneven_light(scene[0], unevenness=0.25), scene[1]
    common = choose_threshold(np.bincount(field.luma.ravel(), minlength=256), RULE, 1, INTACT)
    spread = []
    for threshold in (common, threshold_map(field.luma, RULE, 1, INTACT)):
        blobs = measure(quantise(field, 1, threshold), None, LocationSettings())
        x, area = blobs.xy_px[:, 0], blobs.area_px
        spread.append(area[x < 240].mean() - area[x > 480].mean())
    assert abs(spread[1]) < 0.3 * abs(spread[0])
    error, _ = errors_px(blobs, places)
    assert len(error) == len(blobs) == len(places)


def test_a_part_without_targets_takes_its_contrast_from_the_others(scene):
    luma = scene[0].luma.copy()
    luma[96:144, 180:270] = 40
    found = threshold_map(luma, RULE, 1)
    assert np.abs(found[96:144, 180:270].astype(int) - int(np.median(found))).max() <= 5


def test_a_fixed_rule_gives_an_even_map():
    assert (threshold_map(np.zeros((8, 16), np.uint8), ThresholdRule("fixed", 77), 1) == 77).all()


def test_trinders_levels_count_from_the_local_background(scene):
    found = threshold_map(in_uneven_light(scene[0], unevenness=0.5).luma, ThresholdRule("trinder"), 8)
    assert np.median(found[:, 40]) == pytest.approx(40 * 1.48 + 23, abs=4)
    assert np.median(found[:, 680]) == pytest.approx(40 * 0.52 + 23, abs=4)


def test_a_picture_without_targets_is_refused():
    with pytest.raises(MeasurementError, match="no targets stand out in any of 8 by 6 parts"):
        threshold_map(np.full((288, 720), 30, np.uint8), RULE, 1)


@pytest.mark.parametrize("diameter_px", [4.0, 5.0, 6.5])
def test_the_size_of_targets_is_seen(diameter_px):
    field, _ = grid_of_discs(np.random.default_rng(6), diameter_px=diameter_px, noise=0.02, parity=TOP)
    assert with_seen_size(RULE, field).target_px == pytest.approx(diameter_px, abs=0.4)
