"""The ledger accounts for every field exactly once."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd.core.ledger import Ledger, LedgerEntry, Outcome

LOST = LedgerEntry(2, 3, Outcome.LOST, "time gap")


def received(*numbers):
    ledger = Ledger()
    for n in numbers:
        ledger.receive(n)
    return ledger


def test_a_ledger_of_received_fields_is_complete():
    assert received(0, 1, 2).complete
    assert received(0, 1, 2).in_words(50.0) == "complete"


def test_a_ledger_without_fields_is_not_complete_and_says_so():
    assert not Ledger().complete
    assert Ledger().in_words(50.0) == "no fields"


def test_it_begins_with_the_first_number_that_is_entered():
    ledger = received(1200, 1201)
    assert (ledger.first_n, ledger.end_n, ledger.total) == (1200, 1202, 2)
    assert ledger.complete


@pytest.mark.parametrize("n", [0, 1])
def test_a_field_is_not_received_twice(n):
    ledger = received(0, 1)
    with pytest.raises(ValueError, match=f"field {n} is in the ledger already"):
        ledger.receive(n)
    assert ledger.received == 2


def test_a_field_is_not_lost_after_it_was_received():
    with pytest.raises(ValueError, match="already"):
        received(0, 1, 2).add(LOST)


def test_a_field_is_not_received_after_it_was_lost():
    ledger = received(0, 1)
    ledger.add(LOST)
    with pytest.raises(ValueError, match="already"):
        ledger.receive(4)


@pytest.mark.parametrize("entry", [LOST._replace(count=0), LOST._replace(outcome=Outcome.RECEIVED)])
def test_an_entry_must_be_about_something_that_went_wrong(entry):
    with pytest.raises(ValueError, match="not a ledger entry"):
        Ledger().add(entry)


def test_numbers_that_nobody_spoke_of_are_entered_as_lost():
    assert received(0, 5).entries == [LedgerEntry(1, 4, Outcome.LOST, "not accounted for")]


def test_neighbours_of_one_outcome_and_reason_are_merged():
    ledger = received(0, 1)
    ledger.add(LOST)
    ledger.add(LedgerEntry(5, 1, Outcome.LOST, "time gap"))
    assert ledger.entries == [LedgerEntry(2, 4, Outcome.LOST, "time gap")]


def test_neighbours_with_another_reason_are_not_merged():
    ledger = received(0, 1)
    ledger.add(LOST)
    ledger.add(LedgerEntry(5, 1, Outcome.LOST, "unplugged"))
    ledger.receive(6)
    ledger.add(LedgerEntry(7, 1, Outcome.LOST, "unplugged"))
    assert len(ledger.entries) == 3


def test_counts_tell_every_outcome_also_those_that_did_not_happen():
    ledger = received(0, 1)
    ledger.add(LOST)
    assert ledger.counts() == {
        Outcome.RECEIVED: 2,
        Outcome.LOST: 3,
        Outcome.DAMAGED: 0,
        Outcome.NO_SIGNAL: 0,
        Outcome.OVERRUN: 0,
    }


def test_entering_a_field_enters_first_what_was_lost_before_it():
    ledger = received(0, 1)
    ledger.enter(5, Outcome.DAMAGED, "repeated", before=(LOST,))
    assert ledger.entries == [LOST, LedgerEntry(5, 1, Outcome.DAMAGED, "repeated")]


def test_entering_a_received_field_counts_it():
    ledger = received(0, 1)
    ledger.enter(5, Outcome.RECEIVED, None, before=(LOST,))
    assert (ledger.received, ledger.end_n, ledger.entries) == (3, 6, [LOST])


def test_an_outcome_without_a_reason_is_its_own_reason():
    ledger = received(0)
    ledger.enter(1, Outcome.DAMAGED, None)
    assert ledger.entries == [LedgerEntry(1, 1, Outcome.DAMAGED, "damaged")]


def test_one_field_makes_a_complete_ledger():
    assert received(7).complete


def test_seconds_count_from_the_first_field_of_the_account():
    ledger = received(0)
    ledger.add(LedgerEntry(1, 1, Outcome.LOST, "time gap"))
    assert ledger.in_words(50.0) == "1 field lost at 0.02 s (time gap)"


def test_gaps_in_a_restored_account_are_lost_for_the_reason_given():
    ledger = Ledger.restore(
        [3, 6], [LedgerEntry(4, 1, Outcome.DAMAGED, "repeated")], first_n=2, gap="cut short"
    )
    assert ledger.entries == [
        LedgerEntry(2, 1, Outcome.LOST, "cut short"),
        LedgerEntry(4, 1, Outcome.DAMAGED, "repeated"),
        LedgerEntry(5, 1, Outcome.LOST, "cut short"),
    ]


def test_closing_enters_what_is_missing_as_lost():
    ledger = received(0, 1)
    ledger.close(64, "unplugged")
    assert ledger.entries == [LedgerEntry(2, 62, Outcome.LOST, "unplugged")]
    assert ledger.total == 64


def test_fields_that_never_came_because_there_was_no_camera_are_without_signal():
    ledger = received(0, 1)
    ledger.close(64, "no signal")
    assert ledger.entries == [LedgerEntry(2, 62, Outcome.NO_SIGNAL, "no signal")]


def test_closing_a_full_ledger_changes_nothing():
    ledger = received(0, 1)
    ledger.close(2, "unplugged")
    assert ledger.complete


def test_closing_an_empty_ledger_says_that_all_is_missing():
    ledger = Ledger()
    ledger.close(3, "stalled")
    assert ledger.entries == [LedgerEntry(0, 3, Outcome.LOST, "stalled")]


def test_the_words_say_how_many_when_and_why():
    ledger = received(*range(100, 720))
    ledger.add(LedgerEntry(720, 3, Outcome.LOST, "time gap"))
    ledger.receive(723)
    ledger.add(LedgerEntry(724, 1, Outcome.DAMAGED, "repeated"))
    words = "3 fields lost at 12.40 s (time gap); 1 field damaged at 12.48 s (repeated)"
    assert ledger.in_words(50.0) == words


def test_the_words_stay_short_where_much_went_wrong():
    ledger = Ledger()
    for n in range(0, 20, 2):
        ledger.receive(n)
        ledger.add(LedgerEntry(n + 1, 1, Outcome.NO_SIGNAL, "no signal"))
    assert ledger.in_words(50.0).count(";") == 5
    assert ledger.in_words(50.0).endswith("and 5 fields more")


events = st.lists(
    st.tuples(st.sampled_from(Outcome), st.integers(1, 4), st.sampled_from(["time gap", "unplugged"])),
    max_size=30,
)


def account(happened):
    ledger, n, numbers = Ledger(), 7, []
    for outcome, count, reason in happened:
        if outcome is Outcome.RECEIVED:
            ledger.receive(n)
            numbers.append(n)
            n += 1
        else:
            ledger.add(LedgerEntry(n, count, outcome, reason))
            n += count
    return ledger, numbers


@given(events)
def test_every_number_is_counted_exactly_once(happened):
    ledger, _ = account(happened)
    assert sum(ledger.counts().values()) == ledger.total
    ends = [entry.end_n for entry in ledger.entries]
    assert all(entry.first_n >= end for entry, end in zip(ledger.entries[1:], ends, strict=False))


@given(events)
def test_an_account_is_restored_from_the_received_numbers_and_the_entries(happened):
    ledger, numbers = account(happened)
    assert Ledger.restore(numbers, ledger.entries) == ledger
