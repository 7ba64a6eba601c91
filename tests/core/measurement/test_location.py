from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from core.measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs
from grabberd.core.field import BIT_DEPTHS, Field, double_lines, quantise, split_frame, unpack
from grabberd.core.measurement import LocationSettings, measure

SETTINGS = LocationSettings(method="centroid")
EVERYTHING = LocationSettings(method="centroid", min_diameter_px=0.0, max_diameter_px=1e4, line_jitter_px=0.0)


@pytest.fixture(scope="module")
def scene():
    return grid_of_discs(np.random.default_rng(2), diameter_px=5.6, spread_px=0.8, noise=0.02)


def packed_squares(*squares, rows=24, columns=40, parity=TOP, bits=1):
    """A field with 200 inside (row, column, height, width) and 20 elsewhere."""
    luma = np.full((rows, columns), 20, np.uint8)
    for row, column, height, width in squares:
        luma[row : row + height, column : column + width] = 200
    return quantise(Field.intact(luma, parity), bits, 100)


@pytest.mark.parametrize("bits", BIT_DEPTHS)
@pytest.mark.parametrize(("parity", "first_line"), [(TOP, 8), (BOTTOM, 9)])
def test_the_centre_of_a_square_is_in_frame_pixels_at_any_bit_depth(bits, parity, first_line):
    blobs = measure(packed_squares((4, 10, 3, 5), parity=parity, bits=bits), None, SETTINGS)
    assert blobs.xy_px.tolist() == [[12.0, first_line + 2.0]]
    assert (blobs.width_px[0], blobs.height_px[0], blobs.area_px[0]) == (5.0, 6.0, 30.0)
    assert blobs.sigma_px.shape == (1, 2)


@pytest.mark.parametrize(("bits", "doubled", "limit_px"), [(1, False, 0.3), (1, True, 0.2), (8, False, 0.08)])
def test_every_disc_is_found_at_its_place(scene, bits, doubled, limit_px):
    field, places = scene
    packed = quantise(double_lines(field) if doubled else field, bits, 90 if bits == 1 else 53)
    blobs = measure(packed, None, SETTINGS)
    error, blob = errors_px(blobs, places)
    assert len(blobs) == len(places) == len(np.unique(blob))
    assert np.sqrt((error**2).mean(axis=0)).max() < limit_px
    assert np.abs(error.mean(axis=0)).max() < 0.02


def test_grey_is_several_times_better_than_one_bit(scene):
    field, places = scene
    rms = [
        np.sqrt((errors_px(measure(quantise(field, bits, 60), None, SETTINGS), places)[0] ** 2).mean())
        for bits in (1, 8)
    ]
    assert rms[0] > 3 * rms[1]


def test_top_and_bottom_field_of_a_frame_agree_on_where_a_target_is():
    y, x = np.mgrid[:64, :64]
    frame = (200 * np.exp(-((x - 30.3) ** 2 + (y - 33.7) ** 2) / 12)).astype(np.uint8)
    for field in split_frame(frame):
        blobs = measure(quantise(field, 8, 20), None, SETTINGS)
        np.testing.assert_allclose(blobs.xy_px, [[30.3, 33.7]], atol=0.05)


