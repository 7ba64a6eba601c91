"""Video standards of 625 lines at 50 fields a second, by their names and the kernel's bits."""

from grabberd_v4l2 import abi

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
}
"""Standards that can be requested; "PAL" lets the card choose one of B to K."""


def bits(name: str) -> int:
    """The kernel's bits of a standard; "PAL-B/G" is "PAL-BG".

    Raises:
        ValueError: the name is not in `NAMES`.
    """
    known = NAMES.get(name.upper().replace("/", ""))
    if known is None:
        raise ValueError(f"{name!r} is not one of {', '.join(NAMES)}")
    return known


def name(standard: int) -> str:
    """Name of a set of standard bits."""
    exact = next((known for known, its in NAMES.items() if its == standard), None)
    return exact or next((known for known, its in NAMES.items() if its & standard), _other(standard))


def _other(standard: int) -> str:
    return "a standard of 60 Hz" if standard & abi.STD_525_60 else "none"


def is_50_hz(standard: int) -> bool:
    """True if the standard certainly has 625 lines."""
    return bool(standard & abi.STD_625_50) and not standard & abi.STD_525_60


def is_60_hz(standard: int) -> bool:
    """True if the standard certainly has 525 lines: PAL-M, PAL-60, NTSC."""
    return bool(standard & abi.STD_525_60) and not standard & abi.STD_625_50
