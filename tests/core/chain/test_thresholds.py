"""The threshold of fields to come: by the seen size, the lines, and pixel by pixel in uneven light."""

import time

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.light import field_threshold, field_threshold_map
from grabberd.core.chain.measure import measure_fields
from grabberd.core.field import Field, NumberedField, double_lines, quantise
from grabberd.core.measurement import ThresholdRule
from grabberd.errors import MeasurementError

RULE = ThresholdRule(spread_px=0.8)


def discs(diameter_px):
    """Discs with soft edges, 30 px apart, on the lines of one field."""
    y, x = np.mgrid[0:576:2, 0:720]
    distance = np.hypot(x % 30 - 15, y % 30 - 15)
    share = np.clip((diameter_px / 2 - distance) / 2 + 0.5, 0, 1)
    noise = np.random.default_rng(1).normal(0, 4, share.shape)
    return Field.intact(np.clip(30 + 180 * share + noise, 0, 255).astype(np.uint8), 0)


def test_the_threshold_is_that_for_the_seen_size_whatever_the_rule_supposes():
    field = discs(8.0)
    supposed = [
        field_threshold(field, ThresholdRule(target_px=size), 1, doubled=True) for size in (2.0, 12.0)
    ]
    assert supposed[0] == supposed[1]


def test_intact_and_doubled_lines_have_thresholds_of_their_own():
    chosen = {
        (size, doubled): field_threshold(discs(size), RULE, 1, doubled=doubled)
        for size in (6.0, 9.0, 11.0)
        for doubled in (True, False)
    }
    assert any(chosen[size, True] != chosen[size, False] for size in (6.0, 9.0, 11.0))


def test_a_lamp_in_the_picture_does_not_take_all_the_time():
    luma = np.full((288, 720), 20, np.uint8)
    luma[20:120, 100:300] = 220
    begin_s = time.process_time()
    assert 20 < field_threshold(Field.intact(luma, 0), RULE, 1, doubled=True) < 220
    assert time.process_time() - begin_s < 5


def test_specks_too_small_for_a_target_leave_the_supposed_size():
    luma = np.full((288, 720), 20, np.uint8)
    luma[::16, ::16] = 220
    assert 20 < field_threshold(Field.intact(luma, 0), RULE, 1, doubled=False) < 220


@pytest.mark.parametrize("choose", [field_threshold_map, lambda *a, **k: field_threshold(*a, 1, **k)])
def test_a_dark_picture_is_refused(choose):
    with pytest.raises(MeasurementError, match="no targets stand out"):
        choose(Field.intact(np.full((288, 720), 20, np.uint8), 0), RULE, doubled=True)


@pytest.fixture(scope="module")
def uneven():
    return take_scene(4, scene="ellipse", picture={"uneven_light": 0.5, "background": 60, "contrast": 100})


@pytest.mark.parametrize("doubled", [True, False])
def test_in_uneven_light_a_map_finds_the_targets_that_one_threshold_loses(uneven, doubled):
    _, first = uneven.fields[0]
    one = field_threshold(first, RULE, 1, doubled=doubled)
    by_pixel = field_threshold_map(first, RULE, doubled=doubled)
    lost, whole = (points(uneven, threshold, doubled) for threshold in (one, by_pixel))
    seen = uneven.truth.expected.sum() / len(uneven.fields)
    assert whole >= seen - 1
    assert lost < 0.5 * seen


def points(scene, threshold, doubled):
    """How many targets have a point in a field."""
    packed = (
        NumberedField(n, time_ns, n, quantise(double_lines(one) if doubled else one, 1, threshold))
        for n, (time_ns, one) in enumerate(scene.fields)
    )
    return np.mean([len(measured.points) for measured in measure_fields(packed, scene.setup)])
