"""What a study of liners found beside the truth, as tables: by capture, by quantity, and between liners."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from tests.proofs.bench.pressure_case import paragraph

OWN = ("touch_kpa", "buckling_kpa", "stiffness_n_mm")
"""Quantities of the empty liner."""
SHOWN = (
    "liner_compression_mean_kpa",
    "teat_end_beyond_flow_stop_kpa",
    "teat_load_n",
    "liner_opening_s",
    "liner_closing_s",
    "opening_lag_s",
    "closing_lag_s",
)
"""Quantities that are shown capture by capture."""
COMPARED = ("liner_compression_mean_kpa", "teat_load_n", "teat_end_beyond_flow_stop_kpa", "liner_closing_s")
_MISSING = "–"


class Found(NamedTuple):
    """A quantity of a capture, and what is true.

    Attributes:
        liner, cow: of the capture; without a cow it is the ramp.
        name, unit: of the quantity.
        value, sigma, common: as found; NaN if it was not.
        true: of the simulator.
    """

    liner: str
    cow: str
    name: str
    unit: str
    value: float
    sigma: float
    common: float
    true: float

    @classmethod
    def of(cls, liner: str, cow: str, row: Mapping[str, str], true: float) -> "Found":
        """A row of the table `quantities` of an analysis."""
        numbers = [float(row[key] or "nan") for key in ("value", "sigma_value", "sigma_common")]
        return cls(liner, cow, row["name"], row["unit"], *numbers, true)

    @property
    def off(self) -> float:
        """Error over σ."""
        return (self.value - self.true) / self.sigma

    def cell(self) -> str:
        """Error / σ, times in ms."""
        if not np.isfinite(self.value):
            return _MISSING
        scale = 1000.0 if self.unit == "s" else 1.0
        return f"{scale * (self.value - self.true):+.2f} / {scale * self.sigma:.2f}"


def tables(found: Sequence[Found]) -> Iterator[str]:
    """Lines of all tables."""
    milking = [one for one in found if one.cow]
    yield from (_introduction(), "")
    yield from (*of_liners(found), "", *of_captures(milking), "", *of_quantities(milking), "")
    yield from _differences(milking)


def _introduction() -> str:
    return paragraph(
        "By the commands `capture`, `analyse --profiles` and `profile add`, from an empty folder: a",
        "ramp of each liner, whose material goes into its profile, then four captures of 3 s on the",
        "teats of four cows. What was told of modulus, thickness, pretension, gauge, clock and flow",
        "stop was drawn within its σ. 8 bits, 6 columns of targets, each liner with its own object",
        "model. The truth is read from the solved walls. Cells are error / stated σ; times in ms.",
    )


def of_liners(found: Sequence[Found]) -> Iterator[str]:
    """Table of what ramps found of the empty liners."""
    yield "| empty liner | TPPD, kPa | CCPD, kPa | E t³ / 9, N mm |"
    yield "|---|---|---|---|"
    for liner in dict.fromkeys(one.liner for one in found):
        by_name = {one.name: one for one in found if one.liner == liner and not one.cow}
        yield f"| {liner} | {' | '.join(by_name[name].cell() for name in OWN)} |"


def of_captures(found: Sequence[Found]) -> Iterator[str]:
    """Table with a line for each capture."""
    yield "| liner, cow | LC, kPa | OP, kPa | load, N | opening | closing | lag, opening | lag, closing |"
    yield f"|{'---|' * (len(SHOWN) + 1)}"
    for liner, cow in dict.fromkeys((one.liner, one.cow) for one in found):
        here = {one.name: one for one in found if (one.liner, one.cow) == (liner, cow)}
        cells = (here[name].cell() if name in here else _MISSING for name in SHOWN)
        yield f"| {liner}, {cow} | {' | '.join(cells)} |"


def of_quantities(found: Sequence[Found]) -> Iterator[str]:
    """Table with a line for each quantity, over all captures."""
    yield "| quantity | captures | mean error | RMS | stated σ | χ² | greatest error / σ |"
    yield "|---|---|---|---|---|---|---|"
    for name in dict.fromkeys(one.name for one in found):
        every = [one for one in found if one.name == name]
        here = [one for one in every if np.isfinite(one.value)]
        if not here:
            yield f"| {name} | 0 of {len(every)} | – | – | – | – | – |"
            continue
        error = np.array([one.value - one.true for one in here])
        sigma, off = np.array([one.sigma for one in here]), np.array([one.off for one in here])
        numbers = (error.mean(), np.sqrt(np.mean(error**2)), np.sqrt(np.mean(sigma**2)), np.mean(off**2))
        cells = " | ".join(f"{number:.2g}" for number in numbers)
        yield f"| {name} | {len(here)} of {len(every)} | {cells} | {off[np.abs(off).argmax()]:+.1f} |"


def _differences(found: Sequence[Found]) -> Iterator[str]:
    """True differences, and their error / σ; what captures of one liner share is averaged by none of them."""
    yield "| difference of liners, same cows | " + " | ".join(COMPARED) + " |"
    yield f"|{'---|' * (len(COMPARED) + 1)}"
    for one, other in combinations(dict.fromkeys(each.liner for each in found), 2):
        cells = (_difference(found, name, one, other) for name in COMPARED)
        yield f"| {one} − {other} | {' | '.join(cells)} |"


def _difference(found: Sequence[Found], name: str, one: str, other: str) -> str:
    named = [each for each in found if each.name == name and np.isfinite(each.value)]
    sides = [{each.cow: each for each in named if each.liner == liner} for liner in (one, other)]
    cows = sorted(sides[0].keys() & sides[1].keys())
    if not cows:
        return _MISSING
    first, second = ([side[cow] for cow in cows] for side in sides)
    true = float(np.mean([a.true - b.true for a, b in zip(first, second, strict=True)]))
    told = float(np.mean([a.value - b.value for a, b in zip(first, second, strict=True)]))
    own = sum(max(each.sigma**2 - each.common**2, 0.0) for each in first + second) / len(cows) ** 2
    common = sum(float(np.mean([each.common for each in side])) ** 2 for side in (first, second))
    scale = 1000.0 if first[0].unit == "s" else 1.0
    return f"{scale * true:.2f}: {scale * (told - true):+.2f} / {scale * np.sqrt(own + common):.2f}"
