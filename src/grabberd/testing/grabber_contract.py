"""Promises of every grabber's driver to the capture thread, as tests that a driver's own subclass, and the
clock that such tests drive it by.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from grabberd.core.field import PAL_HZ, PROGRESSIVE, FieldOrder
from grabberd.core.ledger import Outcome
from grabberd.errors import DeviceError, DeviceRefused, StreamEnded
from grabberd.instrument.acquisition import GRABBERS, FieldNumbering, Numbered, Signal, StreamInfo
from grabberd.instrument.acquisition.device import GrabbedField, Grabber

FIELDS = 40
"""Fields that a grabber must deliver without a fault; a recording has as many."""


@dataclass(frozen=True, slots=True)
class GrabberBench:
    """A grabber that delivers `FIELDS` fields without a fault, and what it is expected to be.

    Attributes:
        grabber: The grabber, not opened yet.
        rate_hz: Fields or whole pictures a second.
        ends: True for a recording: it has `FIELDS` fields and then ends.
        resets: True if software can reset the device; otherwise `reset` refuses.
        waits: True if fields come when they are due; False if as fast as they are read.
        time_error_ns: How far apart two fields' times may be from one period: the clock is the test's own,
            a real device needs more.
    """

    grabber: Grabber
    rate_hz: float = PAL_HZ
    ends: bool = False
    resets: bool = False
    waits: bool = True
    time_error_ns: int = 1_000


class GrabberContract:
    """The contract of `grabberd.instrument.acquisition.device`; a subclass has a fixture `bench`."""

    @pytest.fixture
    def bench(self) -> GrabberBench:
        """The grabber that is tested."""
        raise NotImplementedError("the test's class needs a fixture `bench` that returns a GrabberBench")

    @pytest.fixture
    def grabber(self, bench: GrabberBench) -> Iterator[Grabber]:
        """The bench's grabber, closed after the test."""
        yield bench.grabber
        bench.grabber.close()

    @pytest.fixture
    def info(self, grabber: Grabber) -> StreamInfo:
        """The stream that the grabber grants when it is opened."""
        return grabber.open()

    def test_it_says_what_was_granted(self, bench: GrabberBench, info: StreamInfo) -> None:
        assert isinstance(info, StreamInfo)
        assert info.driver in GRABBERS.available(), "its name is not that of an installed entry point"
        assert info.rate_hz == bench.rate_hz
        assert info.buffers >= 1

    def test_its_fields_are_what_was_granted(self, grabber: Grabber, info: StreamInfo) -> None:
        for grabbed in take(grabber):
            luma = grabbed.field.luma
            assert luma.shape == (info.field_rows, info.columns)
            assert luma.dtype == np.uint8
            assert grabbed.damage is None

    def test_its_rows_lie_on_the_frame_lines_of_their_parity(
        self, grabber: Grabber, info: StreamInfo
    ) -> None:
        for field in (grabbed.field for grabbed in take(grabber)):
            assert (field.y0, field.y_step) in ((field.parity, 2), (0, 1))

    def test_its_parities_alternate_from_the_older(self, grabber: Grabber, info: StreamInfo) -> None:
        parities = [grabbed.field.parity for grabbed in take(grabber)]
        if not info.field_order.has_parity:
            assert len(set(parities)) == 1
            assert (parities[0] == PROGRESSIVE) == (info.field_order is FieldOrder.PROGRESSIVE)
            return
        assert all(a != b for a, b in pairwise(parities))
        if info.field_order is FieldOrder.TOP_FIRST:
            assert parities[0] == 0
        if info.field_order is FieldOrder.BOTTOM_FIRST:
            assert parities[0] == 1

    def test_its_times_are_whole_nanoseconds_one_period_apart(
        self, bench: GrabberBench, grabber: Grabber, info: StreamInfo
    ) -> None:
        times = [grabbed.time_ns for grabbed in take(grabber)]
        assert all(isinstance(time_ns, int) for time_ns in times)
        assert np.abs(np.diff(times) - 1e9 / info.rate_hz).max() < bench.time_error_ns

    def test_its_count_grows_by_one_a_field_or_a_frame(self, grabber: Grabber, info: StreamInfo) -> None:
        counts = [grabbed.sequence for grabbed in take(grabber)]
        if not info.counts_losses and set(counts) == {None}:
            return
        steps = np.diff(np.array(counts, np.int64)).tolist()
        frames_share_a_number = info.field_order is FieldOrder.ALTERNATE and 0 in steps
        assert steps == ([0, 1] * FIELDS)[: len(steps)] if frames_share_a_number else set(steps) == {1}

    def test_its_fields_are_numbered_without_a_gap(self, grabber: Grabber, info: StreamInfo) -> None:
        found = _numbered(take(grabber), info, grabber.signal())
        assert [field.n for field in found][:FIELDS] == list(range(FIELDS))
        assert {field.outcome for field in found} == {Outcome.RECEIVED}
        assert {field.reason for field in found} == {None}

    def test_its_pictures_differ_from_field_to_field(self, grabber: Grabber, info: StreamInfo) -> None:
        pictures = [grabbed.field.luma.tobytes() for grabbed in take(grabber, 12)]
        assert len(set(pictures)) == len(pictures)

    def test_leaving_the_block_gives_the_buffer_back_also_after_an_error(
        self, grabber: Grabber, info: StreamInfo
    ) -> None:
        for _ in range(min(3 * info.buffers, FIELDS // 2 - 1)):
            with pytest.raises(ZeroDivisionError):
                _fail_inside(grabber)
        assert take(grabber, 1)

    def test_its_signal_can_be_asked_at_any_time(self, grabber: Grabber) -> None:
        assert grabber.signal() in tuple(Signal)
        info = grabber.open()
        take(grabber, 1)
        assert grabber.signal() is (Signal.PRESENT if info.tells_signal else Signal.UNKNOWN)

    def test_it_tells_what_the_program_has_waited_for(self, grabber: Grabber, info: StreamInfo) -> None:
        before_ns = grabber.called_ns
        take(grabber, 3)
        assert 0 <= before_ns <= grabber.called_ns
        assert isinstance(grabber.found_empty, bool)

    def test_nothing_comes_from_a_driver_that_is_not_open(self, grabber: Grabber) -> None:
        with pytest.raises(DeviceError, match="not open") as caught, grabber.dequeue(0.0):
            pass
        assert caught.value.hint

    def test_nothing_comes_from_a_driver_that_was_closed(self, grabber: Grabber, info: StreamInfo) -> None:
        take(grabber, 1)
        grabber.close()
        with pytest.raises(DeviceError), grabber.dequeue(0.0):
            pass

    def test_it_can_be_closed_twice_and_without_having_been_open(self, grabber: Grabber) -> None:
        grabber.close()
        grabber.open()
        grabber.close()
        grabber.close()

    def test_it_can_be_restarted_while_it_is_open(self, grabber: Grabber, info: StreamInfo) -> None:
        take(grabber, 3)
        assert grabber.restart() == info
        assert len(take(grabber, 3)) >= 3

    def test_what_is_not_open_cannot_be_restarted(self, grabber: Grabber) -> None:
        with pytest.raises(DeviceError, match="not open") as caught:
            grabber.restart()
        assert caught.value.hint

    def test_a_reset_leaves_it_closed_and_able_to_be_opened_or_says_why_it_cannot(
        self, bench: GrabberBench, grabber: Grabber, info: StreamInfo
    ) -> None:
        grabber.close()
        if bench.resets:
            grabber.reset()
        else:  # a recording, say, or a card that is not on USB
            with pytest.raises(DeviceRefused) as caught:
                grabber.reset()
            assert caught.value.hint
        assert grabber.open() == info
        take(grabber, 1)

    def test_it_can_be_opened_again(self, grabber: Grabber, info: StreamInfo) -> None:
        take(grabber, 3)
        grabber.close()
        assert grabber.open() == info
        assert len(take(grabber, 3)) >= 3

    def test_a_recording_ends_and_a_device_does_not(
        self, bench: GrabberBench, grabber: Grabber, info: StreamInfo
    ) -> None:
        take(grabber, FIELDS)
        if not bench.ends:
            assert take(grabber, 1)
            return
        for _ in range(2):
            with pytest.raises(StreamEnded), grabber.dequeue(1.0):
                pass

    def test_nothing_comes_before_it_is_due(self, bench: GrabberBench, grabber: Grabber) -> None:
        if not bench.waits:
            pytest.skip("its fields come as fast as they are read")
        grabber.open()
        take(grabber, 1)
        with grabber.dequeue(0.001) as fields:
            assert len(fields) == 0
        assert take(grabber, 1)

    def test_an_unknown_option_is_refused_by_name(self, bench: GrabberBench) -> None:
        with pytest.raises((ValueError, TypeError), match="no_such_option"):
            type(bench.grabber)(no_such_option=1)  # type: ignore[call-arg]


def take(grabber: Grabber, count: int = FIELDS) -> list[GrabbedField]:
    """At least so many fields of an open grabber, copied out of its buffers."""
    taken: list[GrabbedField] = []
    while len(taken) < count:
        with grabber.dequeue(1.0) as fields:
            assert fields, "nothing came within a second"
            taken.extend(_copied(field) for field in fields)
    return taken


def _copied(grabbed: GrabbedField) -> GrabbedField:
    """A grabbed field that stays when its buffer is given back."""
    field = grabbed.field
    return grabbed._replace(field=type(field)(np.array(field.luma), field.parity, field.y0, field.y_step))


def _fail_inside(grabber: Grabber) -> None:
    with grabber.dequeue(1.0) as fields:
        assert fields
        raise ZeroDivisionError


def _numbered(taken: Sequence[GrabbedField], info: StreamInfo, signal: Signal) -> list[Numbered]:
    """The fields as the program numbers them, without their arrivals."""
    numbering = FieldNumbering(info, taken[0].time_ns)
    found = [one for grabbed in taken for one in numbering.number(grabbed, signal)]
    return [*found, *numbering.settle()]


class ManualClock:
    """Stands still until somebody waits on it, and then jumps to the end of the wait.

    Attributes:
        time_ns: The time that it shows, as CLOCK_MONOTONIC would.
    """

    def __init__(self) -> None:
        self.time_ns = 77_000_000_000

    def now_ns(self) -> int:
        """The time that it shows."""
        return self.time_ns

    def sleep(self, seconds: float) -> None:
        """Jump forward by so many seconds."""
        self.time_ns += max(0, round(seconds * 1e9))

    def sleep_until_ns(self, time_ns: int) -> None:
        """Jump forward to a time."""
        self.time_ns = max(self.time_ns, time_ns)
