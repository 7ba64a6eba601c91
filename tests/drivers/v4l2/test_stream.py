"""A stream on a card with faults: what the capture thread gets to see of each of them."""

import errno
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.v4l2.bench import Bench, card_with, dongle, pci_card
from drivers.v4l2.fake_kernel import field_picture, number_in
from grabberd.acquisition import FieldNumbering, FieldOrder, Outcome, Signal
from grabberd.errors import DeviceLost, DeviceRefused, StreamFailed
from grabberd_v4l2 import abi
from grabberd_v4l2.arrangement import Arrangement

SECOND_NS = 1_000_000_000


@pytest.fixture
def streaming(tmp_path):
    def make(card=None, **options):
        bench = Bench(tmp_path, card, **options)
        bench.info = bench.grabber.open()
        return bench

    return make


def take(bench, count=40, timeout_s=0.25):
    """The next fields with their pictures copied."""
    taken = []
    while len(taken) < count:
        with bench.grabber.dequeue(timeout_s) as fields:
            assert fields, "nothing came in time"
            taken += [
                one._replace(field=type(one.field).intact(one.field.luma.copy(), one.field.parity))
                for one in fields
            ]
    return taken


def numbered(bench, fields):
    numbering = FieldNumbering(bench.info)
    return [numbering.number(field, bench.grabber.signal()) for field in fields]


def first_picture(fields):
    return number_in(fields[0].field.luma)


# ---- what comes when all is well


@pytest.mark.parametrize(
    "order", ["alternate", "interlaced", "interlaced_tb", "interlaced_bt", "seq_tb", "seq_bt"]
)
@pytest.mark.parametrize("fourcc", ["GREY", "YUYV", "UYVY", "NV12"])
def test_every_field_is_bit_for_bit_what_the_camera_saw(streaming, order, fourcc):
    fields = take(streaming(card_with(padding=32), field_order=order, format=fourcc), 8)
    first = first_picture(fields)
    for number, grabbed in enumerate(fields, first):
        assert grabbed.field.parity == number % 2
        assert np.array_equal(grabbed.field.luma, field_picture(number))


@pytest.mark.parametrize("older", [0, 1])
def test_the_older_field_of_a_woven_frame_comes_first(streaming, older):
    bench = streaming(pci_card("tw68", older=older), older_field=("top", "bottom")[older])
    numbers = [number_in(grabbed.field.luma) for grabbed in take(bench, 8)]
    assert [b - a for a, b in pairwise(numbers)] == [1] * 7


def test_grey_is_a_view_into_the_kernels_buffer(streaming):
    bench = streaming(field_order="interlaced", format="GREY")
    with bench.grabber.dequeue(1.0) as fields:
        taken = next(memory for memory in bench.card.queue.memories if memory.state == 0)
        assert all(np.shares_memory(field.field.luma, taken.bytes) for field in fields)


def test_a_buffer_is_queued_again_as_soon_as_the_block_is_left(streaming):
    bench = streaming()
    for _ in range(3):
        with bench.grabber.dequeue(1.0) as fields:
            assert fields
            assert len(bench.card.queue.waiting) == 15
        assert len(bench.card.queue.waiting) == 16


def test_a_reader_that_is_late_finds_what_the_buffers_could_hold(streaming):
    bench = streaming()
    bench.kernel.sleep(5.0)
    late = numbered(bench, take(bench, 20))
    assert [field.n for field in late[:16]] == list(range(16))
    assert late[16].n > 200
    assert sum(entry.count for entry in late[16].lost_before) == late[16].n - 16


# ---- what is lost


