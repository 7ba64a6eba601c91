"""The order of fields in time, by the points of targets that move: paths known exactly, in any order."""

import numpy as np
import pytest

from grabberd.core.reconstruction import Points
from grabberd.core.reconstruction.field_order import BLOCK, FieldOrderCheck, Order

TARGETS = np.arange(10, 40, dtype=np.int32)
SIGMA_MM = 0.05
SECONDS_8 = 400
RESTING, PULSATING = 0.0, 3.0


def path(time, stroke_mm, period=50.0):
    """(N, T, 3) a wall that closes, rests and opens, more in its middle than at its edges."""
    phase = np.asarray(time) % period / period
    share = np.interp(phase, [0.1, 0.3, 0.6, 0.8], [0.0, 1.0, 1.0, 0.0])
    bend = np.sin(np.pi * np.linspace(0.1, 0.9, len(TARGETS)))
    moved = (0.5 - 0.5 * np.cos(np.pi * share))[:, np.newaxis] * bend * stroke_mm
    return np.stack([np.zeros_like(moved), np.zeros_like(moved), moved], axis=2)


def judged(
    a, *, stroke_mm=PULSATING, count=SECONDS_8, seed=1, offset_mm=0.0, kept=None, first=0, period=50.0
):
    """Verdict on fields n exposed at n + a (-1)^n; `kept` says of a number whether the field came."""
    random, numbers = np.random.default_rng(seed), np.arange(first, first + count)
    sign = 1 - 2 * (numbers % 2)
    xyz = path(numbers + a * sign, stroke_mm, period) + random.normal(
        0, SIGMA_MM / 3**0.5, (count, len(TARGETS), 3)
    )
    xyz += sign[:, np.newaxis, np.newaxis] * offset_mm * random.normal(1, 0.5, (len(TARGETS), 3))
    check = FieldOrderCheck(TARGETS)
    for n, places in zip(numbers, xyz, strict=True):
        if kept is None or kept(n):
            check.add(int(n), points(places))
    return check.finish()


def points(places):
    covariance = np.broadcast_to(np.eye(3) * SIGMA_MM**2 / 3, (len(places), 3, 3))
    images = np.zeros((len(places), 2, 2))
    return Points(TARGETS[: len(places)], places, covariance, covariance, images, np.zeros(len(places)))


@pytest.mark.parametrize(
    ("a", "order"),
    [
        (0.0, Order.RIGHT),
        (1.0, Order.REVERSED),
        (-1.0, Order.REVERSED),
        (0.5, Order.SAME_INSTANT),
        (-0.5, Order.SAME_INSTANT),
    ],
)
@pytest.mark.parametrize("first", [0, 7])
def test_a_moving_target_tells_the_order(a, order, first):
    fit = judged(a, first=first)
    assert fit.order is order
    assert fit.shift_fields == pytest.approx(abs(a), abs=4 * fit.sigma_fields)


def test_the_zigzag_grows_with_the_speed():
    small, large = judged(1.0, stroke_mm=2.0), judged(1.0, stroke_mm=4.0)
    assert 1.5 < large.zigzag_mm / small.zigzag_mm < 2.5
    assert judged(0.0).zigzag_mm < 0.1 * large.zigzag_mm


@pytest.mark.parametrize("a", [0.0, 1.0])
def test_at_rest_nothing_is_told(a):
    fit = judged(a, stroke_mm=RESTING)
    assert fit.order is Order.NO_MOVEMENT
    assert fit.fields == 0


@pytest.mark.parametrize("offset_mm", [0.1, 0.5])
def test_an_offset_between_the_parities_is_no_order(offset_mm):
    assert judged(0.0, offset_mm=offset_mm).order is Order.RIGHT
    assert judged(1.0, offset_mm=offset_mm).order is Order.REVERSED
    assert judged(0.0, offset_mm=offset_mm, stroke_mm=RESTING).order is Order.NO_MOVEMENT


def test_lost_fields_leave_the_verdict():
    lost = np.random.default_rng(3).random(2 * SECONDS_8) < 0.05
    assert judged(1.0, kept=lambda n: not lost[n], count=2 * SECONDS_8).order is Order.REVERSED
    assert judged(0.0, kept=lambda n: not lost[n], count=2 * SECONDS_8).order is Order.RIGHT


def test_a_long_gap_is_bridged_by_nothing():
    assert judged(1.0, kept=lambda n: n % 1000 < 300, count=2300).order is Order.REVERSED


@pytest.mark.parametrize("a", [0.0, 1.0])
def test_one_parity_alone_has_no_order(a):
    assert judged(a, kept=lambda n: n % 2 == 0).order is Order.NO_MOVEMENT


def test_a_short_movement_is_not_enough():
    assert judged(1.0, count=20, first=8).order in {Order.UNCLEAR, Order.NO_MOVEMENT}


def test_a_wall_that_snaps_over_between_two_frames_is_not_accused():
    """Every second of it the same way: at these instants both fields of each frame are alike."""
    check, numbers = FieldOrderCheck(TARGETS), np.arange(SECONDS_8)
    for n in numbers:
        open_or_closed = 5.0 * (n % 50 < 26)
        check.add(int(n), points(np.full((len(TARGETS), 3), open_or_closed)))
    assert check.finish().order in {Order.NO_MOVEMENT, Order.UNCLEAR}


def test_fields_are_judged_by_blocks_as_they_come():
    check, evaluated = FieldOrderCheck(TARGETS), []
    for n, places in enumerate(path(np.arange(4 * BLOCK), PULSATING)):
        evaluated.append(check.add(n, points(places)))
    assert sum(evaluated) >= 1
    assert check.fit().order is Order.RIGHT


def test_an_order_that_changes_is_noticed_though_known_ones_are_seldom_looked_at():
    check, verdicts, numbers = FieldOrderCheck(TARGETS, kept=100), [], np.arange(10_000)
    changes_places = (1 - 2 * (numbers % 2)) * (numbers >= 2000)
    for n, places in zip(numbers, path(numbers + changes_places, PULSATING), strict=True):
        if check.add(int(n), points(places)):
            verdicts.append(check.fit().order)
    assert verdicts[0] is Order.RIGHT
    assert verdicts[-1] is Order.REVERSED
    assert len(verdicts) < 40


def test_numbers_that_go_back_begin_a_new_stream():
    check = FieldOrderCheck(TARGETS)
    for _ in range(2):
        for n, places in enumerate(path(np.arange(SECONDS_8), PULSATING)):
            check.add(n, points(places))
    assert check.finish().order is Order.RIGHT


@pytest.mark.parametrize("period", [25.0, 37.3, 50.0, 66.0])
def test_no_order_is_accused_wrongly(period):
    """Seeds with strokes from hardly anything to a closure in three fields."""
    strokes = np.geomspace(0.05, 20, 25)
    verdicts = {
        judged(0.0, stroke_mm=mm, seed=k, offset_mm=0.1, period=period).order for k, mm in enumerate(strokes)
    }
    assert verdicts <= {Order.RIGHT, Order.UNCLEAR, Order.NO_MOVEMENT}
    assert Order.RIGHT in verdicts
