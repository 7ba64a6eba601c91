"""Streams of fields without pictures, for the tests of the numbering."""

import numpy as np

from grabberd.acquisition.device import FieldOrder, GrabbedField, StreamInfo
from grabberd.acquisition.numbering import FieldNumbering
from grabberd.field import Field

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


def numbers(grabbed, stream=None):
    """The fields as a new numbering numbers them, without their arrivals."""
    numbering = FieldNumbering(stream or info())
    return [numbering.number(field) for field in grabbed]


def lost(entries):
    """The entries without their outcome."""
    return [(entry.first_n, entry.count, entry.reason) for entry in entries]
