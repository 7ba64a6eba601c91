"""From the stamps of buffers to times and numbers of fields, all the way to the numbering."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.core.field import BOTTOM, TOP
from grabberd.core.ledger import Outcome
from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition import GrabbedField, StreamInfo
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.fields import FieldTimes, Granted, LaidField, Layout, Stamp
from grabberd_v4l2.negotiation import picture_bytes
from grabberd_v4l2.node import Capability
from grabberd_v4l2.profiles import Profiles
from instrument.acquisition.streams import Numbering

PROFILES = Profiles.load()
MS = 1_000_000
PERIOD_NS = 20 * MS
START_NS = 7_000_000_000_000
MONOTONIC = abi.BUF_FLAG_TIMESTAMP_MONOTONIC
UNKNOWN, COPY = 0, 0x4000
MIDDLE_NS = PERIOD_NS + PERIOD_NS // 2
"""From the middle of an exposure to the end of its read-out."""


def profile_of(driver, **changes):
    return PROFILES.of(driver).model_copy(update=changes)


def layout_of(arrangement=Arrangement.INTERLACED, older=TOP):
    lines = 576 if arrangement in (Arrangement.INTERLACED, Arrangement.SEQ_TB) else 288
    granted = Granted(8, lines, 8, "GREY", int(arrangement), "PAL", Capability("vivid", "vivid", "", 0), 8)
    return Layout.of(granted, PROFILES.of("vivid"), older)


def laid(*ages, parity=TOP):
    return [LaidField(np.zeros((1, 1), np.uint8), parity, age, slice(None)) for age in ages]


def stamp(time_ns=START_NS, flags=MONOTONIC, sequence=0, arrival_ns=START_NS + MS):
    return Stamp(time_ns, flags, sequence, arrival_ns)


# --- one buffer ---


def test_a_frame_is_stamped_when_its_newer_field_has_been_read_out():
    times = FieldTimes(layout_of(), profile_of("em28xx"))
    older, newer = times.of(stamp(sequence=3), laid(1, 0))
    assert newer.time_ns == START_NS - MIDDLE_NS
    assert older.time_ns == newer.time_ns - PERIOD_NS
    assert (older.sequence, newer.sequence) == (6, 7)


def test_a_field_of_its_own_has_the_stamp_and_the_number_of_its_buffer():
    times = FieldTimes(layout_of(Arrangement.ALTERNATE), profile_of("bttv"))
    (field,) = times.of(stamp(sequence=3), laid(0))
    assert field == (START_NS - MIDDLE_NS, 3)


def test_a_shutter_moves_the_middle_of_the_exposure_toward_its_end():
    (field,) = FieldTimes(layout_of(Arrangement.TOP), profile_of("bttv"), 2 * MS).of(stamp(), laid(0))
    assert field.time_ns == START_NS - PERIOD_NS - MS


@pytest.mark.parametrize("exposure_ns", [-1, PERIOD_NS + 1])
def test_no_field_is_exposed_for_longer_than_a_field(exposure_ns):
    with pytest.raises(DeviceRefused, match="0 to 20 ms"):
        FieldTimes(layout_of(), profile_of("bttv"), exposure_ns)


def test_stamps_of_the_start_of_a_frames_exposure_are_told_by_their_flag():
    flags = MONOTONIC | abi.BUF_FLAG_TSTAMP_SRC_SOE
    older, newer = FieldTimes(layout_of(), profile_of("vivid")).of(stamp(flags=flags), laid(1, 0))
    assert older.time_ns == START_NS + PERIOD_NS // 2
    assert newer.time_ns == START_NS + MIDDLE_NS


@pytest.mark.parametrize("flags", [UNKNOWN, COPY])
def test_stamps_of_another_clock_are_replaced_by_the_arrival(flags):
    (field,) = FieldTimes(layout_of(Arrangement.TOP), profile_of("bttv")).of(stamp(5, flags), laid(0))
    assert field.time_ns == START_NS + MS - MIDDLE_NS


def test_a_profile_may_distrust_a_drivers_stamps():
    times = FieldTimes(layout_of(Arrangement.TOP), profile_of("bttv", trusts_time=False))
    assert times.of(stamp(5), laid(0))[0].time_ns == START_NS + MS - MIDDLE_NS


def test_the_deviation_is_the_drivers_and_that_of_an_exposure_that_nobody_told():
    def sigma_ms(driver, exposure_ns=None, **changes):
        return FieldTimes(layout_of(), profile_of(driver, **changes), exposure_ns).sigma_ns / MS

    assert sigma_ms("bttv", 5 * MS) == 1.0
    assert sigma_ms("em28xx", 5 * MS) == 3.0
    assert sigma_ms("bttv", 5 * MS, trusts_time=False) == 5.0
    assert sigma_ms("bttv") == pytest.approx(np.hypot(1.0, 10 / np.sqrt(3)), abs=1e-4)


# --- the driver's count ---


def counts(sequences, arrangement=Arrangement.INTERLACED):
    times = FieldTimes(layout_of(arrangement), profile_of("vivid"))
    ages = (1, 0) if arrangement is Arrangement.INTERLACED else (0,)
    return [field.sequence for s in sequences for field in times.of(stamp(sequence=s), laid(*ages))]


def test_the_count_goes_on_where_the_drivers_wraps():
    assert counts([2**32 - 1, 0, 2]) == [2**33 - 2, 2**33 - 1, 2**33, 2**33 + 1, 2**33 + 4, 2**33 + 5]
    assert counts([2**32 - 2, 1], Arrangement.ALTERNATE) == [2**32 - 2, 2**32 + 1]


def test_a_count_that_falls_back_is_not_taken_for_a_wrap():
    assert counts([100, 0, 1], Arrangement.TOP) == [100, 0, 1]


@given(st.integers(0, 2**32 - 1), st.lists(st.integers(0, 2**31 - 1), max_size=20))
def test_any_steps_of_a_wrapping_count_are_kept(start, steps):
    sums = [start, *(start + int(s) for s in np.cumsum(steps, dtype=object))]
    assert counts([s % 2**32 for s in sums], Arrangement.TOP) == sums


# --- all the way: a driver's buffers, numbered ---


class Card:
    """A kernel's driver that stamps buffers of a camera's fields, and grabberd's way from there.

    Args:
        arrangement: of its buffers.
        driver: whose profile is used.
        shared: both fields of a frame have one number where they come one a buffer.
    """

    def __init__(self, arrangement, driver="vivid", shared=True, older=TOP):
        self.arrangement, self.shared, self.older = arrangement, shared, older
        self.layout = layout_of(arrangement, older)
        profile = profile_of(driver)
        self.times = FieldTimes(self.layout, profile)
        self.numbering = Numbering(
            StreamInfo(
                driver="v4l2",
                card="card",
                standard="PAL",
                columns=8,
                field_rows=288,
                rate_hz=self.layout.rate_hz,
                field_order=self.layout.order,
                pixel_format="GREY",
                buffers=8,
                live=True,
                counts_losses=profile.trusts_sequence,
                tells_signal=True,
                time_sigma_ns=self.times.sigma_ns,
            )
        )

    @property
    def fields_a_buffer(self):
        return 2 if self.arrangement is Arrangement.INTERLACED else 1

    def buffer(
        self, number, *, stamp_late_ns=0, sequence=None, time_ns=None, arrival_late_ns=2 * MS, flags=MONOTONIC
    ):
        """The card's buffer of this number, counted from its start."""
        if self.arrangement is Arrangement.ALTERNATE:
            said = Arrangement.TOP if number % 2 == self.older else Arrangement.BOTTOM
            over_ns, own = START_NS + number * PERIOD_NS, number // 2 if self.shared else number
        else:
            said, over_ns, own = self.arrangement, START_NS + 2 * number * PERIOD_NS, number
        stamped = Stamp(
            over_ns + stamp_late_ns if time_ns is None else time_ns,
            flags,
            (own if sequence is None else sequence) % 2**32,
            over_ns + arrival_late_ns,
        )
        if self.times.handed_back(stamped):
            return
        fields = self.layout.fields(np.zeros(picture_bytes(self.layout.granted), np.uint8), said)
        damage = "flagged" if flags & abi.BUF_FLAG_ERROR else None
        grabbed = [
            GrabbedField(field.field, *time, damage)
            for field, time in zip(fields, self.times.of(stamped, fields), strict=True)
        ]
        for field in grabbed:
            self.numbering.see(field, now_ns=stamped.arrival_ns)

    def buffers(self, numbers, **how):
        for number in numbers:
            self.buffer(number, **how)
        return self.found

    @property
    def found(self):
        """All fields so far, numbered."""
        return self.numbering.settled()


