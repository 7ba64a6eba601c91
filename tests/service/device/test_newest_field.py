"""A copy of the newest field for who asks."""

import threading

import numpy as np

from grabberd.acquisition import Ring
from grabberd.field import Field
from grabberd.service.device.configured_ring import ConfiguredRing
from grabberd.service.device.newest_field import EVERY_S, NewestField, Shown

RING = ConfiguredRing(Ring(4), 1, "field")
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
    ticks.now_s += EVERY_S - 0.01
    assert asked(newest, value=2) == [first]
    ticks.now_s += 0.02
    [second] = asked(newest, value=3)
    assert second is not None
    assert second.field.luma[0, 0] == 3


def test_a_field_that_does_not_come_is_none() -> None:
    assert NewestField().ask(0.001) is None
