"""From a field to what the ring keeps of it, by the kernel and by numpy."""

import numpy as np
import pytest

from grabberd.core.field import (
    BIT_DEPTHS,
    BOTTOM,
    TOP,
    Field,
    Packing,
    double_lines,
    map_level,
    pack,
    quantise,
)
from grabberd.core.kernel import KERNEL

WAYS = [pytest.param(None, id="numpy")] + ([pytest.param(KERNEL, id="kernel")] if KERNEL else [])
"""Without a kernel there is only numpy."""
pytestmark = pytest.mark.parametrize("kernel", WAYS)


def field(parity=TOP, seed=0, shape=(6, 21)):
    return Field.intact(np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8), parity)


@pytest.mark.parametrize("bits", BIT_DEPTHS)
@pytest.mark.parametrize("parity", [TOP, BOTTOM])
def test_intact_lines_are_quantised_as_they_are(kernel, bits, parity):
    packed = pack(field(parity), Packing(bits, doubled=False, threshold=90), kernel)
    np.testing.assert_array_equal(packed.data, quantise(field(parity), bits, 90).data)
    assert (packed.bits, packed.columns, packed.parity, packed.threshold) == (bits, 21, parity, 90)
    assert (packed.y0, packed.y_step) == (parity, 2)


@pytest.mark.parametrize("bits", BIT_DEPTHS)
@pytest.mark.parametrize("parity", [TOP, BOTTOM])
@pytest.mark.parametrize("interpolation", ["linear", "kernel3x3"])
def test_missing_lines_are_interpolated_before_the_threshold(kernel, bits, parity, interpolation):
    packed = pack(field(parity), Packing(bits, True, 90, None, interpolation), kernel)
    whole = double_lines(field(parity), interpolation)
    np.testing.assert_array_equal(packed.data, quantise(whole, bits, 90).data)
    assert (packed.rows, packed.y0, packed.y_step) == (12, 0, 1)


def test_a_doubled_field_is_not_doubled_again(kernel):
    whole = double_lines(field())
    packed = pack(whole, Packing(1, doubled=True, threshold=90), kernel)
    np.testing.assert_array_equal(packed.data, quantise(whole, 1, 90).data)
    assert (packed.rows, packed.y0, packed.y_step) == (12, 0, 1)


@pytest.mark.parametrize("doubled", [False, True])
def test_at_one_bit_every_pixel_may_have_a_threshold_of_its_own(kernel, doubled):
    whole = double_lines(field()) if doubled else field()
    by_pixel = field(seed=1, shape=whole.luma.shape).luma
    level = map_level(by_pixel)
    packed = pack(field(), Packing(1, doubled, level, by_pixel), kernel)
    np.testing.assert_array_equal(packed.data, quantise(whole, 1, by_pixel).data)
    assert packed.threshold == level


@pytest.mark.parametrize(("bits", "shape"), [(2, (6, 21)), (8, (6, 21)), (1, (12, 21)), (1, (6, 20))])
def test_a_map_for_other_bits_or_lines_is_replaced_by_its_level(kernel, bits, shape):
    by_pixel = np.full(shape, 200, np.uint8)
    packed = pack(field(), Packing(bits, False, 90, by_pixel), kernel)
    np.testing.assert_array_equal(packed.data, quantise(field(), bits, 90).data)


@pytest.mark.parametrize("bits", BIT_DEPTHS)
def test_the_packed_field_shares_no_memory_with_the_drivers_buffer(kernel, bits):
    buffer = field()
    packed = pack(buffer, Packing(bits, doubled=False, threshold=90), kernel)
    before = packed.data.copy()
    buffer.luma[:] = 255 - buffer.luma
    np.testing.assert_array_equal(packed.data, before)


@pytest.mark.parametrize("threshold", [-1, 0, 254, 255, 300])
def test_any_threshold_is_taken(kernel, threshold):
    packed = pack(field(), Packing(1, doubled=False, threshold=threshold), kernel)
    np.testing.assert_array_equal(
        packed.data, np.packbits(field().luma.astype(int) > threshold, axis=1)[None]
    )


def test_an_unknown_interpolation_is_refused(kernel):
    with pytest.raises(ValueError, match="cubic"):
        pack(field(), Packing(1, True, 90, None, "cubic"), kernel)
