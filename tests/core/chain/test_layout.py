"""Pictures that hold two fields, or the same twice, or not all, are named; genuine ones never are."""

import numpy as np
import pytest

from core.chain.drawn_discs import COLUMNS, LINES, frame
from grabberd.core.chain.inspection import Interlacing, inspect
from grabberd.core.chain.layout import Layout, LayoutKind
from grabberd.core.field import Field, double_lines


def moved(time):
    return 0.0, 6.0 * np.interp(time % 40, [5, 15, 25, 35], [0.0, 1.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def fields():
    """Eighty fields of moving discs, top first."""
    random = np.random.default_rng(1)
    return [Field.intact(frame(moved(n), random)[n % 2 :: 2].copy(), n % 2) for n in range(80)]


@pytest.fixture(scope="module")
def frames(fields):
    woven = []
    for top, bottom in zip(fields[::2], fields[1::2], strict=True):
        picture = np.empty((LINES, COLUMNS), np.uint8)
        picture[::2], picture[1::2] = top.luma, bottom.luma
        woven.append(picture)
    return woven


def without(picture, part):
    left = picture.copy()
    left[part] = 16
    return left


HALF = LINES // 2, COLUMNS // 2
MADE = {
    (LayoutKind.STACKED, "top"): lambda one: np.vstack([one[::2], one[1::2]]),
    (LayoutKind.STACKED, "bottom"): lambda one: np.vstack([one[1::2], one[::2]]),
    (LayoutKind.BESIDE, "top"): lambda one: np.hstack([one[::2], one[1::2]]),
    (LayoutKind.BESIDE, "bottom"): lambda one: np.hstack([one[1::2], one[::2]]),
    (LayoutKind.TWICE_BELOW, ""): lambda one: np.vstack([one, one]),
    (LayoutKind.TWICE_BESIDE, ""): lambda one: np.hstack([one, one]),
    (LayoutKind.LINES_TWICE, ""): lambda one: np.repeat(one[::2], 2, axis=0),
    (LayoutKind.INTERPOLATED, "bottom"): lambda one: double_lines(Field.intact(one[::2], 0)).luma,
    (LayoutKind.FIELD_MISSING, "top"): lambda one: without(one, np.s_[::2]),
    (LayoutKind.FIELD_MISSING, "bottom"): lambda one: without(one, np.s_[1::2]),
    (LayoutKind.HALF_MISSING, "lower"): lambda one: without(one, np.s_[HALF[0] :]),
    (LayoutKind.HALF_MISSING, "right"): lambda one: without(one, np.s_[:, HALF[1] :]),
}


@pytest.mark.parametrize(("kind", "part"), MADE)
def test_what_the_pictures_prove_is_named(frames, kind, part):
    found = inspect(MADE[kind, part](one) for one in frames)
    assert found.layout == Layout(kind, part)
    assert found.interlacing is Interlacing.UNKNOWN


def test_frames_and_their_fields_are_no_layout(frames, fields):
    for found in (inspect(frames), inspect(field.luma for field in fields)):
        assert found.layout is None
        assert not found.is_flat


@pytest.mark.parametrize("first", [0, 1])
def test_single_fields_tell_their_parity_and_their_order(fields, first):
    found = inspect(field.luma for field in fields[first:])
    assert (found.interlacing, found.lines) == (Interlacing.FIELDS, LINES)
    assert found.first_parity == ("top", "bottom")[first]
    assert found.order.order == "right"


def test_fields_that_were_separated_in_the_wrong_order_are_found_out(fields):
    pairs = zip(fields[1::2], fields[::2], strict=True)
    found = inspect(field.luma for pair in pairs for field in pair)
    assert (found.first_parity, found.order.order) == ("bottom", "reversed")


def test_a_field_that_is_missing_does_not_exchange_the_parities(fields):
    found = inspect(None if n == 7 else field.luma for n, field in enumerate(fields))
    assert found.first_parity == "top"


def test_fields_of_one_parity_are_whole_pictures_of_half_the_height(fields):
    found = inspect(field.luma for field in fields[::2])
    assert (found.interlacing, found.lines) == (Interlacing.PROGRESSIVE, LINES // 2)
    assert found.is_flat


@pytest.mark.parametrize("first", [0, 1])
def test_fields_whose_missing_lines_are_interpolated_are_played_as_such(fields, first):
    found = inspect(double_lines(field).luma for field in fields[first:])
    assert (found.interlacing, found.first_parity) == (Interlacing.DOUBLED, ("top", "bottom")[first])


def test_without_targets_the_parity_of_single_fields_is_not_made_up():
    random = np.random.default_rng(4)
    found = inspect(random.normal(20, 3, (240, 640)).clip(0, 255).astype(np.uint8) for _ in range(20))
    assert (found.interlacing, found.first_parity) == (Interlacing.FIELDS, None)
