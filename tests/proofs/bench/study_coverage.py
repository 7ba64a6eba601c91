"""How well the intervals of a study cover, and how often it sees a difference where there is none."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from tests.proofs.bench.pressure_case import paragraph

from grabberd_liner.analysis.comparison import Comparison, compare
from grabberd_liner.analysis.mixed_model import observations

TRIALS = 1000
CERTAIN = 0.05
BLOCK_SIGMA, SCATTER_SIGMA, OWN_SIGMA = 2.0, 0.4, 0.3
"""Standard deviations between cows, between captures of a cow, and of a measurement; in kPa."""
SIZES = ((2, 2), (2, 4), (3, 2), (3, 3), (3, 4), (4, 2), (4, 4))
"""Liners, and captures of each or cows."""
COMMON_SIGMAS = (0.0, 0.5)


class Case(NamedTuple):
    """A way to measure.

    Attributes:
        name: as the table has it.
        blocks: True if every cow has every liner.
        missing: share of the captures that are missing, at random, one in every liner at least stays.
    """

    name: str
    blocks: bool
    missing: float


CASES = (
    Case("captures on their own", False, 0.0),
    Case("every cow with every liner", True, 0.0),
    Case("cows with liners, a quarter missing", True, 0.25),
)


class Counted(NamedTuple):
    """Shares over the trials: of intervals that cover, and of studies that see a difference."""

    differences: float
    means: float
    false_alarms: float


def table(trials: int = TRIALS, sizes: Sequence[tuple[int, int]] = SIZES) -> str:
    """Markdown."""
    rows = [
        paragraph(
            f"{trials} studies each of liners that do not differ; a measurement's own σ is",
            f"{OWN_SIGMA} kPa, captures of a cow scatter by another {SCATTER_SIGMA} kPa, cows by",
            f"{BLOCK_SIGMA} kPa. The common part is drawn once per liner. Goal: 95 %",
            "of the intervals contain",
            "the truth, and at most 5 % of the studies find a difference (p below",
            ".05, adjusted by Holm's method).",
            f"Chance alone: ± {_chance(trials):.1f} %.",
        ),
        "",
        "| design | liners × captures | common part, kPa | differences covered | means covered | alarms |",
        "|---|---|---|---|---|---|",
    ]
    for case in CASES:
        for size in sizes:
            for common in COMMON_SIGMAS:
                found = counted(case, size, common, trials)
                shares = " | ".join(f"{100 * share:.1f} %" for share in found)
                rows.append(f"| {case.name} | {size[0]} × {size[1]} | {common} | {shares} |")
    return "\n".join(rows)


def _chance(trials: int) -> float:
    """Standard deviation of a share of 95 %."""
    return 100 * float(np.sqrt(0.95 * 0.05 / trials))


def counted(case: Case, size: tuple[int, int], common: float, trials: int) -> Counted:
    """Study liners that are alike, again and again."""
    random = np.random.default_rng(
        [size[0], size[1], int(10 * common), int(case.blocks), int(100 * case.missing)]
    )
    found = [judged for _ in range(trials) for judged in _judged(case, size, common, random)]
    return Counted(*np.nanmean(np.array(found), axis=0))


def _judged(
    case: Case, size: tuple[int, int], common: float, random: np.random.Generator
) -> Iterator[tuple[float, float, float]]:
    """Shares of the differences and means that cover the truth, which is 0, and 1 for an alarm."""
    compared = _study(case, size, common, random)
    tested = [one for one in compared.differences if np.isfinite(one.found.dof)]
    if not tested:  # so much is missing that nothing can be tested
        return
    covered = [abs(one.found.value) <= one.found.half_width for one in tested]
    means = [abs(one.value) <= one.half_width for one in compared.means if np.isfinite(one.dof)]
    alarm = any(one.adjusted_p < CERTAIN for one in tested)
    yield float(np.mean(covered)), float(np.mean(means)) if means else np.nan, float(alarm)


def _study(case: Case, size: tuple[int, int], common: float, random: np.random.Generator) -> Comparison:
    groups, captures = size
    group, cow = (part.ravel() for part in np.indices(size))
    kept = random.uniform(size=groups * captures) >= case.missing
    kept[group * captures + random.integers(0, captures, groups)[group] == np.arange(groups * captures)] = (
        True
    )
    own = np.hypot(SCATTER_SIGMA, OWN_SIGMA) * random.normal(size=groups * captures)
    cows = BLOCK_SIGMA * random.normal(size=captures)
    # Without blocks every capture is of a cow of its own, of a herd that is much alike.
    value = common * random.normal(size=groups)[group] + own + (cows[cow] if case.blocks else 0.0)
    group, cow, value = group[kept], cow[kept], value[kept]
    sigma = np.full(len(value), np.hypot(OWN_SIGMA, common))
    observed = observations(value, sigma, np.full(len(value), common), group.tolist())
    return compare(observed, group, block=cow if case.blocks else None)
