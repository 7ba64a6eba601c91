"""Whatever a field shows, every locator gives places, or says that it is not meant for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.core.field import BIT_DEPTHS, Field, double_lines, quantise
from grabberd.core.measurement import METHODS, LocationSettings, measure
from grabberd.errors import InputError


def picture(rng, kind, rows, columns):
    """Noise, blots, bars, or a bright picture with holes."""
    luma = rng.integers(0, 60, (rows, columns))
    if kind == "noise":
        return rng.integers(0, 256, (rows, columns))
    if kind == "bars":
        luma[:, rng.integers(0, columns, 4)] = 255
        luma[rng.integers(0, rows, 4)] = 255
        return luma
    for row, column in rng.integers(0, (rows, columns), (12, 2)):
        luma[row : row + rng.integers(1, 6), column : column + rng.integers(1, 9)] = rng.integers(100, 256)
    return 255 - luma if kind == "holes" else luma


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=25)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["noise", "blots", "bars", "holes"]),
    st.tuples(st.integers(2, 40), st.integers(2, 60)),
    st.sampled_from(BIT_DEPTHS),
    st.booleans(),
)
def test_places_are_numbers_and_known_to_some_accuracy(method, seed, kind, size, bits, doubled):
    luma = picture(np.random.default_rng(seed), kind, *size).astype(np.uint8)
    field = Field.intact(luma, seed % 2)
    packed = quantise(double_lines(field) if doubled else field, bits, 80)
    try:
        blobs = measure(packed, None, LocationSettings(method=method, min_diameter_px=0.5))
    except InputError:
        return
    assert np.isfinite(blobs.xy_px).all()
    assert (np.isfinite(blobs.sigma_px) & (blobs.sigma_px > 0)).all()
    assert (np.isfinite(blobs.common_px) & (blobs.common_px >= 0)).all()
    assert blobs.common_reach_px > 0
