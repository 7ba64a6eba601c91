"""Time of each field in turn, as its number has it."""

import pytest

from grabberd.core.ledger import Outcome
from grabberd.instrument.acquisition.numbering.arrivals import Arrival, Arrivals, Way
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.paths import Step
from grabberd.instrument.acquisition.numbering.pending import Pending
from grabberd.instrument.acquisition.numbering.stamps import Stamps
from grabberd.instrument.acquisition.numbering.timing import Timing
from instrument.acquisition.streams import PERIOD_NS, grab, info


def came(n, waits_ns=0):
    return Arrival(grab(n).time_ns + 2 * PERIOD_NS + waits_ns, burst=False, joined=False)


def in_time(n, *, stamped_on_arrival=False):
    stamp_ns = grab(n).time_ns
    return Pending(
        parity=n % 2,
        phase=n % 2,
        stamp_ns=stamp_ns,
        time_ns=stamp_ns,
        doubt=None,
        arrival=came(n),
        stamped_on_arrival=stamped_on_arrival,
        sequence=None,
        count=None,
        recounted=False,
        outcome=Outcome.RECEIVED,
        reason=None,
        no_signal=False,
        in_time=True,
        may_have_waited=0,
        interruption=None,
        standstill=None,
    )


def begun():
    stream = info()
    pace = Pace(stream)
    arrivals = Arrivals(stream, pace)
    return Timing(stream, pace, Stamps(stream, pace), arrivals), arrivals


def test_while_no_way_is_known_exposures_that_are_late_alike_mean_that_numbers_are_too_low():
    """Nothing else tells such a loss from a clock that was set, which is rarer on a busy computer."""
    timing, arrivals = begun()
    for n in range(8):
        arrivals.compare(came(n, waits_ns=n % 2 * 2 * PERIOD_NS), grab(n).time_ns)
    assert arrivals.tells_of_stamps
    assert not arrivals.way.is_known
    timing.begin(in_time(0))
    found = [timing.come_to(in_time(n + 5), Step(1, 5.0, None), n) for n in range(1, 9)]
    assert [reason for _, reason in found] == [*["late timestamp"] * 7, None]
    assert found[-1][0] == grab(13).time_ns
    assert timing.take_ahead() == pytest.approx(-5)
    assert timing.rebases == []


def after_a_loss_that_may_be_none(regular, *, may_be_late=False):
    """What fields tell that are early by one after a loss that was not counted."""
    timing, arrivals = begun()
    arrivals.way = Way(2.0, regular)
    timing.begin(in_time(0, stamped_on_arrival=True), may_be_late=may_be_late)
    for n in range(1, 20):
        timing.come_to(in_time(n, stamped_on_arrival=True), Step(1, 0.0, 0.0), n)
    for n in range(20, 23):
        timing.come_to(in_time(n, stamped_on_arrival=True), Step(2 if n == 20 else 1, -1.0, -1.0), n + 1)
    return timing


@pytest.mark.parametrize("regular", [0, 8])
def test_after_a_loss_that_may_be_none_early_fields_tell_of_numbers_and_not_of_the_first_stamps(regular):
    timing = after_a_loss_that_may_be_none(regular)
    assert timing.take_ahead() == pytest.approx(1, abs=0.2)
    assert timing.rebases == []


def test_they_tell_of_the_first_stamps_if_it_was_not_known_how_late_those_are():
    timing = after_a_loss_that_may_be_none(0, may_be_late=True)
    assert timing.take_late() == pytest.approx(1, abs=0.2)
    assert timing.take_ahead() == 0


def test_fields_by_which_numbers_turn_out_to_be_far_ahead_do_not_spoil_the_rate():
    timing, arrivals = begun()
    arrivals.way = Way(2.0, 8)
    timing.begin(in_time(0))
    for n in range(1, 20):
        timing.come_to(in_time(n), Step(1, 0.0, 0.0), n)
    for n in range(20, 23):
        timing.come_to(in_time(n), Step(5 if n == 20 else 1, -4.0, -4.0), n + 4)
    assert timing.take_ahead() == pytest.approx(4, abs=0.01)
    assert timing.period_ns == pytest.approx(PERIOD_NS, rel=1e-6)
