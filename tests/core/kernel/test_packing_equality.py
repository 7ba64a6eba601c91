"""The compiled kernel and numpy pack any field to the same bits."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from core.kernel.layouts import LAYOUTS, packed_rows, uyvy
from core.measurement.rendering import grid_of_discs
from core.measurement.test_any_picture import picture
from grabberd.core.field import BIT_DEPTHS, INTERPOLATIONS, Field, Packing, pack
from grabberd.core.kernel import KERNEL

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)


def assert_same(field, packing):
    expected, found = (pack(field, packing, kernel) for kernel in (None, KERNEL))
    np.testing.assert_array_equal(found.data, expected.data)
    assert found.data.flags.c_contiguous
    for name in ("bits", "columns", "parity", "y0", "y_step", "threshold"):
        assert getattr(found, name) == getattr(expected, name)


@example(0, "noise", (2, 1), packed_rows, 1, True, "kernel3x3", 80)
@example(1, "noise", (2, 2), uyvy, 6, True, "kernel3x3", 80)
@example(2, "noise", (3, 9), uyvy, 1, True, "linear", -1)
@settings(max_examples=400, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["noise", "blots", "bars", "holes"]),
    st.tuples(st.integers(2, 40), st.integers(1, 200)),
    st.sampled_from(LAYOUTS),
    st.sampled_from(BIT_DEPTHS),
    st.booleans(),
    st.sampled_from(INTERPOLATIONS),
    st.sampled_from([-7, 0, 80, 254, 255, 256, 999]),
)
def test_of_any_picture(seed, kind, size, layout, bits, doubled, interpolation, threshold):
    luma = picture(np.random.default_rng(seed), kind, *size).astype(np.uint8)
    field = Field.intact(layout(luma), seed % 2)
    assert_same(field, Packing(bits, doubled, threshold, None, interpolation))


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**31),
    st.tuples(st.integers(2, 20), st.integers(1, 100)),
    st.sampled_from(LAYOUTS),
    st.sampled_from(LAYOUTS),
    st.booleans(),
)
def test_with_a_threshold_for_every_pixel(seed, size, layout, of_map, doubled):
    rng = np.random.default_rng(seed)
    field = Field.intact(layout(picture(rng, "noise", *size).astype(np.uint8)), seed % 2)
    by_pixel = of_map(rng.integers(0, 256, (size[0] * (1 + doubled), size[1])).astype(np.uint8))
    assert_same(field, Packing(1, doubled, 80, by_pixel))


@pytest.mark.parametrize("parity", [0, 1])
@pytest.mark.parametrize("doubled", [False, True])
@pytest.mark.parametrize("bits", BIT_DEPTHS)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_of_a_field_of_targets(parity, doubled, bits, layout):
    intact, _ = grid_of_discs(np.random.default_rng(parity), parity=parity, noise=5, jitter_px=0.12)
    assert_same(Field.intact(layout(intact.luma), parity), Packing(bits, doubled, 90))


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_every_pair_of_grey_values_has_the_same_mean(interpolation):
    one, other = np.meshgrid(np.arange(256, dtype=np.uint8), np.arange(256, dtype=np.uint8))
    pairs = np.stack([one.reshape(16, 4096), other.reshape(16, 4096)], axis=1).reshape(32, 4096)
    assert_same(Field.intact(pairs, 0), Packing(8, True, 0, None, interpolation))
