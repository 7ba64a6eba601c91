"""A camera that delivers fewer pictures than granted: its own pace is followed where it counts them."""

import numpy as np
import pytest

from grabberd.core.field import Field, FieldOrder
from grabberd.core.ledger import UNCERTAIN, Outcome, Rebase
from grabberd.instrument.acquisition.device import GrabbedField
from instrument.acquisition.streams import START_NS, Numbering, info, lost

LUMA = np.zeros((4, 8), np.uint8)
GRANTED_HZ = 30.0
WAY_NS = 40_000_000


def exposed_ns(*paces, wander=0.0, seed=1):
    """Times of a camera's pictures: so many intervals of a rate each, with a stamp's own error in periods."""
    intervals = np.repeat([1e9 / hz for hz, _ in paces], [count for _, count in paces])
    times = START_NS + np.concatenate([[0.0], np.cumsum(intervals)])
    return times + np.random.default_rng(seed).normal(0, wander * 1e9 / GRANTED_HZ, len(times))


def numbered(times_ns, gone=(), *, uncounted=(), counts=True, asked_ns=0, late_ms=2.0):
    """The camera's pictures as they are numbered; those `gone` or `uncounted` do not come."""
    random = np.random.default_rng(2)
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, rate_hz=GRANTED_HZ, counts_losses=counts), asked_ns)
    missing, kept = {*gone, *uncounted}, []
    for n, time_ns in enumerate(times_ns.tolist()):
        if n in missing:
            continue
        sequence = n - sum(one < n for one in uncounted) if counts else None
        grabbed = GrabbedField(Field.progressive(LUMA), round(time_ns), sequence, None)
        numbering.see(grabbed, now_ns=round(time_ns + WAY_NS + random.exponential(late_ms * 1e6)))
        kept.append(n)
    return kept, numbering.settled()


def assert_honest(kept, found):
    """Every number is right, or it or one before it has said by how much it may be off."""
    may_be_off = 0
    for n, one in zip(kept, found, strict=True):
        if one.reason and one.reason.startswith(UNCERTAIN):
            may_be_off += int(one.reason.removeprefix(UNCERTAIN).split(";")[0])
        assert abs(one.n - n) <= may_be_off


def rates(found):
    return [event.reason for one in found for event in one.rebases if event.kind is Rebase.RATE]


@pytest.mark.parametrize("rate_hz", [29.9, 29.5, 29.0, 25.0, 20.0, 17.3, 15.0, 10.0, 7.5])
@pytest.mark.parametrize("fast", [0, 100])
def test_a_slower_camera_that_counts_is_numbered_by_its_own_pace(rate_hz, fast):
    times_ns = exposed_ns((GRANTED_HZ, fast), (rate_hz, 400), wander=0.01)
    kept, found = numbered(times_ns)
    assert [one.n for one in found] == kept
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    assert not any(one.lost_before for one in found)
    off_ns = np.array([one.time_ns for one in found]) - times_ns
    assert np.abs(off_ns[fast + 200 :]).max() < 4e6


@pytest.mark.parametrize("rate_hz", [25.0, 20.0, 15.0])
def test_its_rate_is_told_once_with_the_one_that_was_granted(rate_hz):
    _, found = numbered(exposed_ns((GRANTED_HZ, 60), (rate_hz, 300)))
    assert rates(found) == [f"the camera delivers {rate_hz:.1f} pictures a second, 30 were granted"]


def test_a_rate_that_is_a_little_off_is_followed_without_a_word():
    _, found = numbered(exposed_ns((29.4, 600)))
    assert rates(found) == []


def test_a_camera_that_becomes_quick_again_is_followed_back():
    times_ns = exposed_ns((GRANTED_HZ, 60), (15.0, 100), (GRANTED_HZ, 200))
    kept, found = numbered(times_ns)
    assert [one.n for one in found] == kept
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    assert [words.split()[3] for words in rates(found)] == ["15.0", "30.0"]


