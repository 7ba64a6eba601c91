"""The compiled kernel and numpy say the same of fields of more than 1 bit."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from core.measurement.rendering import grid_of_discs
from core.measurement.test_any_picture import picture
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.kernel import KERNEL
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.location import measure_by_numpy, measure_grey, settings_for, takes_grey
from grabberd.core.measurement.locators.locator import GREY

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

SINGLE_PX = 2e-6
"""Both add products of single precision numbers, in another order."""
LINES = ("intact", "doubled", "progressive")
NARROW_PX = 3
SHARE_OF_SIGMA = 0.01
"""What shapes that are no discs leave undetermined, that is multiplied by."""


def both(packed, wanted):
    wanted = settings_for(packed, wanted)
    assert takes_grey(packed, wanted)
    expected, found = measure_by_numpy(packed, wanted), measure_grey(KERNEL, packed, wanted)
    assert len(found) == len(expected)
    for name in ("area_px", "width_px", "height_px", "at_border"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))
    return expected, found


def assert_jitter_is_same(expected, found, relative):
    assert found.common_reach_px == pytest.approx(expected.common_reach_px, rel=relative)
    if expected.line_jitter_px is None:
        assert found.line_jitter_px is None
    else:
        assert found.line_jitter_px == pytest.approx(expected.line_jitter_px, rel=relative)


@example(36779249, "noise", (40, 2), 3, "intact", 0.12, None)
@example(0, "holes", (8, 2), 8, "intact", 0.0, None)
@example(1, "blots", (2, 7), 8, "intact", 0.0, None)
@example(2, "holes", (18, 2), 6, "intact", 0.0, None)
@settings(max_examples=120, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["noise", "blots", "bars", "holes"]),
    st.tuples(st.integers(2, 40), st.integers(2, 200)),
    st.sampled_from(GREY),
    st.sampled_from(LINES),
    st.sampled_from([0.0, 0.12]),
    st.sampled_from([None, False]),
)
def test_of_any_picture(seed, kind, size, bits, lines, jitter_px, shifts):
    luma = picture(np.random.default_rng(seed), kind, *size).astype(np.uint8)
    packed = quantise(of_lines(luma, seed % 2, lines), bits, 80)
    wanted = LocationSettings(min_diameter_px=0.5, line_jitter_px=jitter_px, line_shifts=shifts)
    expected, found = both(packed, wanted)
    # Solving multiplies what rounding does to the normal equations by the variance: 9 px² if 2 px wide.
    undetermined = expected.sigma_px * np.maximum(expected.sigma_px, 1)
    # A centre outside the picture is extrapolated from a disc's rim, which multiplies rounding to single
    # precision, too; nobody measures with such a blob.
    outside = (expected.xy_px < 0).any(axis=1) | (expected.xy_px > picture_end(packed)).any(axis=1)
    share = np.where(outside & expected.at_border, 10 * SHARE_OF_SIGMA, SHARE_OF_SIGMA)[:, None]
    assert (np.abs(found.xy_px - expected.xy_px) <= share * undetermined + SINGLE_PX).all()
    assert np.allclose(found.sigma_px, expected.sigma_px, rtol=SHARE_OF_SIGMA)
    # A line of two or three pixels has no inner edge that would tell its shift: rounding decides on it.
    if packed.columns > NARROW_PX:
        assert np.allclose(found.common_px, expected.common_px, rtol=1e-3, atol=1e-4)
        assert_jitter_is_same(expected, found, 1e-3)


def of_lines(luma, parity, lines):
    if lines == "progressive":
        return Field.progressive(luma)
    field = Field.intact(luma, parity)
    return double_lines(field) if lines == "doubled" else field


def picture_end(packed):
    """The centre of the last pixel, in frame pixels."""
    return packed.columns - 1, packed.y0 + (packed.rows - 1) * packed.y_step


@pytest.mark.parametrize("bits", [2, 4, 8])
@pytest.mark.parametrize("lines", LINES)
@pytest.mark.parametrize(
    "how",
    [{}, {"line_jitter_known": True}, {"line_shifts": False}, {"line_jitter_px": 0.0}, {"noise_levels": 4.0}],
)
def test_of_a_field_of_targets(bits, lines, how):
    intact, _ = grid_of_discs(np.random.default_rng(bits), parity=bits // 4 % 2, noise=0.02, jitter_px=0.12)
    luma = double_lines(intact).luma if lines == "progressive" else intact.luma  # discs as high as wide
    packed = quantise(of_lines(luma, intact.parity, lines), bits, 90)
    expected, found = both(packed, LocationSettings(**how))
    assert len(found) > 500
    assert np.allclose(found.xy_px, expected.xy_px, rtol=0, atol=SINGLE_PX)
    assert np.allclose(found.sigma_px, expected.sigma_px, rtol=1e-5, atol=0)
    assert np.allclose(found.common_px, expected.common_px, rtol=1e-5, atol=1e-8)
    assert_jitter_is_same(expected, found, 1e-5)


def test_of_chords_that_no_disc_explains():
    field, _ = grid_of_discs(np.random.default_rng(3), noise=0.02, jitter_px=0.3)
    luma = field.luma.copy()
    luma[::9, 300:420] = np.maximum(luma[::9, 300:420], 130)
    packed = quantise(Field.intact(luma, field.parity), 8, 120)
    expected, found = both(packed, LocationSettings())
    assert np.allclose(found.xy_px, expected.xy_px, rtol=0, atol=1e-4)
    assert_jitter_is_same(expected, found, 1e-3)


@pytest.mark.parametrize("threshold", [-1, 0, 254, 255, 300])
def test_whatever_the_threshold(threshold):
    luma = np.random.default_rng(1).integers(0, 256, (20, 70)).astype(np.uint8)
    luma[luma == 7] = 255
    packed = quantise(Field.intact(luma, 0), 8, 80)
    both(type(packed)(packed.data, 8, 70, 0, 0, 2, threshold), LocationSettings("template", 0.0, 1e3))
