"""The compiled kernel and numpy say the same, of simulated fields and of any picture."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from core.measurement.rendering import grid_of_discs
from core.measurement.test_any_picture import picture
from grabberd.core.field import Field, double_lines, quantise
from grabberd.core.kernel import ANY_NOISE, KERNEL, NO_TABLE
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.location import (
    ROOM,
    known_of,
    measure_by_numpy,
    measure_compiled,
    settings_for,
    takes,
)

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

ROUNDED_PX = 5e-6
"""numpy adds log likelihoods as single precision numbers, in another order."""
METHODS = ("automatic", "locale", "centroid")


def assert_same(packed, wanted):
    assert takes(packed, wanted)
    expected, found = measure_by_numpy(packed, wanted), measure_compiled(KERNEL, packed, wanted)
    assert len(found) == len(expected)
    for name in ("area_px", "width_px", "height_px", "at_border"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))
    tolerance = 1e-12 if wanted.method == "centroid" else ROUNDED_PX
    assert np.allclose(found.xy_px, expected.xy_px, rtol=0, atol=tolerance)
    assert np.allclose(found.sigma_px, expected.sigma_px, rtol=0, atol=4 * tolerance)
    assert np.allclose(found.common_px, expected.common_px, rtol=1e-12, atol=0)
    assert found.common_reach_px == pytest.approx(expected.common_reach_px, rel=1e-12)
    assert found.line_jitter_px is None


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(["noise", "blots", "bars", "holes"]),
    st.tuples(st.integers(2, 40), st.integers(2, 200)),
    st.sampled_from(["intact", "doubled", "progressive"]),
    st.sampled_from([0.0, 0.12]),
)
# A blob whose place is sure, and lies at the edge of those searched:
@example(45, "blots", (25, 25), "intact", 0.12)
def test_of_any_picture(method, seed, kind, size, lines, jitter_px):
    luma = picture(np.random.default_rng(seed), kind, *size).astype(np.uint8)
    field = Field.progressive(luma) if lines == "progressive" else Field.intact(luma, seed % 2)
    packed = quantise(double_lines(field) if lines == "doubled" else field, 1, 80)
    wanted = LocationSettings(method, min_diameter_px=0.5, line_jitter_px=jitter_px)
    assert_same(packed, settings_for(packed, wanted))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("parity", [0, 1])
@pytest.mark.parametrize("doubled", [False, True])
def test_of_a_field_of_targets(method, parity, doubled):
    intact, _ = grid_of_discs(np.random.default_rng(parity), parity=parity, noise=5, jitter_px=0.12)
    field = double_lines(intact) if doubled else intact
    assert_same(quantise(field, 1, 90), LocationSettings(method))


def test_a_field_of_more_blobs_than_the_first_call_has_room_for_is_located_once_from_then_on():
    dots = np.zeros((64, 640), np.uint8)
    dots[2::4, 2::8] = 200
    packed, wanted = quantise(Field.intact(dots, 0), 1, 80), LocationSettings("centroid", min_diameter_px=0.7)
    asked = []

    class Counting:
        def locate(self, *arguments):
            asked.append(arguments[-1].size)
            return KERNEL.locate(*arguments)

    first, second = (measure_compiled(Counting(), packed, wanted) for _ in range(2))
    assert len(first) == len(second) > ROOM
    assert len(asked) == 3


def test_a_field_needs_the_tables_of_all_noises_for_its_most_frequent_size_alone():
    intact, _ = grid_of_discs(np.random.default_rng(5), noise=5, jitter_px=0.12)
    packed, wanted = quantise(double_lines(intact), 1, 90), LocationSettings("locale", max_diameter_px=14.5)
    assert_same(packed, wanted)
    noises = sorted(len(one.made) for one in known_of(wanted, packed.y_step).kept.tables)
    assert len(noises) > 3
    assert noises == [1] * (len(noises) - 1) + [3]


def test_a_table_that_lacks_a_noise_is_completed():
    wanted = LocationSettings("locale", max_diameter_px=14.25)
    kept = known_of(wanted, 1).kept
    for noise in (1, 0, ANY_NOISE):
        kept = known_of(wanted, 1).completed(kept, NO_TABLE, (7.0, 14.0, 0.5, float(noise)))
    (table,) = kept.tables
    assert set(table.made) == {0, 1, 2}
    addresses = [table.made[noise].windows.ctypes.data for noise in range(3)]
    assert list(table.values) == addresses
