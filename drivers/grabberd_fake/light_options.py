"""A light in the camera's view that goes on and off by a pattern of chance, for the clocks of loggers."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.reading import integer, number

_BLOCK = 1024
_COLUMNS, _LINES, _HALF = 720, 576, 360  # as of `optics`, which needs all options


@dataclass(frozen=True, slots=True)
class LightOptions:
    """A lamp that shines into the camera from the edge of the picture.

    Attributes:
        diameter_px: of its image; 0: there is none.
        x_px: column of its middle; `y_px`: frame line.
        brightness: of a full exposure, in units of the targets' contrast.
        bit_ms: time between two moments at which it may change. The default does not keep step with fields.
        seed: seed of the pattern.
    """

    diameter_px: float = number(0.0, 0, 38)
    x_px: float = number(330.0, 0, _COLUMNS - 1)
    y_px: float = number(550.0, 0, _LINES - 1)
    brightness: float = number(1.0, 0.05, 3)
    bit_ms: float = number(92.361, 1, 10000)
    seed: int = integer(1, 0, 2**32 - 1)

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        radius = self.diameter_px / 2
        if not radius <= self.x_px <= _COLUMNS - 1 - radius or abs(self.x_px - _HALF + 0.5) < radius:
            yield f"x_px: the light at {self.x_px:g} does not lie within one half of the picture"


def lit(options: LightOptions, time_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(K,) True where the light is on at times on the camera's clock."""
    bits = time_ns // _bit_ns(options)
    blocks = bits // _BLOCK
    states = np.empty(len(bits), np.bool_)
    for block in np.unique(blocks).tolist():
        here = blocks == block
        states[here] = _pattern(options.seed, block)[bits[here] % _BLOCK]
    return states


def share_lit(options: LightOptions, time_ns: int, exposure_ns: int) -> float:
    """Share of an exposure, centred on a time, for which the light is on."""
    bit_ns = _bit_ns(options)
    begin_ns, end_ns = time_ns - exposure_ns // 2, time_ns + exposure_ns // 2 + 1
    bits = np.arange(begin_ns // bit_ns, (end_ns - 1) // bit_ns + 1)
    overlap = np.minimum((bits + 1) * bit_ns, end_ns) - np.maximum(bits * bit_ns, begin_ns)
    return float(lit(options, bits * bit_ns) @ overlap / (end_ns - begin_ns))


def _bit_ns(options: LightOptions) -> int:
    return round(options.bit_ms * 1e6)


@lru_cache(maxsize=64)
def _pattern(seed: int, block: int) -> NDArray[np.bool_]:
    """(_BLOCK,) states of one stretch of the pattern; it never repeats."""
    random = np.random.Generator(np.random.SFC64([seed, block & (2**63 - 1)]))
    return random.random(_BLOCK) < 0.5
