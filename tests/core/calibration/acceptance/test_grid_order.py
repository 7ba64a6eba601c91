"""Targets that do not stand where their rows and columns put them."""

from dataclasses import replace

import numpy as np

from core.calibration.sights import FRAME
from grabberd.core.calibration.calibration_frame import GridOrder, grid_order


def test_a_regular_frame_is_in_order():
    assert grid_order(FRAME) == GridOrder()


def test_two_swapped_targets_are_named_as_a_pair():
    places = FRAME.xyz_mm.copy()
    places[[40, 41]] = places[[41, 40]]
    assert grid_order(replace(FRAME, xyz_mm=places)) == GridOrder(swapped=((40, 41),))


def test_a_target_in_nobodys_place_is_astray():
    places = FRAME.xyz_mm.copy()
    places[40, 0] += 5.0
    assert grid_order(replace(FRAME, xyz_mm=places)) == GridOrder(astray=(40,))


def test_nothing_is_said_of_a_frame_without_a_regular_grid():
    places = np.random.default_rng(0).uniform(-50, 50, FRAME.xyz_mm.shape)
    assert grid_order(replace(FRAME, xyz_mm=places)) == GridOrder()
