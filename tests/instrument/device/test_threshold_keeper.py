"""The keeper of the threshold: it chooses beside the capture thread, holds, and treats recordings alike."""

import threading
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from grabberd.config import DeviceConfig, RingConfig, ThresholdConfig
from grabberd.core.field import Field, double_lines, quantise
from grabberd.instrument.acquisition import Ring
from grabberd.instrument.device.threshold_keeper import (
    SHARED_S,
    UNDECIDED_THRESHOLD,
    NewestField,
    Shown,
    Threshold,
    ThresholdKeeper,
)

PATIENCE_S = 20.0


def keeper(*, live: bool = True, map: bool = False, fixed: int | None = None) -> ThresholdKeeper:
    kind = "automatic" if fixed is None else "fixed"
    threshold = ThresholdConfig(kind=kind, value=fixed, map=map)  # type: ignore[arg-type]
    one = ThresholdKeeper(DeviceConfig(driver="test", ring=RingConfig(bits=1), threshold=threshold))
    one.opened(live=live)
    return one


def ring(bits: int = 1, lines: str = "doubled") -> Ring:
    return Ring(4, bits, lines)


def picture(bright: int = 200) -> Field:
    luma = np.random.default_rng(3).integers(10, 30, (72, 96)).astype(np.uint8)
    for row in range(4, 72, 12):
        for column in range(4, 96, 12):
            luma[row : row + 3, column : column + 5] = bright
    return Field.intact(luma, 0)


DARK = picture(bright=20)


def beside(one: ThresholdKeeper, work: Callable[[], None], field: Field, configured: Ring) -> None:
    """Does some work while fields go on coming to the keeper."""
    thread = threading.Thread(target=work)
    thread.start()
    while thread.is_alive():
        one.show(field, configured)
    thread.join()


def looked(one: ThresholdKeeper, field: Field, configured: Ring) -> Threshold:
    """The threshold in force after the keeper has looked at a live picture once."""
    beside(one, one.choose_again, field, configured)
    return one.in_force


class Counted(ThresholdKeeper):
    """A keeper that notes which threads choose."""

    threads: list[int]

    def _choose(self, field: Field, configured: Ring) -> Threshold:
        self.threads.append(threading.get_ident())
        return super()._choose(field, configured)


def test_a_live_field_is_never_chosen_by_in_the_thread_that_shows_it() -> None:
    one = Counted(DeviceConfig(driver="test"))
    one.threads, configured = [], ring()
    looked(one, picture(), configured)
    assert one.threads
    assert threading.get_ident() not in one.threads


def test_the_keeper_has_a_copy_of_its_own() -> None:
    one, field, configured = keeper(), picture(), ring()
    looked(one, field, configured)
    expected = one.in_force
    seen: list[Field] = []

    class Late(ThresholdKeeper):
        def _choose(self, field: Field, configured: Ring) -> Threshold:
            buffer[:] = 0  # the driver has the buffer back before the choice is made
            seen.append(field)
            return super()._choose(field, configured)

    late = Late(DeviceConfig(driver="test"))
    buffer: NDArray[np.uint8] = field.luma.copy()
    beside(late, late.choose_again, Field.intact(buffer, 0), configured)
    assert np.array_equal(seen[0].luma, field.luma)
    assert late.in_force == expected


def test_the_automatic_threshold_follows_the_light_unless_it_is_held() -> None:
    one, configured = keeper(), ring()
    dim = looked(one, picture(80), configured)
    one.hold()
    assert looked(one, picture(220), configured) == dim
    one.release()
    assert looked(one, picture(220), configured).level > dim.level


def test_a_dark_picture_leaves_the_threshold_as_it_is() -> None:
    one, configured = keeper(), ring()
    assert looked(one, DARK, configured).level == UNDECIDED_THRESHOLD
    chosen = looked(one, picture(), configured)
    assert looked(one, DARK, configured) == chosen != Threshold(UNDECIDED_THRESHOLD)


def test_a_capture_that_begins_in_the_dark_gets_its_threshold_once_there_is_a_picture() -> None:
    one, configured = keeper(), ring()
    looked(one, DARK, configured)
    one.hold()
    chosen = looked(one, picture(80), configured)
    assert chosen.level < UNDECIDED_THRESHOLD
    assert looked(one, picture(220), configured) == chosen, "it is held from then on"


