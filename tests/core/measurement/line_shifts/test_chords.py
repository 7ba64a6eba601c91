import numpy as np
import pytest

from core.measurement.rendering import BOTTOM, TOP, grid_of_discs
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.measurement.labelling import by_component, find_runs, shapes_of, target_bits
from grabberd.core.measurement.line_jitter import binary_chords, binary_shares, grey_chords
from grabberd.core.measurement.locators.locator import Seen

SETTINGS = LocationSettings(method="centroid", line_jitter_px=0.0)
WAYS = [(1, False), (1, True), (8, False)]


@pytest.fixture(scope="module", params=[TOP, BOTTOM], ids=["top", "bottom"])
def field(request):
    return grid_of_discs(np.random.default_rng(5), diameter_px=6.0, parity=request.param)[0]


def packed(field, bits, doubled):
    return quantise(double_lines(field) if doubled else field, bits, 80)


def seen_in(one, settings=SETTINGS):
    components = by_component(find_runs(target_bits(one)))
    return Seen(one, *components[:2], shapes_of(*components), settings)


def chords_of(one, settings=SETTINGS):
    seen = seen_in(one, settings)
    return binary_chords(seen) if one.bits == 1 else grey_chords(seen, 3.6)


@pytest.mark.parametrize("way", WAYS)
def test_the_shares_of_a_blob_are_one_together(field, way):
    np.testing.assert_allclose(chords_of(packed(field, *way)).share.sum(axis=1), 1.0)


@pytest.mark.parametrize("way", WAYS)
def test_a_line_that_is_shifted_moves_the_centroid_by_its_share(field, way):
    luma = field.luma.copy()
    luma[66::12] = np.roll(luma[66::12], 1, axis=1)
    shifted = Field.intact(luma, field.parity)
    before, after = (measure(packed(one, *way), None, SETTINGS) for one in (field, shifted))
    chords = chords_of(packed(field, *way))
    line = chords.line[:, np.newaxis] + np.arange(chords.share.shape[1])
    expected = (chords.share * ((line >= 66) & (line % 12 == 6))).sum(axis=1)
    assert len(before) == len(after) == len(expected)
    assert expected.max() > 0.15
    moved = after.xy_px[:, 0] - before.xy_px[:, 0]
    if way[1]:  # an interpolated row follows the brighter of its lines, now the one and now the other
        assert moved.mean() == pytest.approx(expected.mean(), rel=0.2)
    else:
        np.testing.assert_allclose(moved, expected, atol=1e-9)


@pytest.mark.parametrize("bits", [1, 8])
def test_chords_lie_on_the_lines_of_the_camera_whatever_the_rows_are(field, bits):
    intact, doubled = (chords_of(packed(field, bits, way)) for way in (False, True))
    for of_intact, of_doubled in zip(intact.line, doubled.line, strict=True):
        assert abs(of_intact - of_doubled) <= 1
    rows = intact.weight > 0
    lines = intact.line[:, np.newaxis] + np.arange(rows.shape[1])
    reached = field.luma[lines[rows]].max(axis=1) > 80
    assert reached.all()


def test_a_chord_of_one_bit_is_as_uncertain_as_the_rounding_of_its_ends(field):
    weight = chords_of(packed(field, 1, False)).weight
    np.testing.assert_allclose(weight[weight > 0] ** -0.5, 0.204, atol=0.001)


def test_blobs_that_no_target_can_make_have_no_chords(field):
    luma = np.full_like(field.luma, 20)
    luma[5:200, 50] = 255
    luma[5:8, 100:106] = 255
    chords = chords_of(packed(Field.intact(luma, TOP), 1, False), LocationSettings(max_diameter_px=40.0))
    assert len(chords.blob) == 1


@pytest.mark.parametrize("doubled", [False, True])
def test_shares_alone_are_those_of_the_chords(field, doubled):
    for settings in (SETTINGS, LocationSettings(max_diameter_px=6.5), LocationSettings(max_diameter_px=2.6)):
        seen = seen_in(packed(field, 1, doubled), settings)
        shares, chords = binary_shares(seen), binary_chords(seen)
        np.testing.assert_array_equal(shares.blob, chords.blob)
        np.testing.assert_array_equal(shares.share, chords.share)
