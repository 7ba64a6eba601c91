"""Whatever goes wrong, the account of fields is true, or says by how much it may be off."""

from dataclasses import replace
from random import Random

import pytest

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import LedgerEntry, LedgerEvent, Outcome, Rebase, numbers_off

from .judging import Account, judged, judged_case
from .simulation import Simulation
from .weather import PAIRS, ROWS, Case, drawn
from .world import CABLE, COMPUTER, Camera, Driver, Loss, Span, Weather

SEEDS = range(30)
"""A minute of the ten thousand: `make audit` runs them all."""
MENDED = [
    477, 912, 1049, 1598, 2079, 2101, 3035, 3219, 3349, 4023, 4107, 4339, 4358, 5591, 5606, 5743, 5759,
    6048, 6215, 6278, 12224, 12255, 12393, 12801, 13303, 20434, 21943, 23250, 23493, 24172,
]  # fmt: skip
"""Weather in which an account once lied."""


@pytest.mark.parametrize("seed", [*SEEDS, *MENDED])
def test_no_account_lies(seed: int) -> None:
    assert judged(seed).lies == ()


def test_a_seed_plays_again_to_the_letter() -> None:
    assert judged(1) == judged(1)
    assert drawn(1) != drawn(1 + len(PAIRS)), "the same pair at other times"


def test_every_pair_of_rows_comes_unless_one_replaces_the_other() -> None:
    met = {frozenset(drawn(seed).names[:2]) for seed in range(len(PAIRS))}
    met |= {frozenset(drawn(seed).names[:1]) for seed in range(len(PAIRS))}
    missing = [(a, b) for a in ROWS for b in ROWS if frozenset((a, b)) not in met]
    assert all(ROWS[a].of == ROWS[b].of != "" for a, b in missing)
    assert {"stamps of unknown clock, zero", "freeze of seconds"} in met


def case(weather: Weather, begin_s: float = 2.0, end_s: float = 6.0) -> Case:
    return Case(3, (), weather, begin_s, end_s, pre_fields=10, fields=None)


ORDERS = pytest.mark.parametrize("order", [FieldOrder.ALTERNATE, FieldOrder.TOP_FIRST])
COUNTS = pytest.mark.parametrize("counts", ["fields", "nothing"])


@COUNTS
@ORDERS
@pytest.mark.parametrize("freezes", [1, 2])
@pytest.mark.parametrize("freeze_s", [0.6, 6.0])
def test_a_capture_after_a_freeze_is_complete_with_its_numbers_and_times(
    freeze_s: float, freezes: int, order: FieldOrder, counts: str
) -> None:
    begins_s = [1.0 + (freeze_s + 1.0) * i for i in range(freezes)]
    over_s = begins_s[-1] + freeze_s + 1.0
    frozen = [Span(at_s, at_s + freeze_s) for at_s in begins_s]
    weather = Weather(order, counts=counts, buffers=16, usb_ms=2.0, freezes=frozen)
    found = judged_case(case(weather, over_s, over_s + 3.0))
    assert found.lies == ()
    assert found.complete
    assert found.fields >= 150


@COUNTS
@ORDERS
@pytest.mark.parametrize("mean_ms", [30, 60])
def test_stamps_of_arrivals_on_a_busy_computer_are_accounted_for(
    order: FieldOrder, counts: str, mean_ms: int
) -> None:
    """A queue that drains looks like losses; that as many were not lost is told when it is known."""
    busy = [Span(3.0, 6.0, mean_ms)]
    weather = Weather(order, counts=counts, source="read", buffers=16, usb_ms=2.0, busy=busy)
    assert judged_case(case(weather, end_s=8.0)).lies == ()


def account() -> Account:
    """That of a capture that has lost three frames on the bus and said so."""
    lost = Loss(Span(3.0, 3.11), "all", True, 1, 1, 0)
    run = Simulation(case(Weather(counts="fields", losses=[lost])))
    run.run()
    return Account(run)


def kinds_of_lies(said: Account) -> set[str]:
    return {kind for kind, _ in said.lies()}


def test_a_true_account_has_no_lie() -> None:
    assert kinds_of_lies(account()) == set()


@pytest.mark.parametrize(
    ("off", "stated", "is_lie"), [(1, 0, True), (2, 1, True), (2, 2, False), (-2, 2, False)]
)
def test_a_number_that_is_off_by_more_than_it_says_is_a_lie(off: int, stated: int, is_lie: bool) -> None:
    said = account()
    one = said.fields[30]
    slot = one.slot._replace(n=one.slot.n + off, outcome=Outcome.DAMAGED)
    said.fields[30] = one._replace(slot=slot, stated=stated)
    assert ("number" in kinds_of_lies(said)) == is_lie


