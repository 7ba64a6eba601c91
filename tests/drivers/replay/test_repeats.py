"""Which pictures of a recording are marked as repeated: those that hide a movement."""

from collections.abc import Callable, Sequence

import pytest

from core.chain.drawn_fields import coded_again, discs
from grabberd.core.field import BOTTOM, TOP, Field
from grabberd.instrument.acquisition import REPEATED, GrabbedField
from grabberd_replay.footage import RepeatMarks

PERIOD_NS = 20_000_000
SPEED_PX = 0.8
"""Movement from one field to the next."""

Path = Callable[[int], float]


def moving(n: int) -> float:
    return SPEED_PX * n


def at_rest(n: int) -> float:
    return 0.0


def camera(count: int, path: Path = moving) -> list[Field]:
    return [discs(path(n), seed=n) for n in range(count)]


def shown(fields: Sequence[Field], order: Sequence[int]) -> list[Field]:
    """The camera's fields as a recorder has them: each coded anew."""
    return [coded_again(fields[of], seed) for seed, of in enumerate(order)]


def marked(fields: Sequence[Field], in_picture: int = 1) -> list[int]:
    """Numbers of the fields that are marked; none is lost or out of order."""
    marks = RepeatMarks(in_picture)
    grabbed = [GrabbedField(one, n * PERIOD_NS, n, None) for n, one in enumerate(fields)]
    batches = [grabbed[n : n + in_picture] for n in range(0, len(grabbed), in_picture)]
    found = [one for batch in batches for given in marks.take(batch) for one in given]
    found += [one for given in marks.end() for one in given]
    assert [one.sequence for one in found] == list(range(len(fields)))
    assert {one.damage for one in found} <= {None, REPEATED}
    return [n for n, one in enumerate(found) if one.damage == REPEATED]


# --- where something moves ---


def test_without_repeated_pictures_nothing_is_marked() -> None:
    assert marked(camera(30)) == []


def test_a_single_repeated_picture_is_marked() -> None:
    assert marked(shown(camera(20), [*range(10), 9, *range(11, 20)])) == [10]


def test_every_picture_of_a_run_is_marked() -> None:
    assert marked(shown(camera(20), [*range(10), 9, 9, 9, *range(13, 20)])) == [10, 11, 12]


def test_of_pictures_that_were_given_twice_every_second_is_marked() -> None:
    assert marked(shown(camera(15), [n // 2 for n in range(30)])) == list(range(1, 30, 2))


def test_a_picture_more_in_every_second_is_marked_where_it_was_put_in() -> None:
    order = [n - n // 25 for n in range(75)]
    assert marked(shown(camera(75), order)) == [25, 50]


def test_a_frozen_end_is_marked_from_its_first_picture() -> None:
    assert marked(shown(camera(20), [*range(20), *[19] * 15])) == list(range(20, 35))


@pytest.mark.parametrize("frozen", [30, 200])
def test_a_picture_that_stays_for_seconds_is_marked_until_its_end(frozen: int) -> None:
    held = shown(camera(200), [*range(50), *[49] * frozen, *range(150, 170)])
    assert marked(held) == list(range(50, 50 + frozen))
    assert marked(held[: 50 + frozen]) == list(range(50, 50 + frozen))


def test_of_frames_each_field_is_judged_by_its_own_parity() -> None:
    fields = [discs(moving(n), seed=n, parity=n % 2) for n in range(20)]
    assert (fields[0].parity, fields[1].parity) == (TOP, BOTTOM)
    pulled_down = [*fields[:8], fields[6], *fields[9:]]
    assert marked(pulled_down, 2) == [8]
    whole = [*fields[:8], *fields[6:8], *fields[10:]]
    assert marked(whole, 2) == [8, 9]


# --- where nothing does ---


def test_noise_at_rest_is_no_repetition() -> None:
    assert marked(camera(40, at_rest)) == []


def test_a_picture_that_repeats_one_at_rest_shows_what_was_there() -> None:
    assert marked(shown(camera(20, at_rest), [*range(10), 9, 9, *range(12, 20)])) == []


def test_a_movement_before_and_after_does_not_count_but_that_between_does() -> None:
    def pauses(n: int) -> float:
        return moving(min(n, 10)) + moving(max(n - 30, 0))

    fields = camera(40, pauses)
    assert marked(shown(fields, [*range(20), 19, 19, *range(22, 40)])) == []
    assert marked(shown(fields, [*range(31), 30, 30, *range(33, 40)])) == [31, 32]


def test_a_picture_that_is_shown_for_ever_is_still_one() -> None:
    assert marked(shown(camera(1), [0] * 120)) == []


def test_nothing_waits_longer_than_a_second() -> None:
    marks = RepeatMarks(1)
    still = shown(camera(1), [0] * 60)
    given = [
        len(list(marks.take([GrabbedField(one, n * PERIOD_NS, n, None)]))) for n, one in enumerate(still)
    ]
    assert all(sum(given[: n + 1]) >= n - 50 for n in range(60))
    assert sum(given) > 0
