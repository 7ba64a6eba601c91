"""Numbers of fields against a model of grabbers that knows which of the camera's each one is."""

import random

import numpy as np
import pytest

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import Outcome, too_high_by
from grabberd.instrument.acquisition.numbering import FieldNumbering
from instrument.acquisition.grabbers import GrabberModel

ORDERS = (FieldOrder.ALTERNATE, FieldOrder.TOP_FIRST)
COUNTS = ("none", "fields")
UNCERTAIN = "number uncertain by up to "


def numbered(model):
    """What was dequeued, and what it was numbered as."""
    taken, numbering = model.run(), FieldNumbering(model.info)
    found = [one for each in taken for one in numbering.number(each.grabbed, now_ns=each.now_ns)]
    return taken, found + numbering.settle()


def off(taken, found):
    return [one.n - (each.n - taken[0].n) for each, one in zip(taken, found, strict=True)]


def lost(found):
    return sum(entry.count for one in found for entry in one.lost_before)


CASES = {
    "nothing": {},
    "a process that is frozen for 12 s": {"pauses": ((3.0, 12.0),), "fields": 1200},
    "a stall of .1 s, stamps of arrival": {"pauses": ((3.0, 0.1),), "stamps": "arrival"},
    "stamps that are late": {"late": 0.1, "late_ms": 35.0},
    "a busy computer, stamps of arrival": {
        "pauses": tuple((0.5 + 0.31 * k, 0.07 + 0.05 * (k % 3)) for k in range(30)),
        "stamps": "arrival",
    },
    "losses": {"losses": ((100, 2), (200, 4), (300, 60))},
    "losses that the driver does not count": {"silent": ((100, 2), (200, 4), (300, 60))},
    "a loss as another clock takes over": {"clock_jumps": ((4.0, 3600.0),), "losses": ((200, 2),)},
    "a clock that jumps back": {"clock_jumps": ((4.0, -3600.0),)},
    "a clock that jumps by less than a field is long": {"clock_jumps": ((4.0, 0.06),)},
    "a loss while stamps are zero": {"zero_stamps": ((200, 100),), "losses": ((250, 2),)},
    "a count that begins anew": {"count_restarts": (200,), "losses": ((300, 2),)},
    "a camera that drifts": {"drift": 1e-4, "jitter_ms": 8.0, "fields": 3000},
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))
def test_every_field_has_its_number_and_its_time(case, counts, order):
    model = GrabberModel(order=order, counts=counts, **case)
    taken, found = numbered(model)
    assert set(off(taken, found)) == {0}
    assert lost(found) == taken[-1].n - taken[0].n + 1 - len(taken)
    # The mean of a jitter of up to 8 ms is 4 ms, which no clock can tell from the way.
    apart_ns = [abs(one.time_ns - model.exposed_ns(each.n)) for each, one in zip(taken, found, strict=True)]
    assert max(apart_ns) < 6_000_000


def told_off(found):
    """Fields by which each number is too high by the events so far."""
    events = [sum(too_high_by(event) for event in one.rebases) for one in found]
    return np.cumsum(events).tolist()


BUSY = tuple((2.0 + 0.12 * k, 0.03 + 0.17 * (k * 0.618 % 1)) for k in range(500))
RATES = {
    "50.2 Hz": (-4e-3, 3),
    "49.9 Hz": (2e-3, 6),
    "50.05 Hz": (-1e-3, 12),
    "a normal camera": (-1e-4, 120),
}


@pytest.mark.parametrize("stamps", ["exposure", "arrival"])
@pytest.mark.parametrize(("drift", "lasts_s"), RATES.values(), ids=list(RATES))
def test_a_camera_whose_rate_is_off_has_right_numbers_after_a_long_doubt(drift, lasts_s, stamps):
    lossy = tuple((n, 2) for n in range(150, 150 + 50 * lasts_s, 5))
    taken, found = numbered(GrabberModel(drift=drift, stamps=stamps, silent=lossy, fields=500 + 50 * lasts_s))
    assert set(off(taken, found)) == {0}
    assert set(told_off(found)) == {0}


@pytest.mark.parametrize("drift", [-1e-4, 1e-3, 4e-3])
def test_on_a_computer_that_is_busy_for_a_minute_a_camera_whose_rate_is_off_loses_nothing(drift):
    model = GrabberModel(drift=drift, silent=((99, 1),), pauses=BUSY, fields=3500, buffers=32)
    taken, found = numbered(model)
    certain = [not (one.reason or "").startswith(UNCERTAIN) for one in found]
    assert {one for one, sure in zip(off(taken, found), certain, strict=True) if sure} == {0}
    assert told_off(found)[-1] == 0


