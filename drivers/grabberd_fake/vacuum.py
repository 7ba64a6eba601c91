"""The vacuum on both sides of the liner's wall, and a logger of it with its own clock."""

import math
from collections.abc import Iterator

import numpy as np

from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.optics import Array

LOG_HEADER = "time_s,pulsation_vacuum_kpa,liner_vacuum_kpa"


def pulsation_kpa(options: LinerOptions, time_s: Array) -> Array:
    """Vacuum in the pulsation chamber below atmosphere: a trapezoid that leads the wall's movement."""
    vacuum = options.vacuum
    rise = -vacuum.opening_lag
    fall = options.opening + options.open - vacuum.closing_lag
    part = np.mod(np.asarray(time_s, np.float64) / options.period_s - rise, 1.0)
    risen = np.clip(part / vacuum.rising, 0.0, 1.0)
    fallen = np.clip((part - (fall - rise)) / vacuum.falling, 0.0, 1.0)
    kpa: Array = vacuum.system_kpa * (risen - fallen)
    return kpa


def vacuum_log(
    options: LinerOptions,
    start_ns: int,
    end_ns: int,
    offset_s: float = 0.0,
    noise_kpa: float = 0.0,
    rate_hz: float = 1000.0,
    seed: int = 0,
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
    """
    yield LOG_HEADER
    count = math.floor((end_ns - start_ns) / 1e9 * rate_hz) + 1
    since_s = np.arange(count) / rate_hz
    chamber = pulsation_kpa(options, start_ns / 1e9 + since_s)
    noise = np.random.default_rng(seed).normal(0.0, noise_kpa, (count, 2))
    for time_s, kpa, (first, second) in zip(since_s - offset_s, chamber, noise, strict=True):
        yield f"{time_s:.6f},{kpa + first:.4f},{options.vacuum.liner_kpa + second:.4f}"
