"""Targets that do not stand where their rows and columns put them."""

from dataclasses import replace

import numpy as np

from calibration.sights import FRAME
from grabberd.calibration import out_of_order


def test_a_regular_frame_is_in_order():
    assert not len(out_of_order(FRAME))


def test_two_exchanged_targets_are_both_found():
    places = FRAME.xyz_mm.copy()
    places[[40, 41]] = places[[41, 40]]
    assert out_of_order(replace(FRAME, xyz_mm=places)).tolist() == [40, 41]


def test_nothing_is_said_of_a_frame_without_a_regular_grid():
    places = np.random.default_rng(0).uniform(-50, 50, FRAME.xyz_mm.shape)
    assert not len(out_of_order(replace(FRAME, xyz_mm=places)))
