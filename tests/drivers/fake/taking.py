"""Fields taken from the simulated grabber, and what they say of themselves."""

from collections.abc import Callable, Iterator
from itertools import pairwise

from grabberd.instrument.acquisition.device import GrabbedField
from grabberd_fake import FakeGrabber, JumpingClock, read_stamp

MakeGrabber = Callable[..., tuple[FakeGrabber, JumpingClock]]


MS = 1_000_000


PERIOD = 20 * MS


def taken(grabber: FakeGrabber, count: int, timeout_s: float = 0.1) -> list[GrabbedField]:
    """Fields as they come, each with a copy of its picture; empty dequeues are passed over."""

    def fields() -> Iterator[GrabbedField]:
        for _ in range(count):
            with grabber.dequeue(timeout_s) as got:
                for item in got:
                    picture = item.field.luma.copy()
                    yield item._replace(field=type(item.field).intact(picture, item.field.parity))

    return list(fields())


def sequences(fields: list[GrabbedField]) -> list[int | None]:
    return [item.sequence for item in fields]


def steps(fields: list[GrabbedField]) -> list[int]:
    """How many nominal steps each field comes after the one before."""
    return [(later.time_ns - earlier.time_ns) // PERIOD for earlier, later in pairwise(fields)]


def numbers(fields: list[GrabbedField]) -> list[int | None]:
    stamps = [read_stamp(item.field.luma) for item in fields]
    return [None if stamp is None else stamp.number for stamp in stamps]
