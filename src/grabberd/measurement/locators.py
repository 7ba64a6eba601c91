"""The documented path of the locator contract."""

from grabberd.core.measurement.locators import (
    GREY,
    Located,
    Locator,
    Seen,
    Windows,
    meant_for,
    noise_of,
    windows_of,
)

__all__ = ["GREY", "Located", "Locator", "Seen", "Windows", "meant_for", "noise_of", "windows_of"]
