import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from grabberd.core.measurement.labelling import by_component, find_runs, label_runs

SHAPES = {
    "U": ["#...#", "#...#", "#####"],
    "arch": ["#####", "#...#", "#...#"],
    "ring": [".###.", "#...#", "#...#", ".###."],
    "comb, teeth up": ["#.#.#.#.#", "#.#.#.#.#", "#########"],
    "comb, teeth down": ["#########", "#.#.#.#.#"],
    "comb of unequal teeth": ["........#", "......#.#", "....#.#.#", "..#.#.#.#", "#########"],
    "W": ["#...#...#", ".#.#.#.#.", "..#...#.."],
    "diagonal": ["#...", ".#..", "..#.", "...#"],
    "spiral": ["#######", "#.....#", "#.###.#", "#.#...#", "#.#####"],
}


def label_picture(picture):
    """Each pixel's component, 0 for none, as an image."""
    runs = find_runs(np.packbits(picture, axis=1))
    label, count = label_runs(runs)
    image = np.zeros(picture.shape, int)
    for row, first, last, own in zip(*runs, label, strict=True):
        image[row, first : last + 1] = own + 1
    return image, count


def same_partition(one, other):
    pairs = np.unique(np.stack([one.ravel(), other.ravel()]), axis=1)
    return len(np.unique(pairs[0])) == pairs.shape[1] == len(np.unique(pairs[1]))


def agrees_with_opencv(picture):
    image, count = label_picture(picture)
    expected_count, expected = cv2.connectedComponents(picture.astype(np.uint8), connectivity=8)
    return count == expected_count - 1 and same_partition(image, expected)


@settings(max_examples=300)
@given(hnp.arrays(np.bool_, st.tuples(st.integers(1, 14), st.integers(1, 34))))
def test_components_are_those_of_opencv_for_any_picture(picture):
    assert agrees_with_opencv(picture)


@pytest.mark.parametrize("density", [0.05, 0.3, 0.45, 0.6, 0.9])
@pytest.mark.parametrize("columns", [64, 67, 720])
def test_components_are_those_of_opencv_for_large_random_pictures(density, columns):
    picture = np.random.default_rng(columns).random((150, columns)) < density
    assert agrees_with_opencv(picture)


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_that_folds_back_is_one_component(name):
    picture = np.array([[pixel == "#" for pixel in line] for line in SHAPES[name]])
    image, count = label_picture(picture)
    assert count == 1
    np.testing.assert_array_equal(image, picture)


def test_the_last_column_does_not_touch_the_first_of_a_later_row():
    picture = np.zeros((4, 16), bool)
    picture[0, 15] = picture[1, 0] = picture[2, 15] = picture[3, 0] = True
    assert label_picture(picture)[1] == 4


def test_components_are_numbered_in_the_order_of_their_first_row_and_column():
    picture = np.array([[0, 0, 0, 1, 1], [1, 0, 0, 0, 0], [1, 0, 1, 0, 1]], bool)
    image, count = label_picture(picture)
    assert count == 4
    np.testing.assert_array_equal(image, [[0, 0, 0, 1, 1], [2, 0, 0, 0, 0], [2, 0, 3, 0, 4]])


def test_nothing_set_means_no_component():
    assert label_picture(np.zeros((3, 9), bool))[1] == 0


@pytest.mark.parametrize("name", SHAPES)
def test_runs_by_component_keep_their_order_within_each(name):
    picture = np.array([[pixel == "#" for pixel in row] for row in SHAPES[name]] * 2)
    runs = find_runs(np.packbits(picture, axis=1))
    label, count = label_runs(runs)
    ordered, own, same = by_component(runs)
    expected = sorted(zip(label.tolist(), *(one.tolist() for one in runs), strict=True))
    assert [tuple(map(int, one)) for one in zip(own, *ordered, strict=True)] == expected
    assert same == count


def test_an_empty_picture_has_no_component():
    runs, label, count = by_component(find_runs(np.zeros((4, 3), np.uint8)))
    assert (len(runs.row), len(label), count) == (0, 0, 0)
