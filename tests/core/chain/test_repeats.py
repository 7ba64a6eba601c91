"""A repeated picture is known by its bright pixels, and a movement by its targets."""

from collections.abc import Sequence

import numpy as np
import pytest

from core.chain.drawn_fields import COLUMNS, as_grey, coded_again, covered, discs
from grabberd.core.chain.repeats import RepeatJudge, bright_change, moved, rhythm
from grabberd.core.field import BOTTOM, TOP, Field


def judged(fields: Sequence[Field], *, of_any_parity: bool = True) -> list[bool]:
    judge = RepeatJudge(of_any_parity=of_any_parity)
    return [judge.take(one) for one in fields]


def moving(count: int) -> list[Field]:
    return [discs(0.8 * n, seed=n) for n in range(count)]


def at_rest(count: int, noise: float = 3.0) -> list[Field]:
    return [discs(seed=n, noise=noise) for n in range(count)]


# --- how much the bright pixels change ---


def test_the_change_is_the_mean_of_the_pixels_that_are_bright_in_either_picture() -> None:
    before, after = np.full((2, 40, 50), 20, np.uint8)
    before[:10, :10], after[:10, :10] = 100, 110
    before[:10, 20:30], after[:10, 20:30] = 20, 120
    assert bright_change(after, before) == pytest.approx((10 + 100) / 2)
    assert bright_change(before, after) == bright_change(after, before)


def test_what_changes_in_the_dark_counts_nothing() -> None:
    before = np.full((40, 50), 20, np.uint8)
    before[:10, :10] = 200
    after = before.copy()
    after[20:] = 30
    assert bright_change(after, before) == 0.0


def test_a_few_hot_pixels_are_no_targets() -> None:
    before = np.full((40, 50), 20, np.uint8)
    before[0, :20] = 255
    after = before.copy()
    after[1:] = 22
    assert bright_change(after, before) == pytest.approx(2 * 39 / 40)


def test_in_a_picture_without_contrast_every_pixel_counts() -> None:
    assert bright_change(np.full((8, 8), 13, np.uint8), np.full((8, 8), 10, np.uint8)) == 3.0


# --- which fields repeat an earlier one ---


@pytest.mark.parametrize("shown", [moving(12), at_rest(12)], ids=["moving", "at rest"])
def test_a_camera_s_noise_makes_every_field_a_new_one(shown: list[Field]) -> None:
    assert judged(shown) == [False] * 12


@pytest.mark.parametrize("shown", [moving(8), at_rest(8)], ids=["moving", "at rest"])
@pytest.mark.parametrize("again", [lambda field: field, coded_again], ids=["the same", "coded again"])
def test_a_field_that_is_shown_again_is_found(shown, again) -> None:
    shown[4] = again(shown[3])
    assert judged(shown) == [n == 4 for n in range(8)]


def test_every_field_shown_twice_is_found() -> None:
    shown = [coded_again(one, seed) for one in moving(8) for seed in (0, 1)]
    assert judged(shown) == [n % 2 == 1 for n in range(16)]


def test_what_changes_by_a_fifth_of_the_others_is_no_change_where_they_change_by_much() -> None:
    loud = at_rest(8, noise=12.0)
    coarse = loud[3].luma + np.where(np.random.default_rng(0).random(loud[3].luma.shape) < 0.8, 1, 0)
    loud[4] = Field.intact(as_grey(coarse), TOP)
    assert bright_change(loud[4].luma, loud[3].luma) > 0.5
    assert judged(loud)[4]
    quiet = at_rest(8, noise=0.8)
    assert 0.5 < bright_change(quiet[4].luma, quiet[3].luma) < 1.0
    assert judged(quiet) == [False] * 8


def test_fields_of_frames_are_compared_with_the_last_one_of_their_parity() -> None:
    tops, bottoms = moving(6), [discs(0.8 * n + 0.4, seed=100 + n, parity=BOTTOM) for n in range(6)]
    tops[3] = tops[2]
    woven = [one for pair in zip(tops, bottoms, strict=True) for one in pair]
    assert judged(woven, of_any_parity=False) == [n == 6 for n in range(12)]


def test_single_fields_are_compared_with_the_one_right_before_too() -> None:
    shown = moving(6)
    shown[3] = Field.intact(shown[2].luma, BOTTOM)
    assert judged(shown) == [n == 3 for n in range(6)]
    assert judged(shown, of_any_parity=False) == [False] * 6


# --- whether anything moved ---


@pytest.mark.parametrize("seed", range(5))
def test_targets_at_rest_have_not_moved_whatever_the_noise(seed: int) -> None:
    assert not moved(discs(seed=seed), discs(seed=100 + seed))


@pytest.mark.parametrize("shift_px", [-2.0, -0.5, 0.5, 2.0])
def test_targets_that_are_elsewhere_together_have_moved(shift_px: float) -> None:
    assert moved(discs(seed=1), discs(shift_px, seed=2))


def test_targets_that_are_gone_have_moved() -> None:
    still = discs(seed=2)
    assert moved(discs(seed=1), covered(still, COLUMNS // 2))
    assert not moved(discs(seed=1), covered(still, 12))


def test_what_shows_no_target_may_have_moved() -> None:
    assert moved(covered(discs(), COLUMNS), discs())
    assert moved(discs(), covered(discs(), COLUMNS))


# --- how they follow one another ---


@pytest.mark.parametrize(
    ("repeated", "count", "words"),
    [
        ([], 24, ""),
        ([5], 24, ""),
        ([5, 9], 24, ""),
        (range(1, 24, 2), 24, "every second"),
        (range(4, 64, 5), 64, "every fifth"),
        (range(24, 100, 25), 100, "every 25th"),
        (range(21, 100, 22), 100, "every 22nd"),
        (range(9, 16), 24, "mostly one after another"),
        ([1, 3, 5, 7, 9, 11, 13, 16], 24, "every second"),
        ([2, 3, 7, 11, 12, 19], 24, ""),
        (range(1, 24), 24, "the last 23, a frozen end"),
        ([22, 23], 24, "the last 2, a frozen end"),
        ([23], 24, ""),
    ],
)
def test_a_rhythm_is_put_into_words_where_there_is_one(repeated, count: int, words: str) -> None:
    assert rhythm([n in set(repeated) for n in range(count)]) == words
