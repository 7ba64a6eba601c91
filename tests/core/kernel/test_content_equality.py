"""The compiled kernel and numpy find the same in any stream, and remember the same of it."""

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from core.kernel.layouts import LAYOUTS, yuyv
from core.measurement.test_any_picture import picture
from grabberd.core.field import Packing
from grabberd.core.kernel import KERNEL
from grabberd.instrument.acquisition.content_check import ContentCheck
from grabberd.instrument.acquisition.shifted_rows import coarse_shift, profiles, profiles_shape
from instrument.acquisition.pictures import camera, grabbed, noise, without_a_packet

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

DOUBLED = Packing(1, doubled=True, threshold=80)
FIELD = Packing(4, doubled=False, threshold=80)
BARS = np.tile(np.repeat(np.array([235, 210, 170, 145, 106, 81, 41, 16], np.uint8), 90), (288, 1))


def assert_same(lumas, layout=yuyv, packing=DOUBLED):
    """Of a stream; returns what is found."""
    checks = ContentCheck(None), ContentCheck(KERNEL)
    contents = []
    for n, luma in enumerate(lumas):
        both = [check.take(grabbed(layout(luma), n), packing) for check in checks]
        (expected, by_numpy), (found, by_kernel) = both
        assert found == expected
        np.testing.assert_array_equal(by_kernel.data, by_numpy.data)
        memories = [check._stale.memory for check in checks]
        np.testing.assert_array_equal(memories[1], memories[0])
        assert checks[0].no_picture == checks[1].no_picture
        contents.append(found)
    return contents


@pytest.fixture(scope="module")
def liner():
    return list(camera(30))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_of_a_pulsating_liner(liner, layout):
    assert set(assert_same(liner, layout)) == {(None, None)}


def test_of_fields_with_lost_data_and_old_rows(liner):
    spoiled = [luma.copy() for luma in liner]
    for n, row, columns in ((10, 150, 40), (14, 60, 345), (15, 60, 345), (22, 240, 8)):
        spoiled[n] = without_a_packet(spoiled[n], row, columns)
    spoiled[18][200:] = liner[16][200:]
    spoiled[24][100:110] = liner[22][100:110]
    spoiled[26] = spoiled[24]
    told = [content.damage for content in assert_same(spoiled)]
    assert sum("shifted" in (one or "") for one in told) == 4
    assert sum("stale" in (one or "") for one in told) == 2
    assert told[26] == "repeated"


def test_of_clipped_black(liner):
    assert_same([cv2.subtract(luma, 45) for luma in liner])


@pytest.mark.parametrize("value", [0, 41, 255])
def test_of_what_a_chip_draws(liner, value):
    blue = np.full((288, 720), value, np.uint8)
    edged, lying = blue.copy(), np.repeat(BARS[0][:288, np.newaxis], 720, axis=1)
    edged[:3] = edged[-2:] = 16
    speck = blue.copy()
    speck[100, 300] = 7
    snow = np.random.default_rng(1).integers(0, 256, (288, 720), np.uint8)
    kinds = [one.no_picture for one in assert_same([blue, edged, BARS, lying, snow, speck, *liner[:3], blue])]
    assert [kind is not None for kind in kinds] == [True] * 5 + [False] * 4 + [True]


@pytest.mark.parametrize("contrast", range(80, 96))
def test_of_noise_that_is_nearly_snow(contrast):
    """Grey values of 25 σ are where it begins: 87 wide if all are equally likely."""
    assert_same([noise(seed, 128 - contrast // 2, 128 + contrast // 2) for seed in range(2)])


@example(0, "noise", (1, 1), yuyv, 3)
@example(1, "noise", (25, 3), yuyv, 3)
@example(2, "blots", (24, 12), yuyv, 3)
@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["noise", "blots", "bars", "holes"]),
    st.tuples(st.integers(1, 80), st.integers(1, 120)),
    st.sampled_from(LAYOUTS),
    st.integers(1, 4),
)
def test_of_any_stream(seed, kind, size, layout, kept):
    """Fields come again, whole or in part, shifted or not."""
    rng = np.random.default_rng(seed)
    fields = [picture(rng, kind, *size).astype(np.uint8) for _ in range(kept)]
    lumas = []
    for _ in range(14):
        luma = fields[rng.integers(kept)].copy()
        first = rng.integers(size[0])
        how = rng.integers(4)
        if how == 1:
            luma[first:] = np.roll(luma[first:], rng.integers(size[1]), axis=1)
        elif how == 2:
            luma[first:] = fields[rng.integers(kept)][first:]
        elif how == 3:
            luma[first:] += rng.integers(0, 3, luma[first:].shape).astype(np.uint8)
        lumas.append(luma)
    assert_same(lumas, layout, FIELD)


@settings(max_examples=300, deadline=None)
@given(
    st.integers(0, 2**31),
    st.tuples(st.integers(24, 120), st.integers(4, 120)),
    st.integers(0, 120),
    st.integers(0, 60),
    st.sampled_from([1, 8, 60]),
)
def test_of_where_rows_may_be_shifted(seed, size, row, columns, noise_levels):
    rng = np.random.default_rng(seed)
    before = picture(rng, "blots", *size).astype(np.uint8)
    now = np.clip(before + rng.integers(0, noise_levels, size), 0, 255).astype(np.uint8)
    now[row:] = np.roll(now[row:], columns, axis=1)
    means = [np.zeros(profiles_shape(*size), np.int16) for _ in range(2)]
    for luma, out in zip((now, before), means, strict=True):
        profiles(luma, out)
    assert KERNEL.shifted(*means, *means[0].shape) == (coarse_shift(*means) or (-1, 0))
