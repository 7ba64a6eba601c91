"""From a grabber's buffers to numbered fields in the ring.

`device` is the contract implemented by every grabber driver; `discovery` finds drivers by name, and the
devices that they detect. `numbering` determines which of the camera's fields a grabbed one is and which were
lost before it, although timestamps jitter and drivers' counters are unreliable; `content_check` and
`shifted_rows` detect damage and a missing signal in the picture itself. The `ring` holds the newest packed
fields for several readers, none of which can delay the capture; `standstill` finds out why the program was
late. No threads are started here.
"""

from grabberd.instrument.acquisition.content_check import REPEATED, Content, ContentCheck
from grabberd.instrument.acquisition.device import GrabbedField, Grabber, Signal, StreamInfo
from grabberd.instrument.acquisition.discovery import GRABBERS, LOGGERS, FoundDevice, Verdict, discover
from grabberd.instrument.acquisition.numbering import FieldNumbering, Numbered
from grabberd.instrument.acquisition.ring import Policy, Ring, RingReader
from grabberd.instrument.acquisition.standstill import Standstill

__all__ = [
    "GRABBERS",
    "LOGGERS",
    "REPEATED",
    "Content",
    "ContentCheck",
    "FieldNumbering",
    "FoundDevice",
    "GrabbedField",
    "Grabber",
    "Numbered",
    "Policy",
    "Ring",
    "RingReader",
    "Signal",
    "Standstill",
    "StreamInfo",
    "Verdict",
    "discover",
]
