"""The table of loads, and what it is there for, on one wall of the set for tuning."""

import numpy as np
import pytest

from .load_accuracy import COMPRESSION, FORCE, LOAD, MEAN, PLACE, of_wall
from .load_walls import TUNING, walls


@pytest.fixture(scope="module")
def wall():
    return next(walls(TUNING))


def test_a_section_is_closed_on_its_teat_and_alike_in_all_rows(wall):
    contact = wall.states.contact_kpa(wall.outer_kpa)
    assert wall.plane
    assert contact.max() > 20
    assert np.ptp(contact, axis=0).max() < 0.01


def test_a_wall_that_presses_far_round_its_teat_is_not_taken_for_a_stiffer_one(wall):
    """By the usual prior of the load alone its force comes out 35 N of 48 too small."""
    (one,) = of_wall(wall, 4, np.random.default_rng(1))
    assert set(one.pairs) == {PLACE, MEAN, COMPRESSION, LOAD, FORCE}
    assert abs(one.pairs[FORCE][0][0]) < 8
    assert np.sqrt(np.mean(one.pairs[PLACE][0] ** 2)) < 4