@settings(max_examples=30)
@given(
    lost=st.sets(st.integers(1, 38), max_size=30),
    counted=st.booleans(),
    numbering=st.sampled_from(["frames", "fields"]),
    start=st.sampled_from([0, 5, 2**32 - 6]),
    order=st.sampled_from(["alternate", "interlaced", "seq_bt", "top"]),
)
def test_whatever_is_lost_every_field_has_its_place(tmp_path_factory, lost, counted, numbering, start, order):
    card = card_with(
        numbering=numbering, first_sequence=start, lost=lost, uncounted=set() if counted else lost
    )
    bench = Bench(tmp_path_factory.mktemp("bench"), card, field_order=order)
    bench.info = bench.grabber.open()
    fields = []
    while bench.card.unit - bench.card.first_unit < 40:
        fields += take(bench, 1, timeout_s=1.0)
    step = 2 if bench.info.field_order is FieldOrder.ONE_PARITY else 1
    places = [(number_in(field.field.luma) - first_picture(fields)) // step for field in fields]
    assert [found.n for found in numbered(bench, fields)] == places


def test_a_count_that_wraps_loses_nothing(streaming):
    bench = streaming(card_with(first_sequence=2**32 - 7), field_order="interlaced")
    found = numbered(bench, take(bench))
    assert [field.n for field in found] == list(range(40))


# ---- what is damaged


def test_the_drivers_error_flag_is_damage(streaming):
    bench = streaming(card_with(flagged={3}))
    assert [field.damage for field in take(bench, 5)] == [None] * 3 + ["the driver flags an error", None]


def test_a_flagged_frame_damages_both_its_fields(streaming):
    bench = streaming(card_with(flagged={1}), field_order="interlaced")
    assert [field.damage is None for field in take(bench, 6)] == [True, True, False, False, True, True]


def test_a_short_buffer_is_damage_with_its_bytes(streaming):
    bench = streaming(dongle(short={1: 207_360}))
    damage = take(bench, 4)[2].damage
    assert damage == "short: 207360 of 829440 bytes"


def test_a_buffer_without_a_byte_is_short(streaming):
    bench = streaming(card_with(short={0: 0}))
    assert take(bench, 1)[0].damage == "short: 0 of 207360 bytes"


def test_a_damaged_buffer_that_does_not_say_its_parity_is_lost(streaming):
    bench = streaming(card_with(flagged={2}, unlabelled={2}))
    with pytest.raises(AssertionError, match="nothing came"):
        take(bench, 3)
    assert first_picture(take(bench, 1)) % 2 == 1


# ---- timestamps


@pytest.mark.parametrize(
    "stamp",
    [
        lambda due_ns: 0,
        lambda due_ns: 2 * 77 * SECOND_NS - due_ns,
        lambda due_ns: due_ns + 10_000 * SECOND_NS,
    ],
    ids=["zero", "backward", "of another clock"],
)
def test_fields_with_timestamps_of_no_use_are_numbered_all_the_same(streaming, stamp):
    bench = streaming()
    good = take(bench, 10)
    bench.card.stamp = stamp
    fields = good + take(bench, 20)
    numbering = FieldNumbering(bench.info)
    found = [numbering.number(field, now_ns=bench.kernel.time_ns) for field in fields]
    assert [field.n for field in found] == list(range(30))
    assert {field.outcome for field in found} == {Outcome.RECEIVED}


def test_timestamps_that_do_not_say_their_clock_give_way_to_the_arrival(streaming):
    bench = streaming(card_with(stamp=lambda due_ns: 0, stamp_flags=0))
    fields = take(bench, 10)
    steps = np.diff([field.time_ns for field in fields])
    assert set(steps.tolist()) == {20_000_000}


# ---- errors that pass


def test_one_failed_dequeue_costs_one_buffers_field_and_no_buffer(streaming):
    bench = streaming()
    fields = take(bench, 5)
    bench.card.answers["DQBUF"].append(errno.EIO)
    fields += take(bench, 20)
    found = numbered(bench, fields)
    assert [field.n for field in found] == [*range(5), *range(6, 26)]
    assert len(bench.card.queue.waiting) == 16


def test_a_failed_dequeue_that_keeps_its_buffer_costs_nothing(streaming):
    bench = streaming(card_with(eio_takes=False))
    fields = take(bench, 5)
    bench.card.answers["DQBUF"].append(errno.EIO)
    assert [field.n for field in numbered(bench, fields + take(bench, 5))] == list(range(10))
    assert len(bench.card.queue.waiting) == 16


def test_wakes_for_nothing_are_slept_through_until_the_time_is_over(streaming):
    bench = streaming(card_with(idle_wakes=10**9))
    before_ns, calls = bench.kernel.time_ns, len(bench.kernel.calls)
    with bench.grabber.dequeue(0.25) as fields:
        assert not fields
    assert bench.kernel.time_ns - before_ns < 0.26 * SECOND_NS
    assert len(bench.kernel.calls) - calls < 300


def test_a_wake_for_nothing_is_followed_by_the_field(streaming):
    bench = streaming(card_with(idle_wakes=3))
    assert take(bench, 1)


def test_a_buffer_that_is_not_taken_back_is_offered_again(streaming):
    bench = streaming()
    bench.card.answers["QBUF"].append(errno.EINVAL)
    take(bench, 1)
    assert len(bench.card.queue.waiting) == 15
    take(bench, 30)
    assert len(bench.card.queue.waiting) == 16


def test_events_are_taken_away_so_that_polling_sleeps(streaming):
    bench = streaming()
    for _ in range(5):
        bench.card.tell(abi.EVENT_SOURCE_CHANGE)
        bench.card.tell(abi.EVENT_EOS)
    take(bench, 3)
    assert not bench.card.events
    assert bench.kernel.poll(next(iter(bench.kernel.descriptors)), 0.0) == 0


# ---- errors that do not


def fails(bench, error, timeout_s=0.25):
    before_ns = bench.kernel.time_ns
    with pytest.raises(error) as caught, bench.grabber.dequeue(timeout_s):
        pass
    assert caught.value.hint
    assert bench.kernel.time_ns - before_ns <= SECOND_NS
    return caught.value


def test_nothing_comes_from_a_stalled_card_and_nothing_blocks(streaming):
    bench = streaming()
    take(bench, 2)
    bench.card.stalled = True
    before_ns = bench.kernel.time_ns
    with bench.grabber.dequeue(0.25) as fields:
        assert not fields
    assert bench.kernel.time_ns - before_ns == 250_000_000


def test_a_queue_that_failed_has_to_be_started_again(streaming):
    bench = streaming()
    take(bench, 2)
    bench.kernel.after(0.01, lambda: setattr(bench.card.queue, "failed", True))
    assert "stopped streaming" in fails(bench, StreamFailed).message
    assert bench.grabber.restart() == bench.info
    assert len(take(bench, 20)) == 20


def test_failed_dequeues_in_a_row_end_the_stream(streaming):
    bench = streaming()
    bench.card.answers["DQBUF"].extend([errno.EIO] * 10)
    assert "Input/output error" in fails(bench, StreamFailed).message


def test_an_unknown_answer_to_a_dequeue_ends_the_stream(streaming):
    bench = streaming()
    bench.card.answers["DQBUF"].append(errno.EPIPE)
    assert "DQBUF" in fails(bench, StreamFailed).message


def test_a_card_that_takes_back_no_buffer_is_said_before_the_queue_is_empty(streaming):
    bench = streaming()
    bench.card.answers["QBUF"].extend([errno.EINVAL] * 1000)
    with pytest.raises(StreamFailed, match="7 of 16 are left"):
        take(bench, 16)


def test_an_unplug_is_noticed_at_once(streaming):
    bench = streaming()
    take(bench, 2)
    bench.kernel.after(0.013, bench.unplug)
    before_ns = bench.kernel.time_ns
    assert "went away" in fails(bench, DeviceLost).message
    assert bench.kernel.time_ns - before_ns == 13_000_000


def test_an_unplug_while_a_field_is_looked_at_is_noticed_at_the_next(streaming):
    bench = streaming()
    with bench.grabber.dequeue(1.0) as fields:
        bench.unplug()
        assert fields
    fails(bench, DeviceLost)


def test_a_card_that_is_gone_can_be_closed_and_is_found_again_under_another_node(streaming):
    bench = streaming(dongle(), usb="05e1:0408")
    take(bench, 2)
    bench.unplug()
    fails(bench, DeviceLost)
    bench.grabber.close()
    assert bench.nothing_is_left_behind()
    bench.plug(3)
    info = bench.grabber.open()
    assert info.details["node"].endswith("video3")
    assert take(bench, 4)


# ---- camera and standard


def until_it_fails(bench, seconds):
    """Takes fields and asks for the signal once a second, as the capture thread does."""
    end_ns = bench.kernel.time_ns + seconds * SECOND_NS
    asked_ns = 0
    while bench.kernel.time_ns < end_ns:
        take(bench, 1)
        if bench.kernel.time_ns - asked_ns >= SECOND_NS:
            asked_ns = bench.kernel.time_ns
            bench.grabber.signal()


@pytest.mark.parametrize("tells", ["enuminput", "querystd"])
def test_a_camera_that_is_gone_is_told_where_the_card_tells(streaming, tells):
    bench = streaming(card_with() if tells == "enuminput" else dongle())
    assert bench.info.tells_signal
    assert bench.grabber.signal() is Signal.PRESENT
    bench.card.camera = 0
    assert bench.grabber.signal() is Signal.ABSENT
    assert len(take(bench, 4)) == 4
    bench.card.camera = abi.STD_PAL
    assert bench.grabber.signal() is Signal.PRESENT


def test_nothing_is_told_of_the_signal_where_the_card_does_not_tell(streaming):
    bench = streaming(dongle(driver="usbtv", tells="none"))
    assert not bench.info.tells_signal
    bench.card.camera = 0
    assert bench.grabber.signal() is Signal.UNKNOWN


def test_no_camera_is_not_taken_for_a_camera_of_60_hz(streaming):
    bench = streaming()
    bench.card.camera = 0
    until_it_fails(bench, 5)


def test_a_camera_that_turns_to_60_hz_ends_the_stream_within_two_seconds(streaming):
    bench = streaming()
    until_it_fails(bench, 2)
    bench.card.camera = 0x1000
    before_ns = bench.kernel.time_ns
    with pytest.raises(StreamFailed, match="60 Hz"):
        until_it_fails(bench, 10)
    assert bench.kernel.time_ns - before_ns < 2 * SECOND_NS


def test_an_event_shortens_the_time_until_a_camera_of_60_hz_is_noticed(streaming):
    bench = streaming()
    take(bench, 2)
    bench.card.set_camera(0x1000)
    before_ns = bench.kernel.time_ns
    with pytest.raises(StreamFailed, match="60 Hz"):
        take(bench, 1000)
    assert bench.kernel.time_ns - before_ns < 0.4 * SECOND_NS


def test_a_decoder_that_sees_60_hz_for_a_moment_ends_nothing(streaming):
    bench = streaming()
    bench.card.set_camera(0x1000)
    bench.kernel.after(0.1, lambda: bench.card.set_camera(abi.STD_PAL))
    until_it_fails(bench, 4)


def test_a_card_that_others_set_to_ntsc_is_set_to_pal_again(streaming):
    bench = streaming(dongle(driver="usbtv", tells="none"))
    bench.card.standard = 0x1000
    with pytest.raises(StreamFailed, match="another program"):
        until_it_fails(bench, 10)
    assert bench.grabber.restart().standard == "PAL"
    assert bench.card.standard == abi.STD_PAL


def test_an_alternating_card_that_does_not_tell_the_parity_is_refused(streaming):
    bench = streaming(card_with(unlabelled={0}, orders=(Arrangement.ALTERNATE,)))
    assert "which" in fails(bench, DeviceRefused).message
