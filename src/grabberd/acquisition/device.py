"""The documented path of the driver contract."""

from grabberd.core.field import NTSC_HZ, PAL_HZ, VIDEO_LINES, FieldOrder, standard_rate_hz
from grabberd.instrument.acquisition.device import GrabbedField, Grabber, Signal, StreamInfo

__all__ = [
    "NTSC_HZ",
    "PAL_HZ",
    "VIDEO_LINES",
    "FieldOrder",
    "GrabbedField",
    "Grabber",
    "Signal",
    "StreamInfo",
    "standard_rate_hz",
]
