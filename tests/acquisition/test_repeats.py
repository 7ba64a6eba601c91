"""Old pictures that a device delivers as new ones."""

import numpy as np

from grabberd.acquisition.repeats import RepeatCheck
from grabberd.field import Field


def noise(seed):
    return np.random.default_rng(seed).integers(10, 30, (288, 720), np.uint8)


def damages(*fields):
    check = RepeatCheck()
    return [check.damage(Field.intact(luma, parity)) for luma, parity in fields]


def test_fields_with_noise_of_their_own_are_new():
    assert damages(*((noise(seed), seed % 2) for seed in range(6))) == [None] * 6


def test_a_field_that_equals_the_one_of_its_parity_before_is_repeated():
    fields = [(noise(1), 0), (noise(2), 1), (noise(1), 0), (noise(2), 1), (noise(3), 0)]
    assert damages(*fields) == [None, None, "repeated", "repeated", None]


def test_so_is_one_that_equals_the_field_just_before_although_its_parity_is_another():
    assert damages((noise(1), 0), (noise(1), 1), (noise(1), 0)) == [None, "repeated", "repeated"]


def test_a_black_picture_tells_nothing():
    black = np.zeros((288, 720), np.uint8)
    assert damages((black, 0), (black, 0)) == [None, None]


def test_the_sample_does_not_depend_on_the_drivers_buffer():
    check, buffer = RepeatCheck(), noise(1)
    check.damage(Field.intact(buffer, 0))
    buffer[:] = noise(2)
    assert check.damage(Field.intact(noise(1), 0)) == "repeated"
