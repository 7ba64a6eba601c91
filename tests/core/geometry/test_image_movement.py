"""Movements of a view's images, against cameras that OpenCV turns, and closed forms."""

import cv2
import numpy as np
import pytest

from grabberd.core.geometry import ImageMovement, LocalField, View

FOCAL_MM, PIXEL_MM, PRINCIPAL_PX = 7.7, (0.0086, 0.0083), (352.0, 291.0)
MATRIX = np.array(
    [[FOCAL_MM / PIXEL_MM[0], 0, PRINCIPAL_PX[0]], [0, FOCAL_MM / PIXEL_MM[1], PRINCIPAL_PX[1]], [0, 0, 1.0]]
)
VIEW = View("left", 0, 360, *PIXEL_MM, 1, FOCAL_MM, *PRINCIPAL_PX, 0, 0, 0, 0, 0, 0)
CORNERS = np.array([(30.0, 40.0), (330.0, 536.0), (330.0, 40.0), (30.0, 536.0)])
ALL_OVER = np.stack(np.meshgrid(np.linspace(5, 355, 8), np.linspace(5, 570, 12)), axis=2).reshape(-1, 2)
SIGMA_PX = 0.005
PX_RAD = PIXEL_MM[0] / FOCAL_MM
OF_A_TURN, OF_ANY_HOMOGRAPHY = (0.001, 0.005, 0.02), (0.06, 0.3, 1.0)


def mapped(homography, places):
    """Places after a homography, and where they were before: what is observed, and its movement."""
    now = cv2.perspectiveTransform(places[np.newaxis], homography)[0]
    return now, now - places


def turned(*turn_px):
    """The homography of a camera turned about its axes by so many pixels' angles."""
    rotation = cv2.Rodrigues(np.array(turn_px) * PX_RAD)[0]
    return MATRIX @ rotation @ np.linalg.inv(MATRIX)


def fitted(homography, marks, noise_px=0.0, seed=0, shares=OF_A_TURN):
    _, moved = mapped(homography, CORNERS[:marks])
    moved = moved + np.random.default_rng(seed).normal(0, noise_px, moved.shape)
    return ImageMovement.fitted(VIEW, 576, CORNERS[:marks], moved, np.full(moved.shape, SIGMA_PX), shares)


def left_px(homography, movement):
    """What is left of a movement after it has been taken off, all over the view."""
    now, moved = mapped(homography, ALL_OVER)
    return moved - movement.at(now)


@pytest.mark.parametrize("marks", [2, 3, 4])
@pytest.mark.parametrize("turn_px", [(1, 0, 0), (0, 1, 0), (0, 0, 2), (0.7, -0.5, 1.5), (2, 2, 0)])
def test_a_turned_camera_is_corrected_keystone_included_from_two_marks_on(turn_px, marks):
    assert np.abs(left_px(turned(*turn_px), fitted(turned(*turn_px), marks))).max() < 0.02


def test_three_marks_show_that_an_image_is_stretched_and_four_correct_it():
    stretch = np.array([[1.0006, 0.0008, 0], [0.0004, 0.9996, 0], [0, 0, 1.0]])
    around = np.array([[1, 0, 180.0], [0, 1, 288.0], [0, 0, 1]])
    stretched = around @ stretch @ np.linalg.inv(around) @ turned(0.5, -0.5, 1.0)
    assert fitted(stretched, 3).cost > 20
    assert np.abs(left_px(stretched, fitted(stretched, 4, shares=OF_ANY_HOMOGRAPHY))).max() < 0.02


def test_four_marks_determine_any_homography():
    shift = np.array([[1, 0, 1.0], [0, 1, -2.0], [0, 0, 1.0]])
    keystone = np.array([[1, 0, 0], [0, 1, 0], [8e-6, -5e-6, 1.0]])
    for homography in (shift, keystone):
        assert np.abs(mapped(homography, ALL_OVER)[1]).max() > 1.0
        assert np.abs(left_px(homography, fitted(homography, 4, shares=OF_ANY_HOMOGRAPHY))).max() < 0.02


def test_what_two_marks_do_not_determine_is_in_sigma():
    keystone = np.array([[1, 0, 0], [0, 1, 0], [2e-6, 0, 1.0]])
    movement, of_four = (fitted(keystone, marks, shares=OF_ANY_HOMOGRAPHY) for marks in (2, 4))
    off = left_px(keystone, movement) / movement.sigma_at(ALL_OVER)
    assert np.sqrt(np.mean(off**2)) < 3.0
    assert movement.sigma_px > of_four.sigma_px


def test_what_is_not_a_turn_costs_more_than_the_marks_noise_allows():
    keystone = np.array([[1, 0, 0], [0, 1, 0], [8e-6, 0, 1.0]])
    assert fitted(keystone, 4).cost > 100
    assert fitted(turned(1.0, -1.5, 1.0), 4, SIGMA_PX).cost < 20


def test_sigma_predicts_the_error():
    # A small turn: of a large one a share is for targets at other distances, which these places are not.
    off, little = [], turned(0.1, 0.1, 0.5)
    for seed in range(60):
        movement = fitted(little, 4, SIGMA_PX, seed)
        off.append(left_px(little, movement) / movement.sigma_at(ALL_OVER))
    assert np.mean(np.square(off)) == pytest.approx(1.0, abs=0.4)


@pytest.mark.parametrize("known", [False, True])
def test_added_to_a_local_field_both_are_taken_off(known):
    movement = fitted(turned(1.0, -1.5, 1.0), 4)
    rng = np.random.default_rng(2)
    own = LocalField.through((-0.5, -0.5), 60.0, rng.normal(0, 0.1, (11, 8, 2)), np.full((11, 8, 2), 0.03))
    both = movement.added_to(own if known else None)
    expected = movement.at(ALL_OVER) + (own.at(ALL_OVER) if known else 0.0)
    assert both.at(ALL_OVER) == pytest.approx(expected, abs=0.006)
    sigma = np.hypot(movement.sigma_at(ALL_OVER), 0.03 if known else 0.0)
    assert both.sigma_at(ALL_OVER) == pytest.approx(sigma, rel=0.3)