def test_a_choice_that_is_made_while_a_capture_begins_is_dropped() -> None:
    class Interrupted(ThresholdKeeper):
        def _choose(self, field: Field, configured: Ring) -> Threshold:
            chosen = super()._choose(field, configured)
            if field.luma.max() > 150:
                self.hold()
            return chosen

    one, configured = Interrupted(DeviceConfig(driver="test")), ring()
    dim = looked(one, picture(80), configured)
    assert looked(one, picture(220), configured) == dim


@pytest.mark.parametrize("first", [picture(), DARK])
def test_a_capture_waits_for_the_first_look_even_if_there_is_nothing_to_choose_by(first: Field) -> None:
    one, configured = keeper(), ring()
    one.start("test")
    try:
        beside(one, lambda: one.settle(configured), first, configured)
        assert (one.in_force.level == UNDECIDED_THRESHOLD) == (first is DARK)
    finally:
        one.stop(PATIENCE_S)


def test_a_ring_of_other_bits_has_a_threshold_of_its_own() -> None:
    one, grey = keeper(), ring(8, "field")
    one.start("test")
    try:
        doubled = ring()
        beside(one, lambda: one.settle(doubled), picture(), doubled)
        before = one.in_force
        beside(one, lambda: one.settle(grey), picture(), grey)
        assert one.in_force.level < before.level, "low for grey"
    finally:
        one.stop(PATIENCE_S)


def test_nobody_waits_for_a_fixed_threshold_or_a_recording() -> None:
    fixed = keeper(fixed=77)
    fixed.settle(ring())
    assert fixed.in_force == Threshold(77)
    keeper(live=False).settle(ring())


@pytest.mark.parametrize(("live", "fixed", "waits"), [(True, None, [0.1]), (True, 77, []), (False, None, [])])
def test_only_a_capture_whose_threshold_follows_the_light_waits_for_the_next_field(
    live: bool, fixed: int | None, waits: list[float]
) -> None:
    class Noted(threading.Event):
        def wait(self, timeout: float | None = None) -> bool:
            noted.append(timeout)
            return True

    noted: list[float | None] = []
    one = keeper(live=live, fixed=fixed)
    one._packing_next = Noted()
    one.hold()
    assert one.held
    assert noted == waits


def test_a_recordings_first_field_is_chosen_by_before_it_is_packed() -> None:
    one, configured = keeper(live=False), ring()
    one.hold()
    one.show(DARK, configured)
    assert one.in_force.level == UNDECIDED_THRESHOLD
    one.show(picture(80), configured)
    chosen = one.in_force
    assert chosen.level < UNDECIDED_THRESHOLD
    one.show(picture(220), configured)
    assert one.in_force == chosen


def test_every_capture_of_a_recording_is_chosen_for_by_its_own_first_field() -> None:
    one, configured = keeper(live=False), ring()
    one.hold()
    one.show(picture(80), configured)
    dim = one.in_force
    one.release()
    one.hold()
    one.show(picture(220), configured)
    assert one.in_force.level > dim.level


def test_a_recording_is_looked_at_between_captures_but_not_during_one() -> None:
    one, configured = keeper(live=False), ring()
    dim = looked(one, picture(80), configured)
    bright = looked(one, picture(220), configured)
    assert bright.level > dim.level
    one.hold()
    one.show(picture(80), configured)
    assert looked(one, picture(220), configured) == dim


def test_a_map_fits_the_lines_of_the_ring_and_tells_its_median() -> None:
    one, field = keeper(map=True), picture()
    for configured in (ring(), ring(1, "field")):
        by_pixel = looked(one, field, configured).by_pixel
        packed = double_lines(field) if configured.lines == "doubled" else field
        assert by_pixel is not None
        assert by_pixel.shape == packed.luma.shape
        assert quantise(packed, 1, by_pixel).threshold == one.in_force.level
        assert one.in_force.level == pytest.approx(np.median(by_pixel), abs=1)


def test_grey_has_one_threshold_for_all_pixels() -> None:
    assert looked(keeper(map=True), picture(), ring(8, "field")).by_pixel is None


