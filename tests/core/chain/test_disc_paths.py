"""The order of fields by the paths of discs that a hand moves: slowly, steadily, to and fro."""

import numpy as np
import pytest

from core.chain.drawn_discs import frame
from grabberd.core.chain.field_order import OrderCheck, check
from grabberd.core.field import Field
from grabberd.core.reconstruction.field_order import Order

FIELDS = 140
MOVEMENTS = {
    "up and down": lambda time: (0.0, 8.0 * np.sin(time / 12)),
    "both ways": lambda time: (9.0 * np.sin(time / 17), 4.0 * np.sin(time / 11)),
    "fast": lambda time: (0.0, 8.0 * np.sin(time / 4)),
    "once": lambda time: (0.0, 12.0 * np.interp(time, [50, 70], [0.0, 1.0])),
}
EXPOSED = {
    Order.RIGHT: lambda n: n,
    Order.REVERSED: lambda n: n + 1 - 2 * (n % 2),
    Order.SAME_INSTANT: lambda n: n - n % 2,
}


def seen(move, exposed, noise=2.0):
    random = np.random.default_rng(3)
    return [
        Field.intact(frame(move(exposed(n)), random, noise)[n % 2 :: 2].copy(), n % 2) for n in range(FIELDS)
    ]


@pytest.mark.parametrize("order", EXPOSED)
@pytest.mark.parametrize("movement", MOVEMENTS)
def test_any_movement_tells_the_order(movement, order):
    assert check(seen(MOVEMENTS[movement], EXPOSED[order])).order is order


@pytest.mark.parametrize("order", EXPOSED)
def test_parities_of_the_wrong_name_are_an_offset_and_no_order(order):
    fields = seen(MOVEMENTS["up and down"], EXPOSED[order])
    told = OrderCheck()
    for field in fields:
        told.add(Field.intact(field.luma, 1 - field.parity))
    assert told.finding().order is order
    assert told.offset_px == pytest.approx(-2, abs=0.3)


@pytest.mark.parametrize("order", EXPOSED)
def test_one_steady_movement_could_as_well_be_an_offset(order):
    finding = check(seen(lambda time: (0.0, -9.0 + time % 18), EXPOSED[order]))
    assert finding.order is Order.UNCLEAR
    assert "too steady" in finding.evidence


@pytest.mark.parametrize("order", EXPOSED)
def test_noise_is_no_movement(order):
    finding = check(seen(lambda _: (0.0, 0.0), EXPOSED[order], noise=15.0))
    assert finding.order is Order.NO_MOVEMENT


def test_too_seldom_a_movement_is_said_to_be_so():
    finding = check(seen(lambda time: (0.0, 1.5 * (time > 50)), EXPOSED[Order.RIGHT]))
    assert finding.order is Order.NO_MOVEMENT
    assert f"of {FIELDS} fields" in finding.evidence