@pytest.mark.parametrize(
    ("off_ms", "stated", "is_lie"), [(22, 0, True), (-22, 0, True), (15, 0, False), (35, 1, False)]
)
def test_a_time_outside_its_bound_is_a_lie(off_ms: int, stated: int, is_lie: bool) -> None:
    said = account()
    one = said.fields[30]
    slot = one.slot._replace(time_ns=one.slot.time_ns + off_ms * 1_000_000)
    said.fields[30] = one._replace(slot=slot, stated=stated)
    assert ("time" in kinds_of_lies(said)) == is_lie


def test_blame_for_what_did_not_happen_is_a_lie() -> None:
    said = account()
    index = next(i for i, one in enumerate(said.fields) if one.slot.lost_before)
    (entry,) = said.fields[index].slot.lost_before
    assert entry.count == 6
    blamed = entry._replace(reason="program stopped (for 0.2 s)")
    slot = said.fields[index].slot._replace(lost_before=(blamed,))
    said.fields[index] = said.fields[index]._replace(slot=slot)
    assert kinds_of_lies(said) == {"cause"}


def test_an_event_that_has_not_happened_is_a_lie() -> None:
    said = account()
    said.events.append(LedgerEvent(20, Rebase.COUNT, "the driver's count has restarted, to 0"))
    assert kinds_of_lies(said) == {"event"}


def test_numbers_that_are_said_to_be_off_and_are_not_are_lies() -> None:
    said = account()
    said.events.append(numbers_off(20, 1))
    assert kinds_of_lies(said) == {"number"}


def test_a_flagged_picture_that_passes_for_intact_is_a_lie() -> None:
    said = account()
    said.fields[20] = said.fields[20]._replace(handed=said.fields[20].handed._replace(flagged=True))
    assert kinds_of_lies(said) == {"picture"}


def test_an_account_that_goes_beyond_its_stop_is_a_lie() -> None:
    said = account()
    end_n = said.ledger.end_n or 0
    said.ledger.add(LedgerEntry(end_n, 5, Outcome.LOST, "time gap"))
    assert kinds_of_lies(said) == {"end"}


def driver(weather: Weather) -> Driver:
    made = Driver(weather, Camera(weather, 0, 0.5), 0, Random(1))
    made.stream_on(0)
    return made


def test_a_driver_drops_and_counts_what_comes_while_no_buffer_is_free() -> None:
    made = driver(Weather(FieldOrder.ALTERNATE, counts="fields", buffers=4))
    made.run_until(1_000_000_000)
    assert [buffer.first for buffer in made.filled] == [0, 1, 2, 3]
    assert made.losses(0, 20) == {COMPUTER: 16}
    made.filled.clear()
    made.give_back(1_000_000_000)
    made.run_until(1_040_000_000)
    assert made.filled[0].sequence - 1 == made.filled[0].first, "the count includes dropped fields"


@pytest.mark.parametrize("counted", [True, False])
def test_what_is_lost_on_the_bus_is_counted_if_the_driver_notices(counted: bool) -> None:
    lost = Loss(Span(0.1, 0.2), "all", counted, 1, 1, 0)
    made = driver(Weather(FieldOrder.ALTERNATE, counts="fields", buffers=32, losses=[lost]))
    made.run_until(400_000_000)
    fields = [buffer.first for buffer in made.filled]
    counts = [buffer.sequence - made.filled[0].sequence for buffer in made.filled]
    assert made.losses(0, fields[-1]) == {CABLE: 5}
    assert counts[-1] == (fields[-1] if counted else fields[-1] - 5)


def test_both_fields_of_a_frame_share_a_count_that_begins_with_the_top_one() -> None:
    made = driver(Weather(FieldOrder.ALTERNATE, counts="frames", buffers=32))
    made.run_until(200_000_000)
    assert [buffer.sequence for buffer in made.filled][:6] == [1, 1, 2, 2, 3, 3]


def test_the_camera_that_is_slow_falls_behind() -> None:
    exact, slow = Weather(), replace(Weather(), ppm=100.0)
    behind_ns = Camera(slow, 0, 0.0).middle_ns(50 * 600) - Camera(exact, 0, 0.0).middle_ns(50 * 600)
    assert behind_ns == 60_000_000, "three fields in ten minutes"
