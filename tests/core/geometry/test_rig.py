import numpy as np

from core.geometry.rigs import calibration
from grabberd.core.geometry import Rig


def test_the_factor_is_a_root_of_the_covariance_over_all_its_decades():
    root = np.random.default_rng(5).normal(size=(36, 36)) * 10.0 ** np.linspace(-8, 1, 36)[:, np.newaxis]
    covariance = root @ root.T
    factor = Rig.of(calibration(covariance=covariance)).factor.reshape(36, -1)
    sigma = np.sqrt(np.diag(covariance))
    assert np.allclose(
        (factor @ factor.T) / np.outer(sigma, sigma), covariance / np.outer(sigma, sigma), atol=1e-12
    )


def test_parameters_that_were_held_have_no_part_in_the_factor():
    covariance = np.zeros((36, 36))
    covariance[6, 6], covariance[24, 24], covariance[6, 24] = 0.04, 0.09, 0.03
    covariance[24, 6] = 0.03
    factor = Rig.of(calibration(covariance=covariance)).factor
    assert np.allclose((factor[0] @ factor[1].T)[6, 6], 0.03)
    assert not factor[:, [0, 1, 2, 17]].any()


def test_without_a_covariance_there_is_no_factor():
    assert Rig.of(calibration()).factor is None


def test_a_left_handed_view_has_a_rotation_of_determinant_minus_one():
    rig = Rig.of(calibration(handedness=-1))
    assert np.allclose(np.linalg.det(rig.rotation), -1.0)
    assert np.allclose(np.linalg.det(Rig.of(calibration()).rotation), 1.0)
