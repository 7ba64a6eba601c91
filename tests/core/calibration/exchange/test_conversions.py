import cv2
import numpy as np

from grabberd.core.calibration.exchange import (
    axes_from_omega_phi_kappa,
    axes_from_openptv,
    pixels_from_corner,
    pixels_from_sensor,
)

XY_PX = np.array([[0.0, 0.0], [359.5, 287.5], [719.0, 100.0]])


def test_photomodelers_angles_turn_about_x_then_the_new_y_then_the_new_z():
    def about(axis, angle_deg):
        turn = np.zeros(3)
        turn[axis] = -np.radians(angle_deg)
        return cv2.Rodrigues(turn)[0]

    assert np.allclose(axes_from_omega_phi_kappa(20, -30, 70), about(2, 70) @ about(1, -30) @ about(0, 20))


def test_openptvs_matrix_of_the_cavity_belongs_to_the_angles_beside_it():
    """Camera 1 of test_cavity; its angles are kept in rad and beyond a turn."""
    printed = [
        [-0.9872980, -0.0171298, 0.1579534],
        [-0.0153230, 0.9998026, 0.0126498],
        [-0.1581389, 0.0100688, -0.9873655],
    ]
    angles_deg = np.degrees([-56.53585681, 2.98297501, 56.53131934])
    assert np.abs(axes_from_openptv(printed) - axes_from_omega_phi_kappa(*angles_deg)).max() < 1e-6


def test_pixels_from_the_corner_are_half_a_pixel_more():
    assert np.array_equal(pixels_from_corner(XY_PX + 0.5), XY_PX)


def test_sensor_coordinates_have_their_origin_in_the_middle_and_point_up():
    sensor = np.array([[-3.595, 5.75], [0.0, 0.0], [3.595, 3.75]])
    assert np.allclose(pixels_from_sensor(sensor, 720, 576, (0.01, 0.02)), XY_PX)
