"""The vacuum on both sides of the liner's wall, and a logger of it with its own clock."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.light_options import LightOptions, lit

Array = NDArray[np.float64]

LOG_HEADER = "time_s,pulsation_vacuum_kpa,liner_vacuum_kpa"


class Wave(NamedTuple):
    """A trapezoid, in proportions of its period.

    Attributes:
        period_s: length of one pulsation.
        system_kpa: greatest vacuum in the pulsation chamber; the least is none.
        rise: when it starts to rise; `rising`: how long it rises.
        fall: when it starts to fall; `falling`: how long it falls.
        liner_kpa: vacuum inside the liner, constant.
    """

    period_s: float
    system_kpa: float
    rise: float
    rising: float
    fall: float
    falling: float
    liner_kpa: float


class Pulsating(Protocol):
    """Options of a liner that pulsates."""

    @property
    def wave(self) -> Wave:
        """Its vacuum."""
        ...


def pulsation_kpa(options: Pulsating, time_s: Array) -> Array:
    """Vacuum in the pulsation chamber below atmosphere."""
    wave = options.wave
    part = np.mod(np.asarray(time_s, np.float64) / wave.period_s - wave.rise, 1.0)
    risen = np.clip(part / wave.rising, 0.0, 1.0)
    fallen = np.clip((part - (wave.fall - wave.rise)) / wave.falling, 0.0, 1.0)
    return wave.system_kpa * (risen - fallen)


def vacuum_log(
    options: Pulsating,
    start_ns: int,
    end_ns: int,
    offset_s: float = 0.0,
    noise_kpa: float = 0.0,
    rate_hz: float = 1000.0,
    seed: int = 0,
    light: LightOptions | None = None,
) -> Iterator[str]:
    """CSV lines of a logger, the header first.

    Args:
        options: options of the liner.
        start_ns: camera time of the first reading.
        end_ns: camera time of the last reading.
        offset_s: offset that turns logger time into seconds since `start_ns` when added.
        noise_kpa: standard deviation of each reading.
        rate_hz: readings per second.
        seed: seed of the noise.
        light: the lamp whose state is recorded in a last column; None: there is no such column.
    """
    yield LOG_HEADER + ("" if light is None else ",light")
    count = math.floor((end_ns - start_ns) / 1e9 * rate_hz) + 1
    since_s = np.arange(count) / rate_hz
    chamber = pulsation_kpa(options, start_ns / 1e9 + since_s)
    noise = np.random.default_rng(seed).normal(0.0, noise_kpa, (count, 2))
    states = _light_cells(light, start_ns, since_s)
    rows = zip(since_s - offset_s, chamber, noise, states, strict=True)
    for time_s, kpa, (first, second), state in rows:
        yield f"{time_s:.6f},{kpa + first:.4f},{options.wave.liner_kpa + second:.4f}{state}"


def _light_cells(light: LightOptions | None, start_ns: int, since_s: Array) -> Sequence[str]:
    if light is None:
        return [""] * len(since_s)
    states = lit(light, start_ns + np.rint(since_s * 1e9).astype(np.int64))
    return [",1" if state else ",0" for state in states.tolist()]
