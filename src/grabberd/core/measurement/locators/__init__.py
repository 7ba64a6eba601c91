"""Locators: methods of computing a blob's centre.

The paper compares centroid, Vernier, Tian-Huhns, edge and correlation (3.5); `template` (a fitted disc) is
the most accurate with grey values, the weighted `centroid` nearly as accurate at half the cost, and locale
decoding, the best at 1 bit, has a file beside this folder. `locator` defines their common input and output,
with the windows of grey values that several of them use. Those that no default selects are imported only when
asked for (`core.measurement.settings`).

A package of its own may add a locator by an entry point in the group `grabberd.locators`: a function of the
type `Locator`, whose name becomes a value of `location.method`. It needs nothing else than what is exported
here; `LocationSettings.locator` brings it in.
"""

from grabberd.core.measurement.locators.locator import (
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
