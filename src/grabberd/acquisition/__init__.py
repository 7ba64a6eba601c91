"""From a grabber's buffers to numbered fields in the ring.

`device` is the contract that every driver implements, `registry` finds drivers by name, `discovery` lists the
devices they can see. `numbering` works out which of the camera's fields a grabbed one is and what was lost
before it, although timestamps jitter and drivers' counters cannot be trusted; `checks` look for damage and a
missing signal in the picture itself. The `ring` holds the newest packed fields for several readers, none of
which can hold up the capture; the `ledger` accounts for every field that should have come. No threads are
started here.
"""

from grabberd.acquisition.checks.content_check import Content, ContentCheck
from grabberd.acquisition.clock import Clock, SystemClock
from grabberd.acquisition.device import FieldOrder, GrabbedField, Grabber, Signal, StreamInfo
from grabberd.acquisition.discovery import FoundDevice, Verdict, discover
from grabberd.acquisition.ledger import Ledger, LedgerEntry, Outcome
from grabberd.acquisition.numbering import FieldNumbering, Numbered
from grabberd.acquisition.registry import available, create
from grabberd.acquisition.ring import Policy, Ring, RingReader, Slot

__all__ = [
    "Clock",
    "Content",
    "ContentCheck",
    "FieldNumbering",
    "FieldOrder",
    "FoundDevice",
    "GrabbedField",
    "Grabber",
    "Ledger",
    "LedgerEntry",
    "Numbered",
    "Outcome",
    "Policy",
    "Ring",
    "RingReader",
    "Signal",
    "Slot",
    "StreamInfo",
    "SystemClock",
    "Verdict",
    "available",
    "create",
    "discover",
]
