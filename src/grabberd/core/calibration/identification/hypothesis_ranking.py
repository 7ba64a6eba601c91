"""Ranking of one view's hypotheses: the winner, and the best one that contradicts it."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.calibration.identification.hypothesis import Explainer, Hypothesis
from grabberd.core.calibration.identification.hypothesis_growth import QUICK, THOROUGH, Effort, grow, regrow
from grabberd.core.geometry import View

# Both are always tried: on a nearly planar frame a mirrored view fits almost as well.
HANDEDNESS = (1, -1)
_FINALISTS = 3
_CHALLENGED = 24
"""Number of neighbouring targets that challenge a winner: all shifts by one and by two pitches."""
_MOST_CHALLENGES = 4


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The winner, and the best hypothesis that contradicts it, or None."""

    winner: Hypothesis
    runner_up: Hypothesis | None

    @property
    def margin(self) -> float:
        """Cost difference to the runner-up; infinite if there is none."""
        return np.inf if self.runner_up is None else self.runner_up.cost - self.winner.cost


def contest(explainer: Explainer, convincing: float) -> list[Hypothesis]:
    """Find the hypotheses of either handedness that explain a view best, including the winner's challengers.

    The search is repeated harder unless the winner explains a `convincing` share of the blobs.
    """
    rivals: list[Hypothesis] = []
    for effort in (QUICK, THOROUGH):
        rivals += _grown(explainer, effort)
        if min(rivals, key=_cost).found >= convincing * len(explainer.half.xy_px):
            break
    return _challenged(explainer, rivals)


def settled(rivals: Iterable[Hypothesis]) -> Outcome:
    """Determine the winner and the runner-up of some hypotheses."""
    ranked = sorted(rivals, key=_cost)
    others = (one for one in ranked[1:] if not one.says_the_same(ranked[0]))
    return Outcome(ranked[0], next(others, None))


def _grown(explainer: Explainer, effort: Effort) -> list[Hypothesis]:
    growths = [grow(explainer.half.handed(one), explainer.xyz_mm, effort) for one in HANDEDNESS]
    views = [view for growth in growths for view in growth.views(explainer.xyz_mm, _FINALISTS)]
    return [explainer.explain(view) for view in views]


def _challenged(explainer: Explainer, rivals: list[Hypothesis]) -> list[Hypothesis]:
    """Rivals after challenging the winner with what is easily mistaken for it."""
    winner: Hypothesis | None = None
    for _ in range(_MOST_CHALLENGES):
        best = min(rivals, key=_cost)
        if not best.found or (winner and best.says_the_same(winner)):
            break
        winner = best
        rivals += _challengers(explainer, winner)
    return rivals


def _challengers(explainer: Explainer, winner: Hypothesis) -> list[Hypothesis]:
    """Hypotheses that shift the winner by a pitch or two, turn it by quarters, or mirror it."""
    known = np.flatnonzero(winner.target >= 0)
    middle = np.median(explainer.half.xy_px, axis=0)
    anchor = known[np.linalg.norm(explainer.half.xy_px[known] - middle, axis=1).argmin()]
    away = np.linalg.norm(explainer.xyz_mm - explainer.xyz_mm[winner.target[anchor]], axis=1)
    targets = np.argsort(away, kind="stable")[: _CHALLENGED + 1]
    views: list[View] = []
    for one in HANDEDNESS:
        half = replace(explainer.half, view=_undistorted(winner.view)).handed(one)
        views += regrow(half, explainer.xyz_mm, int(anchor), targets).views(explainer.xyz_mm, _FINALISTS)
    return [explainer.explain(view) for view in views]


def _undistorted(view: View) -> View:
    return replace(view, b=(0.0,) * len(view.b))


def _cost(hypothesis: Hypothesis) -> float:
    return hypothesis.cost
