"""Streams of fields without pictures, for the tests of the numbering."""

import numpy as np

from grabberd.core.field import Field, FieldOrder
from grabberd.instrument.acquisition.device import GrabbedField, Signal, StreamInfo
from grabberd.instrument.acquisition.numbering import FieldNumbering
from grabberd.instrument.acquisition.numbering.standstill import Standstill, StandstillOfDriver

MS = 1_000_000
PERIOD_NS = 20_000_000
START_NS = 5_000_000_000_000
_LUMA = np.zeros((4, 8), np.uint8)


def info(field_order=FieldOrder.ALTERNATE, rate_hz=50.0, live=True, counts_losses=False, waits=False):
    return StreamInfo(
        driver="test",
        card="test",
        standard="PAL",
        columns=8,
        field_rows=4,
        rate_hz=rate_hz,
        field_order=field_order,
        pixel_format="GREY",
        buffers=8,
        live=live,
        counts_losses=counts_losses,
        tells_signal=True,
        time_sigma_ns=1_000_000,
        waits_for_reader=waits,
    )


def grab(n, *, late_ns=0, time_ns=None, parity=None, sequence=None, damage=None):
    """The camera's field `n`; even ones are top fields."""
    parity = n % 2 if parity is None else parity
    time_ns = START_NS + n * PERIOD_NS + late_ns if time_ns is None else time_ns
    return GrabbedField(Field.intact(_LUMA, parity), time_ns, sequence, damage)


class Numbering:
    """Numbers a stream that is asked for as it begins, field by field, and keeps what has been settled.

    Args:
        stream: As the driver grants it.
        asked_ns: Time before its first field at which it is asked for.
    """

    def __init__(self, stream=None, asked_ns=0):
        self._stream = stream or info()
        self._asked_ns = asked_ns
        self._begun = None
        self.found = []

    @property
    def _numbering(self):
        assert self._begun is not None, "no field has come yet"
        return self._begun

    def number(self, grabbed, *args, **more):
        """The field itself, as later ones could still correct it."""
        self.see(grabbed, *args, **more)
        return self.settled()[-1]

    def see(self, grabbed, *args, **more):
        """Goes on to the next field, whose number may stay open."""
        if self._begun is None:
            self._begun = FieldNumbering(self._stream, (grabbed.time_ns or START_NS) - self._asked_ns)
        self.found += self._numbering.number(grabbed, *args, **more)

    def interrupt(self, reason):
        """Notes that the stream stopped."""
        self.found += self._numbering.interrupt(reason)

    def stood_still(self, time_ns):
        """Notes that nobody asked for fields."""
        self._numbering.stood_still(time_ns)

    def paused(self, time_ns, until_ns):
        """Notes that the program took none, while fields waited."""
        self._numbering.of_driver = Standstill(time_ns, time_ns, 0, ended_ns=until_ns)

    def driver_stood_still(self, time_ns, until_ns):
        """Notes that nothing ran, not even the driver."""
        self._numbering.of_driver = StandstillOfDriver(time_ns, time_ns, 0, ended_ns=until_ns)

    def settled(self):
        """All fields so far."""
        self.found += self._numbering.settle()
        return self.found


def numbers(grabbed, stream=None, signal=Signal.UNKNOWN):
    """The fields as a new numbering numbers them, without their arrivals."""
    numbering = Numbering(stream)
    for field in grabbed:
        numbering.see(field, signal)
    return numbering.settled()


def numbers_in_time(kept, late_ns=None, stream=None):
    """The camera's fields `kept` as a new numbering numbers them; all arrive in time, late stamps or not."""
    stream = stream or info()
    waits_for_the_next = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}.get(stream.field_order)
    numbering = Numbering(stream)
    for n in kept:
        arrived_ns = grab(n + (n % 2 == waits_for_the_next)).time_ns + 2 * PERIOD_NS
        numbering.see(grab(n, late_ns=(late_ns or {}).get(n, 0)), now_ns=arrived_ns)
    return numbering.settled()


def lost(entries):
    """The entries without their outcome."""
    return [(entry.first_n, entry.count, entry.reason) for entry in entries]
