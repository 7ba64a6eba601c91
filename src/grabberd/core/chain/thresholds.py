"""The threshold for coming fields, from one field: for their bits and lines, and for its targets' size."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field
from grabberd.core.measurement import ThresholdRule, choose_threshold, threshold_map, with_seen_size
from grabberd.errors import MeasurementError

LARGEST_TARGET_PX = 16.0
"""Larger targets get the threshold of this size: it matters little to them, and predicting it is slow."""


def field_threshold(field: Field, rule: ThresholdRule, bits: int, *, doubled: bool) -> int:
    """The threshold for fields like this one.

    Args:
        field: field of 8 bits with its original lines.
        rule: rule of the threshold; the targets' size is taken from the field if it shows any.
        bits: bits per pixel to which the fields will be quantised.
        doubled: True if missing lines will be interpolated first.

    Returns:
        The threshold, 0 to 254.

    Raises:
        MeasurementError: the threshold is automatic and no targets are visible.
    """
    histogram = np.bincount(field.luma.ravel(), minlength=256)
    return choose_threshold(histogram, _for_seen_size(rule, field), bits, _lines(field, doubled))


def field_threshold_map(field: Field, rule: ThresholdRule, *, doubled: bool) -> NDArray[np.uint8]:
    """The threshold of every pixel of fields like this one, at 1 bit, where the light is uneven.

    Args:
        field: field of 8 bits with its original lines.
        rule: rule of the threshold; the targets' size is taken from the field if it shows any.
        doubled: True if missing lines will be interpolated first.

    Returns:
        (rows, columns) uint8 thresholds, for the doubled field if `doubled`.

    Raises:
        MeasurementError: the threshold is automatic and no targets are visible.
    """
    y_step, apart = _lines(field, doubled)
    found = threshold_map(field.luma, _for_seen_size(rule, field), 1, (y_step, apart))
    return np.repeat(found, field.y_step // y_step, axis=0)


def _lines(field: Field, doubled: bool) -> tuple[int, int]:
    """Frame lines from row to row at quantisation, and from one delivered line to the next."""
    return 1 if doubled else field.y_step, field.lines_apart


def _for_seen_size(rule: ThresholdRule, field: Field) -> ThresholdRule:
    # A field without visible targets has no size to go by: the one in the rule stands.
    with suppress(MeasurementError):
        rule = with_seen_size(rule, field)
    return replace(rule, target_px=min(rule.target_px, LARGEST_TARGET_PX))
