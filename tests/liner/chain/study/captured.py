"""Captures of a study, made up: liners A, B, … on cows 100, 101, …, one capture of each."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from grabberd_liner.chain.study.study import Found, Meaning, Studied

COMPRESSION, OPENING, TOUCH = "liner_compression_mean_kpa", "liner_opening_s", "touch_kpa"
MEANINGS = {
    COMPRESSION: Meaning("liner compression, mean", "Mean over the teat."),
    OPENING: Meaning("liner opening time", "From 10 to 90 %."),
    TOUCH: Meaning("touch pressure", "Where walls touch."),
}


def found(value: float, sigma: float = 0.1, common: float | None = 0.0, unit: str = "kPa") -> Found:
    return Found(unit, value, sigma, common, "")


def missing(reason: str, unit: str = "kPa") -> Found:
    return Found(unit, math.nan, math.nan, None, reason)


def capture(number: int, liner: str = "A", cow: str = "100", **changes: Any) -> Studied:
    """A capture of one minute of 2026-11-01; `changes` replace its attributes."""
    one = Studied(
        f"c{number:03d}",
        f"2026-11-01T{number // 60:02d}:{number % 60:02d}:00.000Z",
        "barn",
        "complete",
        {"liner": liner, "cow": cow, "milkings": str(100 * number)},
        f"{liner}, version 1",
        "1",
        "2026-11-02T00:00:00.000Z",
        {
            COMPRESSION: found(40.0 + number),
            OPENING: found(0.12, 0.001, unit="s"),
            TOUCH: missing("the capture is no ramp with the empty liner"),
        },
        MEANINGS,
    )
    return one._replace(**changes)


def herd(
    liners: str = "ABC", cows: int = 4, seed: int = 1, *, effects: Sequence[float] = (0.0, 3.0, 0.0)
) -> list[Studied]:
    """Every cow with every liner; compression differs by cow, and by liner as `effects` tell."""
    random, captures = np.random.default_rng(seed), []
    levels = 40 + 2 * random.normal(size=cows)
    for cow in range(cows):
        for number, liner in enumerate(liners):
            value = levels[cow] + effects[number] + 0.2 * random.normal()
            opening = 0.12 + 0.001 * random.normal()
            all_found = {
                COMPRESSION: found(value, 0.15, 0.1),
                OPENING: found(opening, 0.001, unit="s"),
                TOUCH: missing("the capture is no ramp with the empty liner"),
            }
            captures.append(capture(len(captures), liner, str(100 + cow), found=all_found))
    return captures
