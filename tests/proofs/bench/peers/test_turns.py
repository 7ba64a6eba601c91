"""The ratio of two that take turns, and its spread."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from .turns import ratio, take_turns

TIMES = st.lists(st.floats(1.0, 1e6), min_size=1, max_size=30)


def test_a_ratio_is_ours_by_the_peer_s_and_spreads_with_its_turns():
    found = ratio([10.0, 20.0, 30.0], [20.0, 20.0, 20.0])
    assert found.ratio == 1.0
    assert (found.ours_us, found.peer_us) == (20.0, 20.0)
    assert found.low == pytest.approx(0.6)
    assert found.high == pytest.approx(1.4)


def test_only_what_was_measured_in_one_turn_is_compared():
    """A machine that is three times slower in some turns is so for both."""
    slow = np.array([1.0, 3.0, 1.0, 3.0, 3.0])
    found = ratio(list(4.0 * slow), list(8.0 * slow))
    assert found.low == found.ratio == found.high == 0.5


@given(TIMES, st.floats(0.1, 10.0))
def test_units_do_not_matter_and_the_middle_lies_within_the_spread(times, factor):
    mine = ratio(times, [100.0] * len(times))
    scaled = ratio([factor * one for one in times], [factor * 100.0] * len(times))
    assert scaled.ratio == pytest.approx(mine.ratio)
    assert mine.low <= mine.ratio <= mine.high


@pytest.mark.parametrize(("ours", "peer"), [([], []), ([1.0], []), ([1.0, 2.0], [1.0])])
def test_turns_that_are_missing_are_not_made_up(ours, peer):
    with pytest.raises(ValueError, match="turns of ours beside"):
        ratio(ours, peer)


def test_all_ways_take_their_turn_first_forwards_then_backwards_after_one_to_warm_up():
    order = []
    ways = {name: lambda name=name: order.append(name) or [1.0] for name in "ab"}
    take_turns(ways, 2)
    assert "".join(order) == "ab" + "ba" + "ab"


def test_a_turn_is_the_median_of_its_fields_and_the_one_to_warm_up_is_not_kept():
    turns = iter([[900.0], [1.0, 2.0, 90.0], [4.0]])
    assert take_turns({"a": lambda: next(turns)}, 2) == {"a": [2.0, 4.0]}
