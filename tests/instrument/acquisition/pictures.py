"""Fields with pictures, for the tests of what a picture tells."""

import numpy as np

from grabberd.core.field import Field, Packing
from grabberd.instrument.acquisition.content_check import ContentCheck
from grabberd.instrument.acquisition.device import GrabbedField
from grabberd_fake.options import FakeOptions
from grabberd_fake.world import World

ROWS, COLUMNS = 288, 720
AS_IT_IS = Packing(8, doubled=False, threshold=0)


def camera(count, **options):
    """(count, 288, 720) fields of the simulated camera, top first, without the stamp in the corner."""
    picture = {"stamp": False, **options.pop("picture", {})}
    world = World(FakeOptions.read({"picture": picture, **options}))
    lumas = np.empty((count, ROWS, COLUMNS), np.uint8)
    for number, luma in enumerate(lumas):
        world.picture(number, luma)
    return lumas


def noise(seed, low=10, high=30):
    return np.random.default_rng(seed).integers(low, high, (ROWS, COLUMNS), np.uint8)


def grabbed(luma, n):
    """Field `n` of a stream, even ones top, 20 ms apart."""
    return GrabbedField(Field.intact(luma, n % 2), 1_000_000_000 + n * 20_000_000, n, None)


def looked_at(lumas, check=None):
    """What a check found of each of them."""
    check = check or ContentCheck()
    return [check.take(grabbed(luma, n), AS_IT_IS)[0] for n, luma in enumerate(lumas)]


def damages(lumas):
    return [content.damage for content in looked_at(lumas)]


def without_a_packet(luma, row, columns):
    """`columns` pixels are lost at the start of `row`: what follows moves up, the end is black."""
    stream = luma.ravel()
    lost = row * COLUMNS + columns
    return np.concatenate((stream[: row * COLUMNS], stream[lost:], np.zeros(columns, np.uint8))).reshape(
        luma.shape
    )
