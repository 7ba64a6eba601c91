"""Streams at any rate are numbered by time alike: what is lost is told, and when each field was exposed."""

import numpy as np
import pytest

from grabberd.core.field import Field, FieldOrder
from grabberd.core.ledger import Outcome
from grabberd.instrument.acquisition.device import GrabbedField
from grabberd.instrument.acquisition.numbering.arrivals import Arrival, Arrivals
from grabberd.instrument.acquisition.numbering.pace import Pace
from grabberd.instrument.acquisition.numbering.stamps import Stamps
from grabberd.instrument.acquisition.numbering.timing import Timing
from instrument.acquisition.streams import START_NS, Numbering, info, lost

LUMA = np.zeros((4, 8), np.uint8)
RATES_HZ = [25.0, 50.0, 60_000 / 1001, 60.0, 100.0, 120.0]


def progressive(rate_hz, kept, *, ppm=0.0, jitter=0.0, counted=False, seed=1):
    """What becomes of a progressive camera's pictures `kept`, its clock off and its stamps late by chance."""
    period_ns = 1e9 / rate_hz * (1 + ppm * 1e-6)
    late = np.random.default_rng(seed).uniform(0, jitter, len(kept))
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, rate_hz=rate_hz, counts_losses=counted))
    for n, late_by in zip(kept, late.tolist(), strict=True):
        time_ns = START_NS + round((n + late_by) * period_ns)
        one = GrabbedField(Field.progressive(LUMA), time_ns, n if counted else None, None)
        numbering.see(one, now_ns=time_ns + round(1.5 * period_ns))
    return numbering.settled()


@pytest.mark.parametrize("counted", [False, True])
@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_every_loss_is_told_with_its_place_and_no_other_is(rate_hz, counted):
    kept = [n for n in range(2000) if n not in (300, 301, 777, 778, 779, 1500)]
    found = progressive(rate_hz, kept, ppm=80, jitter=0.2, counted=counted)
    assert [one.n for one in found] == kept
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    gaps = [entry for one in found for entry in lost(one.lost_before)]
    assert [entry[:2] for entry in gaps] == [(300, 2), (777, 3), (1500, 1)]


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_times_follow_the_cameras_clock_and_not_the_jitter(rate_hz):
    period_ns = 1e9 / rate_hz * (1 + 80e-6)
    found = progressive(rate_hz, range(1500), ppm=80, jitter=0.2)
    off = np.array([(one.time_ns - START_NS) / period_ns - one.n for one in found[500:]])
    assert np.ptp(off) < 0.05
    assert 0 <= off.min() < off.max() < 0.2


def test_a_loss_without_a_believed_stamp_is_not_told_by_a_parity_that_is_not_there():
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, rate_hz=100.0))
    for n in [*range(40), *range(43, 60)]:
        stamp_ns = 0 if n == 43 else START_NS + n * 10_000_000
        one = GrabbedField(Field.progressive(LUMA), stamp_ns, None, None)
        numbering.see(one, now_ns=START_NS + n * 10_000_000 + 15_000_000)
    found = numbering.settled()
    assert [entry for one in found for entry in lost(one.lost_before)] == [(40, 3, "time gap")]


def told(found):
    return [event.reason for one in found for event in one.rebases]


def test_a_gap_too_long_for_what_is_known_of_the_rate_is_said_to_be_uncertain():
    kept = [*range(30), *range(700, 730)]
    found = progressive(50.0, kept, ppm=2000)
    (said,) = [reason for reason in told(found) if "too high or too low" in reason]
    by_up_to = int(said.split("up to ")[1].split()[0])
    assert abs(found[30].n - 700) <= by_up_to <= 5
    assert found[30].reason == f"number uncertain by up to {by_up_to}"


@pytest.mark.parametrize("ppm", [-2000, 2000])
def test_a_count_that_fits_tells_how_long_such_a_gap_was(ppm):
    kept = [*range(30), *range(700, 730)]
    found = progressive(50.0, kept, ppm=ppm, counted=True)
    assert [one.n for one in found] == kept
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    assert not told(found)


@pytest.mark.parametrize(("fields", "steps"), [(0, -0.6), (1, 0.2), (1, 1.6), (2, 1.3), (-1, -0.4)])
def test_a_field_that_is_early_or_late_on_a_coarse_grid_is_no_gap_that_teaches_the_rate(fields, steps):
    stream = info()
    pace = Pace(stream)
    arrivals = Arrivals(stream, pace)
    timing = Timing(stream, pace, Stamps(stream, pace), arrivals)
    for n in range(40):
        stamp_ns = START_NS + (2 * n + n % 2) * 10_000_000
        arrivals.compare(Arrival(stamp_ns + 1_000_000, burst=False, joined=False), stamp_ns)
    assert arrivals.grid == pytest.approx(0.5)
    timing.bridge(fields, steps, is_counted=False)
    assert timing.period_ns == 20_000_000


@pytest.mark.parametrize("ppm", [-4000, 4000])
def test_without_stamps_the_clock_follows_the_arrivals_at_the_cameras_own_rate(ppm):
    numbering = Numbering(info(counts_losses=True))
    for n in range(2000):
        time_ns = START_NS + round(n * 20_000_000 * (1 + ppm * 1e-6))
        one = GrabbedField(Field.intact(LUMA, n % 2), 0, n, None)
        numbering.see(one, now_ns=time_ns + 30_000_000)
    found = numbering.settled()
    assert [one.n for one in found] == list(range(2000))
    assert not any(one.lost_before for one in found)
    assert abs(found[-1].time_ns - time_ns) < 4_000_000


def stamped_by(clock, rate_hz, fields, seed=1):
    """Times of fields that are stamped by a clock of its own, less when they were exposed, in periods."""
    period_ns = 1e9 / rate_hz
    draw = np.random.default_rng(seed)
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, rate_hz=rate_hz))
    for n in range(fields):
        exposed_ns = START_NS + round(n * period_ns)
        arrived_ns = exposed_ns + round((1.5 + draw.exponential(0.05)) * period_ns)
        stamp_ns = round(clock(exposed_ns) + draw.normal(0, 0.05) * period_ns)
        numbering.see(GrabbedField(Field.progressive(LUMA), stamp_ns, None, None), now_ns=arrived_ns)
    found = numbering.settled()
    assert [one.n for one in found] == [*range(fields)]
    return np.array([(one.time_ns - START_NS) / period_ns - one.n for one in found]), found


@pytest.mark.parametrize("ppm", [-500, -100, 100, 500])
def test_a_stamping_clock_of_another_rate_does_not_carry_the_times_away(ppm):
    off, found = stamped_by(lambda ns: ns + (ns - START_NS) * ppm * 1e-6, 50.0, 6000)
    assert np.abs(off).max() < 0.6
    assert not told(found)
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


@pytest.mark.parametrize("by", [-0.7, -0.6, 0.6, 0.7])
def test_a_stamping_clock_that_is_set_by_less_than_a_period_does_not_shift_the_times(by):
    set_ns = START_NS + 20_000_000_000
    off, found = stamped_by(lambda ns: ns + (ns >= set_ns) * by * 40_000_000, 25.0, 1500)
    assert np.abs(off).max() < 0.3
    assert told(found) == [f"the clock of the timestamps was set by {by * 0.04:+.3f} s"]
