"""What a look at every field of a live stream finds, all checks together."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.instrument.acquisition.content_check import Content, ContentCheck
from instrument.acquisition.pictures import (
    AS_IT_IS,
    camera,
    damages,
    grabbed,
    looked_at,
    noise,
    without_a_packet,
)

GOOD = Content()
FLAT = np.full((288, 720), 41, np.uint8)


def replaced(lumas, n, luma):
    return [*lumas[:n], luma, *lumas[n + 1 :]]


@pytest.fixture(scope="module")
def liner():
    return list(camera(40))


def test_a_pulsating_liner_is_a_good_picture(liner):
    assert looked_at(liner) == [GOOD] * len(liner)


@pytest.mark.parametrize("layout", ["woven", "every other byte"])
def test_the_layout_of_the_drivers_buffer_does_not_matter(liner, layout):
    buffer = np.zeros((576, 1440), np.uint8)
    check, found = ContentCheck(), []
    for n, luma in enumerate(replaced(liner, 20, without_a_packet(liner[20], 150, 40))):
        view = buffer[n % 2 :: 2, :720] if layout == "woven" else buffer[n % 2 :: 2, ::2]
        view[:] = luma
        found.append(check.take(grabbed(view, n), AS_IT_IS)[0].damage is not None)
        buffer[:] = 0
    assert [n for n, damaged in enumerate(found) if damaged] == [20]


def test_lost_data_and_the_old_rows_that_they_leave_are_both_told(liner):
    damaged = without_a_packet(liner[20], 150, 1536)
    damaged[285:] = liner[4][285:]
    damage = damages(replaced(liner, 20, damaged))[20]
    assert damage.startswith("shifted by -96 px from line 3")
    assert damage.endswith(", stale from line 570")


def test_a_damaged_field_is_no_measure_for_the_next(liner):
    damaged = without_a_packet(liner[20], 150, 40)
    assert [damage is not None for damage in damages(replaced(liner, 20, damaged))].count(True) == 1


@pytest.mark.parametrize("before", ["the damaged one", "the good one"])
def test_a_short_field_after_a_damaged_one_is_damaged_as_well(liner, before):
    damaged = without_a_packet(liner[20], 150, 40)
    short = liner[21].copy()
    short[144:] = (damaged if before == "the damaged one" else liner[19])[144:]
    found = damages([*liner[:20], damaged, short, *liner[22:]])
    assert [n for n, damage in enumerate(found) if damage] == [20, 21]


@pytest.mark.parametrize("count", [1, 2, 4, 7, 12])
def test_shifted_fields_in_a_row_accuse_none_of_their_neighbours(liner, count):
    shifted = [without_a_packet(luma, 150, 40) for luma in liner[20 : 20 + count]]
    found = [damage is not None for damage in damages([*liner[:20], *shifted, *liner[20 + count :]])]
    assert found == [False] * 20 + [True] * count + [False] * (20 - count)


def test_a_shift_that_stays_is_the_picture_after_half_a_second():
    moving = list(camera(60))
    shifted = [without_a_packet(luma, 150, 40) for luma in moving[20:]]
    found = [damage is not None for damage in damages([*moving[:20], *shifted])]
    assert found == [False] * 20 + [True] * 25 + [False] * 15


@pytest.mark.parametrize(("rate_hz", "fields"), [(25, 12), (120, 60)])
def test_half_a_second_is_as_many_fields_as_come_in_it(rate_hz, fields):
    moving = list(camera(20 + fields + 10))
    shifted = [*moving[:20], *(without_a_packet(luma, 150, 40) for luma in moving[20:])]
    check, found = ContentCheck(rate_hz=rate_hz), []
    for n, luma in enumerate(shifted):
        one = grabbed(luma, n)._replace(time_ns=1_000_000_000 + round(n * 1e9 / rate_hz))
        found.append(check.take(one, AS_IT_IS)[0].damage is not None)
    assert found == [False] * 20 + [True] * fields + [False] * 10


@pytest.mark.parametrize(("rate_hz", "fields"), [(25, 2), (60, 6), (120, 12)])
def test_a_tenth_of_a_second_without_a_picture_is_a_stream_without_one(rate_hz, fields):
    check = ContentCheck(rate_hz=rate_hz)
    for n in range(fields):
        assert check.no_picture is None
        check.take(grabbed(FLAT, n), AS_IT_IS)
    assert check.no_picture is not None


def test_without_a_picture_nothing_is_said_to_be_repeated():
    assert [content.damage for content in looked_at([FLAT] * 3)] == [None] * 3


def test_no_picture_is_the_streams_state_only_after_a_tenth_of_a_second(liner):
    check = ContentCheck()
    state = []
    for n, luma in enumerate([*liner[:2], *[FLAT] * 6, liner[8]]):
        check.take(grabbed(luma, n), AS_IT_IS)
        state.append(check.no_picture is not None)
    assert state == [False] * 6 + [True] * 2 + [False]


def test_fields_of_another_size_begin_anew():
    check = ContentCheck()
    assert check.take(grabbed(noise(1), 0), AS_IT_IS)[0] == GOOD
    assert check.take(grabbed(noise(1)[:240, :640], 1), AS_IT_IS)[0] == GOOD
    assert check.take(grabbed(noise(1)[:240, :640], 2), AS_IT_IS)[0].damage == "repeated"


@settings(max_examples=60)
@given(
    shape=st.tuples(st.integers(1, 30), st.integers(1, 30)),
    values=st.lists(st.integers(0, 255), min_size=1, max_size=4),
    seed=st.integers(0, 99),
)
def test_any_picture_of_any_size_can_be_looked_at(shape, values, seed):
    random = np.random.default_rng(seed)
    for content in looked_at([random.choice(values, shape).astype(np.uint8) for _ in range(4)]):
        assert content.no_picture is None or content.damage is None


def test_a_field_that_the_driver_calls_damaged_is_no_reference_for_those_after_it():
    fields = camera(12)
    check, found = ContentCheck(), []
    for n, luma in enumerate(fields):
        seen = without_a_packet(luma, 144, 374) if n == 6 else luma
        one = grabbed(seen, n)._replace(damage="short" if n == 6 else None)
        found.append(check.take(one, AS_IT_IS)[0].damage)
    assert found == [None] * 12
