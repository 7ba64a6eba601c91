"""Small fields of round targets that move together, and what recorders do to pictures."""

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import TOP, Field

ROWS, COLUMNS = 48, 120
BACKGROUND, CONTRAST = 25, 150
NOISE = 3.0


def discs(shift_px: float = 0.0, *, seed: int = 0, parity: int = TOP, noise: float = NOISE) -> Field:
    """A field of 6 × 4 targets that have moved to the right by so much; each seed has a noise of its own."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)
    far_x = (x - shift_px + 10) % 20 - 10
    far_y = (2 * y + parity + 12) % 24 - 12
    light = BACKGROUND + CONTRAST * np.exp(-(far_x**2 + far_y**2) / 18)
    light += np.random.default_rng(seed).normal(0, noise, light.shape)
    return Field.intact(as_grey(light), parity)


def covered(field: Field, columns: int) -> Field:
    """The field without the targets in its first columns."""
    luma = field.luma.copy()
    luma[:, :columns] = BACKGROUND
    return Field.intact(luma, field.parity)


def coded_again(field: Field, seed: int = 0) -> Field:
    """The field after a codec of usual quality: every fifth pixel off by one level."""
    rng = np.random.default_rng(seed)
    off = rng.integers(0, 2, field.luma.shape) * 2 - 1
    return Field.intact(
        as_grey(field.luma + np.where(rng.random(field.luma.shape) < 0.2, off, 0)), field.parity
    )


def as_grey(light: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)