def test_light_that_fades_changes_the_pace_little_by_little():
    hz = np.concatenate([np.full(60, 30.0), np.linspace(30, 12, 150), np.full(150, 12.0)])
    times_ns = exposed_ns(*((one, 1) for one in hz))
    kept, found = numbered(times_ns)
    assert [one.n for one in found] == kept
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


@pytest.mark.parametrize("missing", ["gone", "uncounted"])
def test_losses_at_another_pace_are_told_with_their_place(missing):
    lacking = {missing: (150, 151, 220)}
    kept, found = numbered(exposed_ns((GRANTED_HZ, 60), (20.0, 240)), **lacking)
    assert [one.n for one in found] == kept
    assert [entry[:2] for one in found for entry in lost(one.lost_before)] == [(150, 2), (220, 1)]


def test_a_camera_that_does_not_count_is_never_followed_and_its_numbers_stay_uncertain():
    _, found = numbered(exposed_ns((GRANTED_HZ, 60), (20.0, 240)), counts=False)
    assert rates(found) == []
    assert sum(UNCERTAIN in (one.reason or "") for one in found[80:]) > 150


def test_every_second_picture_lost_uncounted_is_numbered_by_time():
    times_ns = exposed_ns((GRANTED_HZ, 300))
    kept, found = numbered(times_ns, [n for n in range(100, 300) if n % 2], counts=False)
    assert [one.n for one in found] == kept


def test_a_queue_that_drains_evenly_is_no_pace():
    """Stamps of arrivals: the program stood still, then took a picture every 20 ms, each the next."""
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, rate_hz=GRANTED_HZ, counts_losses=True))
    arrived_ns = START_NS
    for n in range(200):
        due_ns = START_NS + round(n * 1e9 / GRANTED_HZ)
        waits = 100 <= n < 125
        arrived_ns = max(due_ns, (START_NS + 3_600_000_000 if n == 100 else arrived_ns + 20_000_000))
        grabbed = GrabbedField(Field.progressive(LUMA), arrived_ns, n, None)
        numbering.see(grabbed, now_ns=arrived_ns, in_time=not waits)
    found = numbering.settled()
    assert rates(found) == []
    assert_honest(range(200), found)


@pytest.mark.parametrize("seed", range(10))
def test_stamps_that_jitter_by_half_a_period_are_no_other_pace(seed):
    """As on USB, whose pictures come in batches of 8 ms."""
    draw = np.random.default_rng(seed)
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, rate_hz=60.0, counts_losses=True))
    for n in range(1000):
        came_ns = START_NS + round(n * 1e9 / 60 + draw.uniform(0, 8e6))
        numbering.see(GrabbedField(Field.progressive(LUMA), came_ns, n, None), now_ns=came_ns)
    found = numbering.settled()
    assert [one.n for one in found] == [*range(1000)]
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    assert not any(one.rebases for one in found)


@pytest.mark.parametrize("seed", range(20))
def test_whatever_the_pace_a_number_is_right_or_says_by_how_much_it_may_be_off(seed):
    draw = np.random.default_rng(seed)
    paces = [
        (draw.choice([30.0, 29.7, 24.0, 20.0, 15.0, 11.0]), int(draw.integers(5, 120))) for _ in range(8)
    ]
    times_ns = exposed_ns(*paces, wander=draw.choice([0.0, 0.02, 0.05]), seed=seed)
    # Where a picture is lost uncounted as the pace changes, or beside another one, nothing tells of it.
    apart, gone = [0, *np.cumsum([count for _, count in paces])], []
    for n in draw.permutation(len(times_ns)):
        if len(gone) < 6 and np.abs(np.array([*apart, *gone]) - n).min() > 2:
            gone.append(int(n))
    kept, found = numbered(times_ns, gone[:3], uncounted=gone[3:], late_ms=draw.choice([0.5, 5.0]))
    assert_honest(kept, found)