def test_losses_are_certain_while_the_program_is_in_time_for_every_field_that_comes():
    taken, found = numbered(GrabberModel(silent=tuple((n, 2) for n in range(150, 450, 5))))
    assert set(off(taken, found)) == {0}
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


@pytest.mark.parametrize("grid_ms", [1.0, 4.0, 10.0])
@pytest.mark.parametrize("seed", range(4))
def test_arrivals_stamped_by_a_clock_that_ticks_are_not_taken_for_exposures(grid_ms, seed):
    draw, at_s, pauses = random.Random(seed), 2.0, []
    while at_s < 4.0:
        pauses.append((at_s, draw.expovariate(10)))
        at_s += pauses[-1][1] + draw.uniform(0.005, 0.05)
    model = GrabberModel(stamps="arrival", grid_ms=grid_ms, pauses=tuple(pauses), buffers=32, seed=seed)
    taken, found = numbered(model)
    wrong_by = [one - told for one, told in zip(off(taken, found), told_off(found), strict=True)]
    certain = [not (one.reason or "").startswith(UNCERTAIN) for one in found]
    assert {one for one, sure in zip(wrong_by, certain, strict=True) if sure} == {0}


def test_a_field_is_kept_back_only_while_it_is_in_doubt():
    taken, numbering = GrabberModel(losses=((100, 2),)).run(), FieldNumbering(GrabberModel().info)
    at_once = [len(numbering.number(each.grabbed, now_ns=each.now_ns)) for each in taken]
    assert at_once[:9] == [0] * 7 + [8, 1], "the first fields show by which way they come"
    assert at_once[9:100] == [1] * 91
    assert at_once[100] == 0
    assert 1 < max(at_once) < 10
    assert at_once[120:] == [1] * len(at_once[120:])


def test_a_camera_that_goes_on_in_the_other_phase_is_followed_without_damage():
    taken, found = numbered(GrabberModel(turns=(200,)))
    assert set(off(taken, found)) == {0}
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


def drawn(seed):
    """A grabber, a camera and a computer with up to three things wrong, as a seed has it."""
    draw = random.Random(seed)
    order = draw.choice(list(FieldOrder)[:3])
    counts = ["none", "fields", "frames"] if order is FieldOrder.ALTERNATE else ["none", "fields"]

    def spans(most):
        return tuple((draw.randrange(50, 1100), draw.choice([1, 2, 3, 4, 10, 60])) for _ in range(most))

    faults = {
        "late": lambda: {"late": draw.choice([0.003, 0.02, 0.1]), "late_ms": draw.choice([10.0, 25.0, 60.0])},
        "losses": lambda: {"losses": spans(draw.choice([1, 4, 12]))},
        "silent": lambda: {"silent": spans(draw.choice([1, 3]))},
        "pause": lambda: {"pauses": ((draw.uniform(1, 20), draw.choice([0.05, 0.1, 0.3, 0.9, 3.0, 12.0])),)},
        "jump": lambda: {
            "clock_jumps": ((draw.uniform(1, 20), draw.choice([-3600, 3600, 0.5, -0.5, 0.06])),)
        },
        "zero": lambda: {"zero_stamps": ((draw.randrange(50, 1100), draw.choice([1, 5, 100])),)},
    }
    chosen = [faults[name]() for name in draw.sample(list(faults), draw.choice([1, 1, 2, 3]))]
    wrong = {name: value for fault in chosen for name, value in fault.items()}
    return GrabberModel(
        order=order,
        counts=draw.choice(counts),
        stamps=draw.choice(["exposure", "exposure", "arrival"]),
        buffers=draw.choice([4, 8, 16, 32]),
        drift=draw.uniform(-1e-4, 1e-4),
        jitter_ms=draw.choice([0.5, 2.0, 6.0]),
        fields=1200,
        seed=seed,
        **wrong,
    )


@pytest.mark.parametrize("seed", range(24))
def test_whatever_is_wrong_a_number_is_right_or_says_by_how_much_it_may_be_off(seed):
    taken, found = numbered(drawn(seed))
    assert len(found) == len(taken)
    may_be_off = 0
    for one, apart in zip(found, off(taken, found), strict=True):
        if one.reason and one.reason.startswith(UNCERTAIN):
            may_be_off += int(one.reason.removeprefix(UNCERTAIN))
        assert abs(apart) <= may_be_off