@given(hnp.arrays(np.uint8, st.tuples(st.integers(2, 12), st.integers(1, 30))), st.sampled_from(BIT_DEPTHS))
def test_centres_are_the_moments_of_the_unpacked_field(luma, bits):
    packed = quantise(Field.intact(luma, TOP), bits, 130)
    grey = unpack(packed).luma.astype(float)
    weight = np.where(grey > 130, 1.0 if bits == 1 else grey - 130, 0.0)
    blobs = measure(packed, None, EVERYTHING)
    assert blobs.area_px.sum() == 2 * np.count_nonzero(weight)
    if len(blobs) == 1:
        y, x = np.indices(luma.shape)
        moments = [(weight * x).sum() / weight.sum(), 2 * (weight * y).sum() / weight.sum()]
        np.testing.assert_allclose(blobs.xy_px[0], moments, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_an_empty_field_has_no_blobs(bits):
    blobs = measure(packed_squares(bits=bits), None, SETTINGS)
    assert len(blobs) == 0
    assert blobs.xy_px.shape == blobs.sigma_px.shape == (0, 2)
    assert blobs.at_border.dtype == np.bool_


def test_blobs_come_in_the_order_of_their_first_row_then_column():
    blobs = measure(packed_squares((9, 3, 3, 5), (2, 30, 3, 5), (2, 12, 3, 5)), None, SETTINGS)
    assert blobs.xy_px.tolist() == [[14.0, 6.0], [32.0, 6.0], [5.0, 20.0]]


@pytest.mark.parametrize("square", [(0, 10, 3, 5), (21, 10, 3, 5), (8, 0, 3, 5), (8, 35, 3, 5)])
@pytest.mark.parametrize("bits", [1, 8])
def test_a_blob_at_an_edge_says_that_it_is_cut_off(square, bits):
    blobs = measure(packed_squares(square, (10, 18, 3, 5), bits=bits), None, SETTINGS)
    assert sorted(blobs.at_border.tolist()) == [False, True]


def test_a_blob_in_the_last_column_of_a_width_that_fills_no_byte_is_at_the_border():
    assert measure(packed_squares((8, 32, 3, 5), columns=37), None, SETTINGS).at_border.tolist() == [True]


def test_blobs_too_small_or_too_large_for_a_target_are_left_out():
    packed = packed_squares((2, 2, 1, 1), (6, 10, 3, 5), (12, 2, 11, 30))
    assert measure(packed, None, SETTINGS).xy_px.tolist() == [[12.0, 14.0]]
    assert len(measure(packed, None, EVERYTHING)) == 3


def test_a_window_keeps_the_blobs_whose_centre_it_holds_edges_included(scene):
    packed = packed_squares((4, 10, 3, 5), (12, 20, 3, 5))
    on_its_corner = np.array([[12.0, 10.0, 13.0, 11.0]])
    assert measure(packed, on_its_corner, SETTINGS).xy_px.tolist() == [[12.0, 10.0]]
    assert len(measure(packed, np.array([[12.1, 10.0, 19.0, 11.0]]), SETTINGS)) == 0


@settings(max_examples=25)
@given(
    hnp.arrays(
        np.float64, st.tuples(st.integers(0, 6), st.just(4)), elements=st.floats(0, 720, allow_nan=False)
    )
)
def test_windows_select_from_what_is_measured_without_them(scene, windows):
    packed = quantise(scene[0], 1, 90)
    whole = measure(packed, None, SETTINGS)
    x, y = whole.xy_px.T
    inside = np.zeros(len(whole), bool)
    for x0, y0, x1, y1 in windows:
        inside |= (x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1)
    expected, found = whole.select(inside), measure(packed, windows, SETTINGS)
    for column in fields(found):
        np.testing.assert_array_equal(getattr(found, column.name), getattr(expected, column.name))


def test_the_same_field_gives_the_same_blobs_bit_for_bit(scene):
    packed = quantise(scene[0], 8, 53)
    again = replace(packed, data=packed.data.copy())
    one, other = measure(packed, None, SETTINGS), measure(again, None, SETTINGS)
    assert one.xy_px.tobytes() == other.xy_px.tobytes()
    assert one.sigma_px.tobytes() == other.sigma_px.tobytes()


def test_noise_that_is_known_takes_the_place_of_the_estimate(scene):
    packed = quantise(scene[0], 8, 53)
    quiet, loud = (
        measure(packed, None, LocationSettings(method="centroid", noise_levels=levels))
        for levels in (3.6, 36.0)
    )
    estimated = measure(packed, None, SETTINGS)
    np.testing.assert_allclose(estimated.sigma_px, quiet.sigma_px, rtol=0.05)
    assert (loud.sigma_px > 2 * quiet.sigma_px).all()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ({"method": "guess"}, "unknown method 'guess'; choose from automatic, "),
        ({"min_diameter_px": 5.0, "max_diameter_px": 5.0}, "no blob can meet"),
        ({"min_diameter_px": -1.0}, "no blob can meet"),
    ],
)
def test_settings_that_make_no_sense_are_refused(arguments, complaint):
    with pytest.raises(ValueError, match=complaint):
        LocationSettings(**arguments)
