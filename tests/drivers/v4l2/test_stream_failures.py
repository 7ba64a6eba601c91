"""A stream on a card with faults: what the capture thread gets to see of each of them."""

import errno

import pytest

from drivers.v4l2.bench import card_with, dongle
from drivers.v4l2.taking import SECOND_NS, fails, numbered, take
from grabberd.errors import DeviceLost, StreamFailed
from grabberd_v4l2 import abi


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
    assert "has disappeared" in fails(bench, DeviceLost).message
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
