"""From a grabber's buffers to numbered fields in the ring.

`device` is the contract that every driver of a grabber implements, `channels` has that of data loggers;
`registry` finds drivers by name, `discovery` lists the devices they can see. `numbering` works out which of
the camera's fields a grabbed one is and what was lost before it, although timestamps jitter and drivers'
counters cannot be trusted; `checks` look for damage and a missing signal in the picture itself. The `ring`
holds the newest packed fields for several readers, none of which can hold up the capture; the `ledger`
accounts for every field that should have come, `causes` says where to look for what is missing, `rebases`
what numbers and times go by, `standstill` why the program was late. No threads are started here.
"""

from grabberd.acquisition.causes import LossCause, cause_of_loss
from grabberd.acquisition.checks.content_check import Content, ContentCheck
from grabberd.acquisition.clock import Clock, SystemClock
from grabberd.acquisition.device import (
    NTSC_HZ,
    PAL_HZ,
    FieldOrder,
    GrabbedField,
    Grabber,
    Signal,
    StreamInfo,
    standard_rate_hz,
)
from grabberd.acquisition.discovery import FoundDevice, Verdict, discover
from grabberd.acquisition.ledger import UNCERTAIN, Ledger, LedgerEntry, Outcome
from grabberd.acquisition.numbering import FieldNumbering, Numbered
from grabberd.acquisition.rebases import LedgerEvent, Rebase, numbers_off, too_high_by
from grabberd.acquisition.registry import GRABBERS, INSTALLED_LOCATORS, LOGGERS
from grabberd.acquisition.ring import Policy, Ring, RingReader, Slot
from grabberd.acquisition.standstill import Standstill

__all__ = [
    "GRABBERS",
    "INSTALLED_LOCATORS",
    "LOGGERS",
    "NTSC_HZ",
    "PAL_HZ",
    "UNCERTAIN",
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
    "LedgerEvent",
    "LossCause",
    "Numbered",
    "Outcome",
    "Policy",
    "Rebase",
    "Ring",
    "RingReader",
    "Signal",
    "Slot",
    "Standstill",
    "StreamInfo",
    "SystemClock",
    "Verdict",
    "cause_of_loss",
    "discover",
    "numbers_off",
    "standard_rate_hz",
    "too_high_by",
]
