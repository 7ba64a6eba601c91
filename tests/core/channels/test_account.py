"""The account of a capture's channels: nothing that is missing goes unsaid."""

import numpy as np

from grabberd.core.channels import Anomaly
from grabberd.core.channels.account import (
    MOST_LISTED,
    OTHER,
    SILENT,
    Account,
    AnomalyLedger,
    ChannelAccount,
    ChannelLedger,
    Gap,
)

STEP_NS = 10_000_000
SECOND_NS = 1_000_000_000


def times(first, count):
    return (first + np.arange(count)) * STEP_NS


def ledger(*parts):
    kept = ChannelLedger(ChannelAccount("pulsation", "tank"))
    for part in parts:
        kept.enter(np.asarray(part, np.int64))
    return kept


def closed(kept, begin, end):
    return kept.account.closed(begin * STEP_NS, end * STEP_NS)


def test_readings_at_an_even_pace_are_complete() -> None:
    account = closed(ledger(times(0, 50), times(50, 50)), 1, 98)
    assert (account.readings, account.first_ns, account.last_ns) == (100, 0, 99 * STEP_NS)
    assert account.step_ns == STEP_NS
    assert Account((account,)).verdict == "complete"
    assert Account((account,)).in_words == "complete"


def test_a_gap_is_between_the_readings_on_its_sides() -> None:
    account = ledger(times(0, 50), times(80, 50)).account
    assert account.gaps == (Gap(49 * STEP_NS, 80 * STEP_NS, SILENT),)
    assert (account.gap_count, account.gap_ns) == (1, 31 * STEP_NS)
    assert Account((account,)).in_words == "with gaps: pulsation: 1 gap, 0.31 s (no reading came)"


def test_a_gap_within_what_came_together_is_found_as_well() -> None:
    account = ledger(np.concatenate([times(0, 50), times(90, 20)])).account
    assert [gap.first_ns for gap in account.gaps] == [49 * STEP_NS]


def test_readings_that_come_a_little_late_are_no_gap() -> None:
    jitter = np.random.default_rng(0).integers(-4_000_000, 4_000_000, 500)
    assert ledger(times(1, 500) + jitter).account.gap_count == 0


def test_a_gap_has_the_first_reason_that_was_told_for_it() -> None:
    kept = ledger(times(0, 50))
    kept.interrupted("unplugged")
    kept.interrupted("there is no such port")
    kept.enter(times(200, 50))
    kept.enter(times(300, 50))
    assert [gap.reason for gap in kept.account.gaps] == ["unplugged", SILENT]


def test_a_reason_of_before_the_capture_is_none_for_a_gap_in_it() -> None:
    kept = ledger()
    kept.interrupted("unplugged")
    kept.resumed()
    kept.enter(times(20, 50))
    assert [gap.reason for gap in closed(kept, 0, 69).gaps] == [SILENT]


def test_what_is_missing_at_the_ends_of_the_capture_is_a_gap() -> None:
    kept = ledger()
    kept.interrupted("not opened yet")
    kept.enter(times(20, 50))
    kept.interrupted("unplugged")
    account = closed(kept, 0, 100)
    assert account.gaps == (
        Gap(0, 20 * STEP_NS, "not opened yet"),
        Gap(69 * STEP_NS, 100 * STEP_NS, "unplugged"),
    )


def test_a_channel_without_a_reading_is_one_gap() -> None:
    kept = ledger()
    kept.interrupted("unplugged")
    account = closed(kept, 0, 100)
    assert account.gaps == (Gap(0, 100 * STEP_NS, "unplugged"),)
    assert Account((account,)).in_words == "with gaps: pulsation: no readings at all (unplugged)"


def test_gaps_beyond_those_listed_are_counted() -> None:
    account = ledger(times(0, 50), *(times(100 * k, 5) for k in range(1, 200))).account
    assert len(account.gaps) == MOST_LISTED
    assert account.gap_count == 199


def test_anomalies_are_counted_by_reason_with_the_first_example() -> None:
    anomalies = AnomalyLedger()
    anomalies.enter("tank", [Anomaly(5, "not a number", "4x2", 1), Anomaly(9, "not a number", "--", 2)])
    anomalies.enter("hose", [Anomaly(7, "repeated line", "42.0")])
    counts = [one[:4] + one[4:] for one in anomalies.counts]
    assert counts == [("tank", "not a number", 2, 3, 5, "4x2"), ("hose", "repeated line", 1, 0, 7, "42.0")]


def test_a_lost_reading_leaves_a_channel_incomplete_and_a_repeated_one_does_not() -> None:
    account = closed(ledger(times(0, 50)), 0, 49)
    anomalies = AnomalyLedger()
    anomalies.enter("tank", [Anomaly(7, "repeated line", "42.0")])
    assert Account((account,), anomalies.counts).in_words == "complete: tank: 1 × repeated line"
    anomalies.enter("tank", [Anomaly(7, "not a number", "4x", 1)])
    assert Account((account,), anomalies.counts).verdict == "with gaps"


def test_a_logger_that_says_ever_new_nonsense_fills_no_memory() -> None:
    anomalies = AnomalyLedger()
    anomalies.enter("tank", [Anomaly(k, f"{k:0500d}", "x" * 9000, 1) for k in range(1000)])
    anomalies.enter("tank", [Anomaly(k, f"reason {k}", "", 1) for k in range(1000)])
    assert len(anomalies.counts) <= MOST_LISTED + 1
    assert anomalies.counts[-1].reason == OTHER
    assert sum(one.times for one in anomalies.counts) == 2000
    assert max(len(one.example) for one in anomalies.counts) <= 200
