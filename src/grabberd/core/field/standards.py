"""Video standards: their rates, lines and the orders in which fields of a frame are delivered."""

from enum import StrEnum

PAL_HZ = 50.0
NTSC_HZ = 60_000 / 1001
"""Fields per second of the video with 625 and with 525 lines."""
_NTSC_LINES = (480, 486)
VIDEO_LINES = (576, *_NTSC_LINES)
"""Lines of an interlaced frame; pictures with another number are progressive."""


def standard_rate_hz(frame_lines: int) -> float:
    """Fields per second of the video standard whose frames have so many lines to be seen."""
    return NTSC_HZ if frame_lines in _NTSC_LINES else PAL_HZ


class FieldOrder(StrEnum):
    """Order in which a driver delivers the fields of a frame."""

    ALTERNATE = "alternate"
    TOP_FIRST = "top_first"
    BOTTOM_FIRST = "bottom_first"
    ONE_PARITY = "one_parity"
    PROGRESSIVE = "progressive"
    """No fields: whole pictures, each of which is taken for a field with all its lines."""

    @property
    def has_parity(self) -> bool:
        """True if fields of both parities come by turns."""
        return self not in (FieldOrder.ONE_PARITY, FieldOrder.PROGRESSIVE)
