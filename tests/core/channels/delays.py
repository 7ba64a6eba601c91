"""Simulated loggers: when they take readings by their own clock, and when these arrive."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

START_NS = 5_000_000_000_000


class Packet(NamedTuple):
    """Readings that arrive together: when they were taken, by the logger's clock, and when they came."""

    taken_ns: np.ndarray
    own_ns: np.ndarray
    arrival_ns: int


def packets(
    seconds: float,
    *,
    rate_hz: float = 200.0,
    packet_s: float = 0.016,
    late_s: float = 0.001,
    drift: float = 5e-5,
    seed: int = 0,
    shortest_s: float = 0.002,
    offset_s: float = -1000.0,
) -> Iterator[Packet]:
    """Readings at a steady rate through an adapter that collects them, and a computer that is late."""
    chance = np.random.default_rng(seed)
    taken = START_NS + (np.arange(round(seconds * rate_hz)) * 1e9 / rate_hz).astype(np.int64)
    phase = chance.uniform()
    parcel = np.floor((taken - START_NS) / (packet_s * 1e9) + phase) if packet_s else np.arange(len(taken))
    newest_ns = 0
    for _, index in sorted({number: np.flatnonzero(parcel == number) for number in set(parcel)}.items()):
        complete_ns = (
            START_NS + (parcel[index[0]] + 1 - phase) * packet_s * 1e9 if packet_s else taken[index[-1]]
        )
        arrival_ns = int(complete_ns + (shortest_s + chance.exponential(late_s)) * 1e9)
        newest_ns = max(newest_ns, arrival_ns)
        own_ns = taken[index] + ((taken[index] - START_NS) * -drift + offset_s * 1e9).astype(np.int64)
        yield Packet(taken[index], own_ns, newest_ns)
