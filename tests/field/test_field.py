import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.field import BOTTOM, TOP, Field, split_frame

frames = hnp.arrays(np.uint8, st.tuples(st.integers(1, 12).map(lambda n: 2 * n), st.integers(1, 40)))


@given(frames, st.sampled_from([TOP, BOTTOM]))
def test_the_fields_of_a_frame_weave_into_it_again(frame, older):
    woven = np.zeros_like(frame)
    for field in split_frame(frame, older):
        lines = field.y0 + field.y_step * np.arange(field.rows)
        woven[lines] = field.luma
    np.testing.assert_array_equal(woven, frame)


@pytest.mark.parametrize("older", [TOP, BOTTOM])
def test_the_older_field_comes_first(older):
    first, second = split_frame(np.zeros((4, 3), np.uint8), older)
    assert (first.parity, second.parity) == (older, 1 - older)


def test_fields_are_views_into_the_frame():
    frame = np.zeros((4, 3), np.uint8)
    top, bottom = split_frame(frame)
    frame[1, 2] = 9
    assert np.shares_memory(top.luma, frame)
    assert bottom.luma[0, 2] == 9


@pytest.mark.parametrize("parity", [TOP, BOTTOM])
def test_an_intact_field_says_on_which_frame_lines_its_rows_are(parity):
    field = Field.intact(np.zeros((5, 7), np.uint8), parity)
    assert (field.y0, field.y_step) == (parity, 2)
    assert (field.rows, field.columns) == (5, 7)