def numbers(fields):
    return [field.n for field in fields]


def losses(fields):
    return [(entry.first_n, entry.count, entry.reason) for field in fields for entry in field.lost_before]


def in_fields(kept, fields_a_buffer):
    return [n * fields_a_buffer + i for n in kept for i in range(fields_a_buffer)]


EVERY_WAY = pytest.mark.parametrize(
    ("arrangement", "driver", "shared"),
    [
        (Arrangement.INTERLACED, "em28xx", True),
        (Arrangement.INTERLACED, "vivid", True),
        (Arrangement.ALTERNATE, "saa7146 v4l2", False),
        (Arrangement.ALTERNATE, "bttv", True),
        (Arrangement.ALTERNATE, "vivid", False),
        (Arrangement.TOP, "saa7134", True),
        (Arrangement.TOP, "vivid", True),
    ],
)


@EVERY_WAY
def test_a_lost_buffer_is_found_in_time(arrangement, driver, shared):
    card = Card(arrangement, driver, shared)
    kept = [0, 1, 2, 3, *range(5, 15)]
    found = card.buffers(kept)
    assert numbers(found) == in_fields(kept, card.fields_a_buffer)
    assert losses(found) == [(4 * card.fields_a_buffer, card.fields_a_buffer, "time gap")]
    assert all(field.outcome is Outcome.RECEIVED and field.reason is None for field in found)


