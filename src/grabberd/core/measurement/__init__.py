"""Measurement of target images in one field (paper 3.5): threshold, labelling, centre and its σ.

A packed field goes in; blobs come out in frame pixels, x in columns and y in frame lines, so that no later
room knows about rows, parity or bits. Everything works on the packed bits: in a field of targets 96 % of the
bytes are empty and never touched, and grey values are gathered only where the threshold is exceeded.
"""

from grabberd.core.measurement.location import Blobs, measure, seen_in
from grabberd.core.measurement.noise import background_of
from grabberd.core.measurement.settings import ANY_DISC, METHODS, LocationSettings
from grabberd.core.measurement.threshold import (
    ThresholdRule,
    choose_threshold,
    threshold_map,
    trinder_levels,
    with_seen_size,
)

__all__ = [
    "ANY_DISC",
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
