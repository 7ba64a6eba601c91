"""Streams at any rate are numbered by time alike: what is lost is told, and when each field was exposed."""

import numpy as np
import pytest

from grabberd.core.field import Field, FieldOrder
from grabberd.core.ledger import Outcome
from grabberd.instrument.acquisition.device import GrabbedField
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