@EVERY_WAY
@settings(max_examples=60)
@given(
    gaps=st.lists(st.integers(0, 5), min_size=1, max_size=60),
    jitter_ns=st.integers(0, 8 * MS),
    random=st.randoms(use_true_random=False),
)
def test_losses_are_found_through_batches_of_eight_milliseconds(
    arrangement, driver, shared, gaps, jitter_ns, random
):
    card = Card(arrangement, driver, shared)
    kept = np.cumsum([gap + 1 for gap in (*[0] * 10, *gaps, *[0] * 10)]).tolist()
    kept = [number - kept[0] for number in kept]
    for number in kept:
        card.buffer(number, stamp_late_ns=random.randint(0, jitter_ns))
    found = card.found
    assert numbers(found) == in_fields(kept, card.fields_a_buffer)
    assert all(field.reason is None or "uncertain" in field.reason for field in found)


@EVERY_WAY
def test_stamps_that_lie_in_the_near_future_are_believed(arrangement, driver, shared):
    card = Card(arrangement, driver, shared)
    kept = [*range(10), *range(12, 22)]
    found = card.buffers(kept, stamp_late_ns=31 * MS)
    assert numbers(found) == in_fields(kept, card.fields_a_buffer)
    assert all(field.reason is None for field in found)


@pytest.mark.parametrize(
    ("arrangement", "shared"),
    [
        (Arrangement.INTERLACED, True),
        (Arrangement.ALTERNATE, True),
        (Arrangement.ALTERNATE, False),
        (Arrangement.TOP, True),
    ],
)
@pytest.mark.parametrize("start", [0, 2**32 - 3])
def test_where_stamps_fail_a_counting_driver_tells_of_losses(arrangement, shared, start):
    card = Card(arrangement, "vivid", shared)
    own = [n // 2 if shared and arrangement is Arrangement.ALTERNATE else n for n in range(22)]
    kept = [*range(9), *range(11, 22)]
    for n in kept:
        card.buffer(n, sequence=start + own[n], time_ns=None if n < 8 else 0)
    found = card.found
    assert numbers(found) == in_fields(kept, card.fields_a_buffer)
    assert losses(found) == [(9 * card.fields_a_buffer, 2 * card.fields_a_buffer, "sequence gap")]
    predicted = {field.reason for field in found[8 * card.fields_a_buffer :]}
    assert predicted == {"time predicted (zero timestamp)"}


def test_a_lost_field_before_an_early_stamp_is_told_by_the_count():
    card = Card(Arrangement.TOP)
    card.buffers(range(5))
    card.buffer(6, stamp_late_ns=-25 * MS)
    assert losses(card.buffers(range(7, 17))) == [(5, 1, "sequence gap")]


def test_buffers_that_a_driver_hands_back_when_it_gives_up_are_no_fields():
    card = Card(Arrangement.ALTERNATE, "bttv")
    card.buffers(range(10))
    flags = MONOTONIC | abi.BUF_FLAG_ERROR
    for number in (34, 35, 36, 37):
        card.buffer(number, time_ns=START_NS + 34 * PERIOD_NS, sequence=5, flags=flags)
    found, received = card.buffers(range(35, 60)), Outcome.RECEIVED
    assert [field.outcome for field in found[:11]] == [*[received] * 10, Outcome.DAMAGED]
    assert numbers(found[11:]) == list(range(35, 60))
    # Nothing but a stamp that jumped tells how long it took: arrivals in a row have to confirm it.
    doubtful = [field.n for field in found[11:] if field.outcome is not received]
    assert doubtful == list(range(35, 35 + len(doubtful)))
    assert len(doubtful) <= 12
    assert all("number uncertain" in field.reason for field in found[11 : 11 + len(doubtful)])


@pytest.mark.parametrize("back_at", [36, 38, 60, 200])
def test_fields_that_come_a_while_after_a_driver_has_given_up_are_certain(back_at):
    card = Card(Arrangement.ALTERNATE, "bttv")
    card.buffers(range(10))
    for _ in range(4):  # all at once
        flags = MONOTONIC | abi.BUF_FLAG_ERROR
        card.buffer(34, sequence=5, flags=flags)
    found = card.buffers(range(back_at, back_at + 25))
    assert numbers(found[11:]) == list(range(back_at, back_at + 25))
    assert {field.outcome for field in found[11:]} == {Outcome.RECEIVED}


@pytest.mark.parametrize("arrangement", [Arrangement.INTERLACED, Arrangement.ALTERNATE])
def test_losses_are_found_where_the_bottom_field_is_the_older(arrangement):
    card = Card(arrangement, "usbtv", older=BOTTOM)
    kept = [0, 1, 2, 4, *range(6, 16)]
    assert numbers(card.buffers(kept)) == in_fields(kept, card.fields_a_buffer)


@EVERY_WAY
def test_one_flagged_buffer_is_a_damaged_field_like_any_other(arrangement, driver, shared):
    card = Card(arrangement, driver, shared)
    card.buffers(range(4))
    card.buffer(4, flags=MONOTONIC | abi.BUF_FLAG_ERROR)
    found = card.buffers([5])
    assert numbers(found) == in_fields(range(6), card.fields_a_buffer)
    damaged = [field.n for field in found if field.outcome is Outcome.DAMAGED]
    assert damaged == in_fields([4], card.fields_a_buffer)


def test_a_frame_that_stands_still_is_not_lost():
    card = Card(Arrangement.INTERLACED, "em28xx")
    card.buffers(range(3))
    card.buffer(3, time_ns=START_NS + 4 * PERIOD_NS)
    found = card.found[6:]
    assert numbers(found) == [6, 7]
    assert [field.reason for field in found] == ["time predicted (early timestamp)"] * 2


def test_times_are_smoothed_to_the_middle_of_the_exposures():
    card = Card(Arrangement.INTERLACED, "em28xx")
    rng = np.random.default_rng(4)
    late = rng.integers(0, 8 * MS, 1_000)
    for n in range(1_000):
        card.buffer(n, stamp_late_ns=int(late[n]))
    found = card.found
    true = START_NS - MIDDLE_NS - PERIOD_NS + PERIOD_NS * np.arange(2_000)
    errors = np.array([field.time_ns for field in found]) - true
    assert abs(errors[200:].mean() - 4 * MS) < 0.3 * MS
    assert errors[200:].std() < 0.8 * MS
