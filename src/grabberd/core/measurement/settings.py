"""Settings of target location, and the locators that they can name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

AUTOMATIC = "automatic"
LOCATORS: Mapping[str, str] = MappingProxyType(
    {
        "centroid": "locators.centroid:locate_by_centroid",
        "weighted": "locators.centroid:locate_by_weighted",
        "template": "locators.template:locate_by_template",
        "edge": "locators.edge:locate_by_edge",
        "correlation": "locators.correlation:locate_by_correlation",
        "locale": "locale:locate_by_locale",
        "vernier": "locators.interpolation:locate_by_vernier",
        "tian-huhns": "locators.interpolation:locate_by_tian_huhns",
    }
)
"""Module and function of each locator, relative to this room. They are text, so that the locators kept for
comparison (edge, correlation, vernier, tian-huhns) are not imported by a program that never uses them."""
USUAL_LIMITS_PX = (2.5, 15.0)
"""Limits of a blob's diameter for targets of 5 to 6 pixels, those of the reference rig."""
METHODS = (AUTOMATIC, *LOCATORS)
"""Values of `LocationSettings.method` for the locators of this room."""


@dataclass(frozen=True, slots=True)
class LocationSettings:
    """Settings of target location.

    Attributes:
        method: One of `METHODS`, or the name of `locator`; "automatic" picks the most accurate for the
            field's bits, "locale" at 1 bit and "template" with more; "weighted" is nearly as accurate as
            "template" in half the time; "centroid" weights all pixels equally at 1 bit, and by g − T with
            more bits (paper eqs. 1, 2).
        min_diameter_px: Blobs smaller than a disc of this diameter, in frame pixels, are not targets; None
            if it is not known what to expect, then that of `USUAL_LIMITS_PX`.
        max_diameter_px: Blobs larger than a disc of this diameter are not targets; None likewise.
        noise_levels: Standard deviation of a pixel in grey values; None takes it from each field's
            background.
        target_px: Diameter of the targets' discs in frame pixels; None takes it from the field's own blobs.
        spread_px: Standard deviation of the spread function, frame pixels.
        line_jitter_px: Expected standard deviation of a field line's shift in x, frame pixels; 0 if lines do
            not shift.
        line_jitter_known: True if that is known well enough not to be estimated from each field.
        line_shifts: False to leave the shifts alone. None and True take them away: at 1 bit as the middles of
            rows tell them, with more bits solved for together with their standard deviation.
        locator: A locator from elsewhere, of the type `locators.Locator`; None takes the one of `method`.

    Raises:
        ValueError: The method is unknown or, with a locator from elsewhere, this room's own; or a limit is
            out of range.
    """

    method: str = "automatic"
    min_diameter_px: float | None = None
    max_diameter_px: float | None = None
    noise_levels: float | None = None
    target_px: float | None = None
    spread_px: float = 0.8
    line_jitter_px: float = 0.12
    line_jitter_known: bool = False
    line_shifts: bool | None = None
    locator: Callable[[Any], Any] | None = None

    def __post_init__(self) -> None:
        if self.locator is not None and self.method in METHODS:
            raise ValueError(f"method {self.method!r} has a locator of its own")
        if self.locator is None and self.method not in METHODS:
            raise ValueError(f"unknown method {self.method!r}; choose from {', '.join(METHODS)}")
        least_px, most_px = self.limits_px
        if not 0 <= least_px < most_px:
            limits = f"min_diameter_px {least_px} and max_diameter_px {most_px}"
            raise ValueError(f"no blob can meet {limits}")
        if self.target_px is not None and not self.target_px > 0:
            raise ValueError(f"target_px {self.target_px} is not positive")
        if not (self.spread_px > 0 and self.line_jitter_px >= 0):
            lengths = f"spread_px {self.spread_px} and line_jitter_px {self.line_jitter_px}"
            raise ValueError(f"{lengths} are out of range (above 0; at least 0)")

    @property
    def limits_px(self) -> tuple[float, float]:
        """Least and greatest diameter of a target's blob, frame pixels."""
        return self._limits(*USUAL_LIMITS_PX)

    def limited(self, least_px: float, most_px: float) -> "LocationSettings":
        """The same settings with these limits of a blob's diameter, but for those that are set."""
        least_px, most_px = self._limits(least_px, most_px)
        return replace(self, min_diameter_px=least_px, max_diameter_px=most_px)

    def _limits(self, least_px: float, most_px: float) -> tuple[float, float]:
        # A limit that is set stands; the other one gives way to it.
        if self.min_diameter_px is not None:
            least_px, most_px = self.min_diameter_px, max(most_px, 2 * self.min_diameter_px)
        if self.max_diameter_px is not None:
            least_px, most_px = min(least_px, self.max_diameter_px / 2), self.max_diameter_px
        return least_px if self.min_diameter_px is None else self.min_diameter_px, most_px


ANY_DISC = LocationSettings(method="centroid", min_diameter_px=2.0, max_diameter_px=200.0, line_jitter_px=0.0)
"""For anything from a dot to a coin, where the question is what size targets have, or whether they moved."""
