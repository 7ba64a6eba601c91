"""Interpolation of a field's missing lines (paper 3.3)."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.field.field import Field, PackedField

INTERPOLATIONS = ("linear", "kernel3x3")
"""Methods of interpolation: "linear" between the lines above and below; "kernel3x3" by the kernel ¼ (1 2 1)
by ½ (1 2 1), which is the same but smooths every line along x as well."""


def double_lines(field: Field, interpolation: str = "linear") -> Field:
    """Interpolate the missing lines of a field on its grey values, giving a picture of full height.

    A missing line is the mean of its neighbours, rounded half up; beyond the outermost line the only
    neighbour is repeated. A field already doubled is returned as it is, so a recording of doubled fields
    passes through unchanged. The field must have at least two rows.

    Raises:
        ValueError: The interpolation is not one of `INTERPOLATIONS`.
    """
    _known(interpolation)
    if field.y_step == 1:
        return field
    luma = field.luma if interpolation == "linear" else _smoothed(field.luma)
    rows, columns = luma.shape
    doubled = np.empty((2 * rows, columns), np.uint8)
    doubled[field.parity :: 2] = luma
    # cv2 rounds half to even; a quarter added makes every .5 round up.
    between = cv2.addWeighted(luma[:-1], 0.5, luma[1:], 0.5, 0.25)
    doubled[1 + field.parity : 2 * rows - 1 + field.parity : 2] = between
    doubled[-1 if field.parity == 0 else 0] = luma[-1 if field.parity == 0 else 0]
    return Field(doubled, field.parity, y0=0, y_step=1)


def _smoothed(luma: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Smooth every line by ¼ (1 2 1) along x, repeating the outermost pixel at the ends."""
    row = np.array([0.25, 0.5, 0.25], np.float32)
    smoothed = cv2.sepFilter2D(luma, cv2.CV_8U, row, np.ones(1, np.float32), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(smoothed, np.uint8)


def double_bits(packed: PackedField, interpolation: str = "linear") -> PackedField:
    """Interpolate the missing lines of a 1-bit field after the threshold, and threshold once more.

    Kept for comparison: interpolating before the threshold is better. As weights (`doubled_weights`) linearly
    interpolated bits have exactly the centroid of the intact ones, so nothing is gained; setting every pixel
    of at least half the greatest weight then makes it worse.

    Raises:
        ValueError: More than 1 bit, or an interpolation that is not one of `INTERPOLATIONS`.
    """
    if packed.bits != 1:
        raise ValueError(f"lines can be doubled after the threshold only at 1 bit, not at {packed.bits} bits")
    if packed.y_step == 1:
        return packed
    bits = np.unpackbits(packed.data[0], axis=1, count=packed.columns)
    weights = doubled_weights(bits, packed.parity, interpolation)
    half = 1 if interpolation == "linear" else 4
    return replace(packed, data=np.packbits(weights >= half, axis=1)[np.newaxis], y0=0, y_step=1)


def doubled_weights(bits: NDArray[np.uint8], parity: int, interpolation: str = "linear") -> NDArray[np.uint8]:
    """Interpolate bits without thresholding them again, giving a picture of full height.

    Args:
        bits: (rows, columns) uint8, 0 or 1.
        parity: Parity of the field.
        interpolation: One of `INTERPOLATIONS`.

    Returns:
        (2 rows, columns) uint8: in halves for "linear", in eighths for "kernel3x3".

    Raises:
        ValueError: The interpolation is not one of `INTERPOLATIONS`.
    """
    _known(interpolation)
    weight = bits
    if interpolation == "kernel3x3":
        padded = np.pad(bits, ((0, 0), (1, 1)), mode="edge")
        weight = padded[:, :-2] + 2 * bits + padded[:, 2:]
    doubled = np.empty((2 * len(bits), bits.shape[1]), np.uint8)
    doubled[parity::2] = 2 * weight
    neighbour = np.concatenate([weight[:1], weight]) if parity else np.concatenate([weight, weight[-1:]])
    doubled[1 - parity :: 2] = neighbour[:-1] + neighbour[1:]
    return doubled


def _known(interpolation: str) -> None:
    if interpolation not in INTERPOLATIONS:
        raise ValueError(f"unknown interpolation {interpolation!r}; choose from {', '.join(INTERPOLATIONS)}")
