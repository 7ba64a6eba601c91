"""The documented path of measurement."""

from grabberd.core.measurement import (
    METHODS,
    Blobs,
    LocationSettings,
    ThresholdRule,
    background_of,
    choose_threshold,
    measure,
    seen_in,
    threshold_map,
    trinder_levels,
    with_seen_size,
)

__all__ = [
    "METHODS",
    "Blobs",
    "LocationSettings",
    "ThresholdRule",
    "background_of",
    "choose_threshold",
    "measure",
    "seen_in",
    "threshold_map",
    "trinder_levels",
    "with_seen_size",
]
