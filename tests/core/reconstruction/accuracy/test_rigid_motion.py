import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.geometry import rotation_matrix
from grabberd.core.reconstruction.accuracy import rigid_motion
from grabberd.errors import MeasurementError

PLACES = np.random.default_rng(1).uniform(-40, 40, (12, 3))
ANGLES = st.tuples(*[st.floats(-1.5, 1.5)] * 3)
SHIFTS = st.tuples(*[st.floats(-500, 500)] * 3)


@given(ANGLES, SHIFTS)
def test_a_motion_is_found_again(angles, shift):
    rotation = rotation_matrix(*angles)
    motion = rigid_motion(PLACES, PLACES @ rotation.T + shift)
    assert np.allclose(motion.rotation, rotation, atol=1e-9)
    assert np.allclose(motion.shift_mm, shift, atol=1e-7)
    assert np.allclose(motion.apply(PLACES), PLACES @ rotation.T + shift, atol=1e-7)


@given(ANGLES, st.floats(0.5, 2.0))
def test_it_never_scales_and_never_reflects(angles, scale):
    other = scale * PLACES @ rotation_matrix(*angles).T * (1, 1, -1)
    rotation = rigid_motion(PLACES, other).rotation
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(ANGLES)
def test_its_angle_is_that_of_the_whole_turn(angles):
    rotation = rotation_matrix(*angles)
    motion = rigid_motion(PLACES, PLACES @ rotation.T)
    assert np.cos(np.radians(motion.angle_deg)) == pytest.approx((np.trace(rotation) - 1) / 2, abs=1e-9)


def test_no_neighbouring_motion_fits_better():
    rng = np.random.default_rng(2)
    noisy = PLACES @ rotation_matrix(0.3, -0.2, 0.1).T + rng.normal(0, 0.5, PLACES.shape)
    motion = rigid_motion(PLACES, noisy)
    best = ((motion.apply(PLACES) - noisy) ** 2).sum()
    for change in rng.normal(0, 0.01, (50, 6)):
        turned = PLACES @ (rotation_matrix(*change[:3]) @ motion.rotation).T + motion.shift_mm + change[3:]
        assert ((turned - noisy) ** 2).sum() > best


def test_covariances_turn_with_it():
    motion = rigid_motion(PLACES, PLACES @ rotation_matrix(0.0, 0.0, np.pi / 2).T)
    assert np.allclose(motion.turn(np.diag([1.0, 4.0, 9.0])), np.diag([4.0, 1.0, 9.0]))


@pytest.mark.parametrize("places", [PLACES[:2], np.outer(np.arange(5.0), [1, 2, 3])], ids=["two", "a line"])
def test_places_on_a_line_determine_no_motion(places):
    with pytest.raises(MeasurementError, match="do not determine a rigid motion"):
        rigid_motion(places, places)
