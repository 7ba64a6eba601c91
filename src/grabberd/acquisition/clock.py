"""The documented path of the clocks."""

from grabberd.runtime import (
    BOOT_ID_FILE,
    BOOT_ID_VARIABLE,
    Clock,
    Moment,
    Now,
    SystemClock,
    UtcClock,
    boot_id,
    iso_utc,
)

__all__ = [
    "BOOT_ID_FILE",
    "BOOT_ID_VARIABLE",
    "Clock",
    "Moment",
    "Now",
    "SystemClock",
    "UtcClock",
    "boot_id",
    "iso_utc",
]
