"""Start of a stream: fields that are kept back until it is known how late the first one is."""

from random import Random

import pytest

from grabberd.core.ledger import Outcome, Rebase, unsure_by
from grabberd.instrument.acquisition.numbering import FieldNumbering
from grabberd.instrument.acquisition.numbering.arrivals import Way
from instrument.acquisition.streams import MS, PERIOD_NS, START_NS, grab, info, lost

WAY_NS = 10 * MS


def started(since_ns, waits_ns, stamped_on_arrival=False, **stream):
    """What comes of fields that each wait for so long, with the stamps of their exposures or arrivals."""
    numbering, found = FieldNumbering(info(**stream), since_ns), []
    for n, wait_ns in enumerate(waits_ns):
        grabbed = grab(n, late_ns=wait_ns if stamped_on_arrival else 0, sequence=n)
        found.append(numbering.number(grabbed, now_ns=grab(n).time_ns + WAY_NS + wait_ns))
    return [len(one) for one in found], [one for some in found for one in some] + numbering.settle()


def off_ns(found):
    return [one.time_ns - grab(n).time_ns for n, one in enumerate(found)]


def test_a_first_field_that_comes_at_once_has_not_waited():
    released, _ = started(START_NS - PERIOD_NS, [0] * 10)
    assert released == [1] * 10


def test_otherwise_regular_arrivals_tell_after_eight_fields():
    released, found = started(START_NS - 3 * PERIOD_NS, [0] * 10)
    assert released == [0] * 7 + [8, 1, 1]
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


def test_stamps_that_vary_against_the_arrivals_tell_as_well():
    random = Random(1)
    released, found = started(None, [random.randint(0, 200) * MS for _ in range(20)])
    assert sum(released[:10]) > 0
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    assert off_ns(found) == [0] * 20


def test_first_stamps_of_arrivals_that_a_queue_made_late_are_put_right():
    queue_ns = [max(100 - 20 * n, 0) * MS for n in range(30)]
    _, found = started(START_NS - 10 * PERIOD_NS, queue_ns, stamped_on_arrival=True)
    assert off_ns(found) == [0] * 30
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


@pytest.mark.parametrize("since_ns", [START_NS - 4 * PERIOD_NS, None])
def test_while_nothing_tells_numbers_are_uncertain_by_as_much_as_they_may_be_off(since_ns):
    random = Random(2)
    waits_ns = sorted(random.randint(0, 400) * MS for _ in range(60))  # ever later: one never catches up
    _, found = started(since_ns, waits_ns, stamped_on_arrival=True)
    uncertain = [int(one.reason.split()[-1]) for one in found if one.outcome is Outcome.DAMAGED]
    assert len(uncertain) > 40
    for off, one in zip(off_ns(found), found, strict=True):
        if one.outcome is Outcome.DAMAGED:
            assert abs(off) <= PERIOD_NS * (1 + int(one.reason.split()[-1]))


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("last_ms", [0, 10, 400])
@pytest.mark.parametrize("turns_at", [50, None])
def test_when_arrivals_tell_at_last_no_phase_is_blamed_for_numbers_that_may_be_off(seed, last_ms, turns_at):
    random = Random(seed)
    waits_ns = [*sorted(random.randint(0, 400) * MS for _ in range(60)), *[last_ms * MS] * 60]
    numbering, found = FieldNumbering(info(), START_NS - 4 * PERIOD_NS), []
    for n, wait_ns in enumerate(waits_ns):
        grabbed = grab(n, late_ns=wait_ns, parity=(n + (turns_at is not None and n >= turns_at)) % 2)
        found += numbering.number(grabbed, now_ns=grab(n).time_ns + WAY_NS + wait_ns)
    events = [event for one in found + numbering.settle() for event in one.rebases]
    assert Rebase.PHASE not in {event.kind for event in events}
    assert any(map(unsure_by, events)) == ((seed, last_ms, turns_at) == (2, 10, 50))


def test_a_stamp_from_before_the_request_is_one_of_another_clock():
    released, _ = started(START_NS + 50 * PERIOD_NS, [0] * 10)
    assert released == [0] * 7 + [8, 1, 1]


def test_losses_while_fields_are_kept_back_are_in_the_account():
    numbering, found = FieldNumbering(info(counts_losses=True), START_NS - 3 * PERIOD_NS), []
    kept = [*range(5), *range(8, 30)]
    for n in kept:
        found += numbering.number(grab(n, sequence=n), now_ns=grab(n).time_ns + WAY_NS)
    found += numbering.settle()
    assert [one.n for one in found] == kept
    assert [entry for one in found for entry in lost(one.lost_before)] == [(5, 3, "time gap")]


def test_a_way_is_known_when_it_has_come_true_eight_times_more_often_than_not():
    way = Way()
    for _ in range(8):
        assert not way.is_known
        way = way.after(2.0)
    assert way.is_known
    assert way.after(9.0).is_known, "what comes late tells nothing new"
    assert not way.after(1.0).is_known, "what comes sooner does"
    assert Way(2.0, 5).after(9.0).regular == 4


def test_what_waits_for_the_program_tells_nothing_of_a_slower_computer():
    way = Way(1.0, 8)
    for _ in range(900):
        way = way.after(20.0, waited=True)
    assert way.periods == 1.0
    assert way.after(20.0).periods > 1.0
