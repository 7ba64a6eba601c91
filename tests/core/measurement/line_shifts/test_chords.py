import numpy as np
import pytest

from core.measurement.rendering import BOTTOM, TOP, grid_of_discs
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.measurement.labelling import by_component, find_runs, shapes_of, target_bits
from grabberd.core.measurement.line_jitter import binary_shares, grey_chords
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
    return grey_chords(seen_in(one, settings), 3.6)


def shares_of(one, settings=SETTINGS):
    """The shares of lines in each blob's x, and its first line."""
    seen = seen_in(one, settings)
    if one.bits > 1:
        chords = grey_chords(seen, 3.6)
        return chords.share, chords.line
    shares = binary_shares(seen)
    half_lines = seen.shapes.first_row[shares.blob] * one.y_step - one.first_delivered
    return shares.share, half_lines // 2


@pytest.mark.parametrize("way", WAYS)
def test_the_shares_of_a_blob_are_one_together(field, way):
    np.testing.assert_allclose(shares_of(packed(field, *way))[0].sum(axis=1), 1.0)


@pytest.mark.parametrize("way", WAYS)
def test_a_line_that_is_shifted_moves_the_centroid_by_its_share(field, way):
    luma = field.luma.copy()
    luma[66::12] = np.roll(luma[66::12], 1, axis=1)
    shifted = Field.intact(luma, field.parity)
    before, after = (measure(packed(one, *way), None, SETTINGS) for one in (field, shifted))
    share, first = shares_of(packed(field, *way))
    line = first[:, np.newaxis] + np.arange(share.shape[1])
    expected = (share * ((line >= 66) & (line % 12 == 6))).sum(axis=1)
    assert len(before) == len(after) == len(expected)
    assert expected.max() > 0.15
    moved = after.xy_px[:, 0] - before.xy_px[:, 0]
    if way[1]:  # an interpolated row follows the brighter of its lines, now the one and now the other
        assert moved.mean() == pytest.approx(expected.mean(), rel=0.2)
    else:
        np.testing.assert_allclose(moved, expected, atol=1e-9)


def test_chords_lie_on_the_lines_of_the_camera_whatever_the_rows_are(field):
    intact, doubled = (chords_of(packed(field, 8, way)) for way in (False, True))
    for of_intact, of_doubled in zip(intact.line, doubled.line, strict=True):
        assert abs(of_intact - of_doubled) <= 1
    rows = intact.weight > 0
    lines = intact.line[:, np.newaxis] + np.arange(rows.shape[1])
    reached = field.luma[lines[rows]].max(axis=1) > 80
    assert reached.all()


def test_blobs_that_no_target_can_make_have_no_chords(field):
    luma = np.full_like(field.luma, 20)
    luma[5:200, 50] = 255
    luma[5:8, 100:106] = 255
    share, _ = shares_of(packed(Field.intact(luma, TOP), 1, False), LocationSettings(max_diameter_px=40.0))
    assert len(share) == 1
