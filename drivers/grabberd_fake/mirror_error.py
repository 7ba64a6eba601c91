"""The local unevenness of cheap mirrors: smooth displacements that no global parameter describes (paper,
4).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grabberd_fake.optics import HALF, LINES, Array

_WAVES = 12
_SHORTEST_PX, _LONGEST_PX = 60.0, 180.0


@dataclass(frozen=True, slots=True, eq=False)
class LocalError:
    """A sum of plane waves; each coordinate has mean zero and the wanted rms over a half picture.

    Attributes:
        wave: (2, W) rad per pixel; `phase`: (W,) rad; `amplitude`: (W, 2) px; `mean`: (2,) px, taken off.
    """

    wave: Array
    phase: Array
    amplitude: Array
    mean: Array

    @classmethod
    def draw(cls, rms_px: float, first_column: int, seed: Sequence[int]) -> "LocalError":
        """The error that a seed gives to the half that begins at `first_column`."""
        rng = np.random.default_rng(seed)
        number = 2 * np.pi / rng.uniform(_SHORTEST_PX, _LONGEST_PX, _WAVES)
        heading = rng.uniform(0, 2 * np.pi, _WAVES)
        wave = number * np.stack([np.cos(heading), np.sin(heading)])
        raw = cls(wave, rng.uniform(0, 2 * np.pi, _WAVES), rng.normal(0, 1, (_WAVES, 2)), np.zeros(2))
        sample = raw(_half_picture(first_column))
        scale = rms_px / sample.std(axis=0)
        return cls(raw.wave, raw.phase, raw.amplitude * scale, sample.mean(axis=0) * scale)

    def __call__(self, xy_px: Array) -> Array:
        """(N, 2) displacements at the frame pixels (N, 2)."""
        return np.cos(xy_px @ self.wave + self.phase) @ self.amplitude - self.mean


def _half_picture(first_column: int) -> Array:
    columns, lines = np.meshgrid(
        np.arange(first_column, first_column + HALF, 6.0), np.arange(0.0, LINES, 6.0)
    )
    return np.column_stack([columns.ravel(), lines.ravel()])
