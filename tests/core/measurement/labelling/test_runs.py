import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.core.measurement.labelling import find_runs

pictures = hnp.arrays(np.bool_, st.tuples(st.integers(1, 8), st.integers(1, 140)))


def runs_one_by_one(picture):
    for row, pixels in enumerate(picture):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], pixels.astype(int), [0]])))
        for first, end in edges.reshape(-1, 2):
            yield row, int(first), int(end) - 1


@given(pictures)
def test_runs_are_what_one_finds_pixel_by_pixel(picture):
    runs = find_runs(np.packbits(picture, axis=1))
    found = zip(runs.row.tolist(), runs.first.tolist(), runs.last.tolist(), strict=True)
    assert list(found) == list(runs_one_by_one(picture))


def test_a_run_may_go_over_byte_borders():
    runs = find_runs(np.array([[0b00000011, 0b11111111, 0b10000000]], np.uint8))
    assert (runs.first.tolist(), runs.last.tolist()) == ([6], [16])


def test_a_run_ends_with_its_row():
    full_then_full = np.full((2, 2), 0xFF, np.uint8)
    runs = find_runs(full_then_full)
    assert (runs.row.tolist(), runs.first.tolist(), runs.last.tolist()) == ([0, 1], [0, 0], [15, 15])


def test_an_empty_picture_has_no_runs():
    assert len(find_runs(np.zeros((5, 3), np.uint8)).row) == 0
