"""What is rounded on its way into a capture is far below its σ, and rounded by itself."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from archive.captures import computed_points
from grabberd.archive.capture.encodings import factors, product, quantised, symmetric

ARRAYS = ("target", "xyz_mm", "covariance_mm2", "calibration_covariance_mm2", "image_px", "residual_px")


def same(one, other):
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in ARRAYS)


def with_values(points, **values):
    given = {field.name: getattr(points, field.name) for field in fields(points)}
    return type(points)(**{**given, **values})


def long_and_thin(seed, stretch):
    """(50, 3, 3) covariances whose axes differ by up to `stretch` in σ."""
    rng = np.random.default_rng(seed)
    axes, _ = np.linalg.qr(rng.normal(size=(50, 3, 3)))
    sigma = 10.0 ** rng.uniform(-np.log10(stretch), 0, (50, 3))
    return (axes * (0.05 * sigma[:, None, :]) ** 2) @ axes.swapaxes(1, 2)


def test_positions_and_image_coordinates_move_by_half_a_quantum_at_most():
    one = computed_points(1, 108)
    kept = quantised(one)
    assert np.abs(kept.xyz_mm - one.xyz_mm).max() <= 0.5e-4 * (1 + 1e-9)
    assert np.abs(kept.image_px - one.image_px).max() <= 0.5e-3 * (1 + 1e-9)
    assert np.abs(kept.residual_px - one.residual_px).max() <= 0.5e-3 * (1 + 1e-9)


@pytest.mark.parametrize("stretch", [1.0, 30.0, 500.0])
def test_covariances_change_by_a_thousandth_of_their_sigmas_at_most(stretch):
    covariance = long_and_thin(3, stretch)
    half, near = factors(covariance)
    back = symmetric(product(half))
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert near.all()
    assert np.all(np.abs(back - covariance) <= 1e-3 * sigma[:, :, None] * sigma[:, None, :])


@pytest.mark.parametrize("stretch", [1.0, 30.0])
def test_the_volume_of_the_ellipsoid_of_errors_stays(stretch):
    covariance = long_and_thin(4, stretch)
    kept = symmetric(product(factors(covariance)[0]))
    assert np.linalg.eigvalsh(kept).min() > 0
    np.testing.assert_allclose(np.linalg.det(kept), np.linalg.det(covariance), rtol=4e-3)


@given(st.integers(0, 2**32 - 1))
def test_rounding_again_changes_nothing(seed):
    kept = quantised(computed_points(seed % 10_000, 20))
    assert same(quantised(kept), kept)


def test_no_variance_at_all_is_kept_as_such():
    one = computed_points(2, 4)
    kept = quantised(with_values(one, calibration_covariance_mm2=np.zeros((4, 3, 3))))
    assert not kept.calibration_covariance_mm2.any()


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e9, -1e300])
def test_a_number_that_no_quantum_fits_is_kept_whole_and_the_others_are_rounded_as_ever(odd):
    one = computed_points(3, 5)
    xyz = one.xyz_mm.copy()
    xyz[2, 1] = odd
    kept = quantised(with_values(one, xyz_mm=xyz))
    assert kept.xyz_mm[2, 1].tobytes() == np.float64(odd).tobytes()
    others = np.arange(5) != 2
    assert kept.xyz_mm[others].tobytes() == quantised(one).xyz_mm[others].tobytes()


@pytest.mark.parametrize(
    "odd",
    [np.diag([1e-3, -1e-3, 1e-3]), np.full((3, 3), np.nan), np.eye(3) * 1e12, np.eye(3) * 1e-18],
    ids=["negative", "no number", "huge", "tiny"],
)
def test_a_matrix_that_half_precision_cannot_hold_is_kept_whole(odd):
    one = computed_points(4, 5)
    covariance = one.covariance_mm2.copy()
    covariance[3] = odd
    kept = quantised(with_values(one, covariance_mm2=covariance))
    np.testing.assert_array_equal(kept.covariance_mm2[3], odd)
    assert kept.covariance_mm2[:3].tobytes() == quantised(one).covariance_mm2[:3].tobytes()
