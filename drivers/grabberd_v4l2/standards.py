"""Video standards with their names, the kernel's bits and their scans."""

from typing import NamedTuple

from grabberd.core.field import BOTTOM, NTSC_HZ, PAL_HZ, PROGRESSIVE, TOP
from grabberd_v4l2 import abi

DEFAULT = "PAL"
NAMES = {
    "PAL": abi.STD_PAL,
    "PAL-BG": 0x07,
    "PAL-B": 0x01,
    "PAL-B1": 0x02,
    "PAL-G": 0x04,
    "PAL-H": 0x08,
    "PAL-I": 0x10,
    "PAL-DK": 0xE0,
    "PAL-D": 0x20,
    "PAL-D1": 0x40,
    "PAL-K": 0x80,
    "PAL-N": 0x0200,
    "PAL-NC": 0x0400,
    "SECAM": 0xFF0000,
    "NTSC": 0xB000,
    "NTSC-M": 0x1000,
    "NTSC-M-JP": 0x2000,
    "NTSC-M-KR": 0x8000,
    "NTSC-443": 0x4000,
    "PAL-M": 0x0100,
    "PAL-60": 0x0800,
}
"""Standards that can be requested; for "PAL" the card chooses one of B to K, for "NTSC" an M type."""


class Scan(NamedTuple):
    """Lines and rate of a camera's scan, and the order of its fields.

    Attributes:
        lines: Lines of a frame, or of a progressive picture.
        rate_hz: Fields or progressive pictures per second.
        older: Parity of the older field of a frame, as defined by V4L2 for the standard, or `PROGRESSIVE`.
    """

    lines: int
    rate_hz: float
    older: int

    @classmethod
    def progressive(cls, lines: int, rate_hz: float) -> "Scan":
        """The scan of progressive pictures."""
        return cls(lines, rate_hz, PROGRESSIVE)

    @property
    def is_progressive(self) -> bool:
        """True for pictures without fields."""
        return self.older == PROGRESSIVE

    @property
    def period_ns(self) -> int:
        """Time from field to field, or from picture to picture."""
        return round(1e9 / self.rate_hz)

    def __str__(self) -> str:
        return f"{self.rate_hz:.0f} Hz"


SCAN_625 = Scan(576, PAL_HZ, TOP)
SCAN_525 = Scan(480, NTSC_HZ, BOTTOM)


def bits(name: str) -> int:
    """The kernel's bits of a standard; "PAL-B/G" is "PAL-BG".

    Raises:
        ValueError: The name is not in `NAMES`.
    """
    known = NAMES.get(name.upper().replace("/", ""))
    if known is None:
        raise ValueError(f"{name!r} is not one of {', '.join(NAMES)}")
    return known


def name(standard: int) -> str:
    """Name of a set of standard bits."""
    exact = next((known for known, its in NAMES.items() if its == standard), None)
    return exact or next((known for known, its in NAMES.items() if its & standard), "none")


def scan(standard: int) -> Scan | None:
    """The scan of a set of standard bits; None if it is empty or has both rates."""
    at_50, at_60 = bool(standard & abi.STD_625_50), bool(standard & abi.STD_525_60)
    if at_50 == at_60:
        return None
    return SCAN_625 if at_50 else SCAN_525


def family(scanned: Scan) -> str:
    """The common name of a scan, as used in the option `standard`."""
    return "PAL" if scanned == SCAN_625 else "NTSC"