def test_another_rule_is_in_force_from_the_next_look_on() -> None:
    one, configured = keeper(fixed=40), ring()
    assert looked(one, picture(), configured).level == 40
    automatic = DeviceConfig(driver="test")
    one.use(automatic)
    assert looked(one, picture(), configured) != Threshold(40)
    one.use(automatic.model_copy(update={"threshold": ThresholdConfig(kind="fixed", value=50)}))
    assert one.in_force == Threshold(50)


def test_a_recording_is_chosen_for_by_another_rule_at_its_next_field() -> None:
    one, configured = keeper(live=False, fixed=40), ring()
    one.use(DeviceConfig(driver="test"))
    one.show(picture(), configured)
    assert one.in_force.level != 40


def test_it_pauses_a_second_between_two_choices_but_not_before_the_first() -> None:
    pauses: list[float] = []

    class Rounds(threading.Event):
        """Notes the pauses, takes none, and ends the thread's work after four."""

        def wait(self, timeout: float | None = None) -> bool:
            pauses.append(timeout or 0.0)
            if len(pauses) == 4:
                one._stopping.set()
            return False

    one, configured, looks = keeper(), ring(), iter([False, True, True, True])

    def choose_again() -> None:
        if next(looks):
            one._try(picture(), configured)

    one.choose_again = choose_again  # type: ignore[method-assign]
    one._at_once = Rounds()
    one._run()
    assert pauses == [0.0, 1.0, 1.0, 1.0]


def test_a_choice_that_fails_is_logged_and_tried_again_after_a_second(
    caplog: pytest.LogCaptureFixture,
) -> None:
    pauses: list[float | None] = []

    class Once(threading.Event):
        """Notes the pause, takes none, and ends the thread's work."""

        def wait(self, timeout: float | None = None) -> bool:
            pauses.append(timeout)
            self.set()
            return True

    def choose_again() -> None:
        raise RuntimeError("a fault of the program")

    one = keeper()
    one.choose_again = choose_again  # type: ignore[method-assign]
    one._stopping = Once()
    thread = threading.Thread(target=one._run, daemon=True)
    thread.start()
    thread.join(PATIENCE_S)
    one.stop(0)
    assert pauses == [1.0]
    assert "choosing a threshold failed" in caplog.text


RING = Ring(4, 1, "field")
PATIENCE_S = 20.0


class Ticks:
    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def field(value: int) -> Field:
    return Field.intact(np.full((4, 16), value, np.uint8), 0)


def asked(newest: NewestField, askers: int = 1, value: int = 7) -> list[Shown | None]:
    """What so many get who ask for a recent field while fields of a value come."""
    got: list[Shown | None] = []
    threads = [threading.Thread(target=lambda: got.append(newest.recent(PATIENCE_S))) for _ in range(askers)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        newest.offer(field(value), RING)
    return got


def test_nothing_is_copied_while_nobody_asks() -> None:
    newest = NewestField()
    newest.offer(field(1), RING)
    assert newest.recent(0.0) is None


def test_what_is_shown_is_a_copy() -> None:
    newest, luma = NewestField(), np.full((4, 16), 7, np.uint8)
    thread = threading.Thread(target=lambda: got.append(newest.ask(PATIENCE_S)))
    got: list[Shown | None] = []
    thread.start()
    while thread.is_alive():
        newest.offer(Field.intact(luma, 0), RING)
    luma[:] = 0
    assert got[0] is not None
    assert (got[0].field.luma == 7).all()


def test_all_who_ask_at_once_get_the_same() -> None:
    got = asked(NewestField(Ticks()), askers=8)
    assert None not in got
    assert len({id(shown) for shown in got}) == 1


def test_no_more_than_five_copies_a_second_are_made() -> None:
    ticks = Ticks()
    newest = NewestField(ticks)
    [first] = asked(newest, value=1)
    ticks.now_s += SHARED_S - 0.01
    assert asked(newest, value=2) == [first]
    ticks.now_s += 0.02
    [second] = asked(newest, value=3)
    assert second is not None
    assert second.field.luma[0, 0] == 3


def test_a_field_that_does_not_come_is_none() -> None:
    assert NewestField().ask(0.001) is None
