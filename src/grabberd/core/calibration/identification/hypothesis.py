"""Hypothesis: an assignment of a view's blobs to targets, with the resulting view and its likelihood; and the
ranking of hypotheses: the winner, and the best one that contradicts it.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.adjustment.network import mutual_nearest
from grabberd.core.calibration.adjustment.starting_values import resect
from grabberd.core.calibration.identification.hypothesis_growth import (
    QUICK,
    THOROUGH,
    Effort,
    Half,
    grow,
    regrow,
)
from grabberd.core.geometry import View, project, rotation_matrix

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

FALSE_BLOB, MISSING_TARGET = 13.0, 5.0
"""−2 ln of the odds of a blob that is no target, against one where it must be; and of an unseen target."""
_BEHIND = 1e6
"""Cost of a camera behind the targets, from where a mirrored one sees a planar frame just as well."""
_GATES = (0.3, 0.2, 0.12, 0.12)
"""Gates while the view is refined, as shares of the blobs' spacing."""
_STEPS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """Explanation of the B blobs of a view.

    Attributes:
        view: The view that fits the assignment, roughly.
        target: (B,) index of the blob's target in the calibration frame; −1 for none.
        residual_px: (B, 2) observed minus computed; NaN without a target.
        cost: −2 ln of the likelihood, up to a constant of the picture.
    """

    view: View
    target: Indices
    residual_px: Array
    cost: float

    @property
    def found(self) -> int:
        """Number of identified targets."""
        return int((self.target >= 0).sum())

    @property
    def rms_px(self) -> float:
        """RMS of their residuals per coordinate; NaN if there are none."""
        known = self.residual_px[self.target >= 0]
        return math.sqrt(float((known * known).mean())) if len(known) else math.nan

    def says_the_same(self, other: "Hypothesis") -> bool:
        """True if both assign the same targets to most of the blobs that both explain."""
        both = (self.target >= 0) & (other.target >= 0)
        return 2 * int((self.target == other.target)[both].sum()) > int(both.sum())

    def turned_deg(self, nominal: View) -> float:
        """Rotation of the calibration frame in its plane relative to the nominal rig, −180 to 180."""
        turn = _rotation(nominal).T @ _rotation(self.view)
        return math.degrees(math.atan2(turn[0, 1] - turn[1, 0], turn[0, 0] + turn[1, 1]))


@dataclass(frozen=True, slots=True, eq=False)
class Explainer:
    """Completes rough views to hypotheses.

    Attributes:
        half: The blobs.
        xyz_mm: (T, 3) targets of the calibration frame.
        sigma_px: Standard deviation of an image coordinate.
        given: Certain targets by blob.
    """

    half: Half
    xyz_mm: Array
    sigma_px: float
    given: Mapping[int, int] = field(default_factory=dict)

    @property
    def gate_px(self) -> float:
        """Distance beyond which a blob is more likely false than the target predicted there."""
        return self.sigma_px * math.sqrt(FALSE_BLOB)

    def explain(self, start: View) -> Hypothesis:
        """Refine a rough view to a hypothesis by alternately predicting targets and assigning blobs."""
        view = start
        for share in _GATES:
            target = mutual_nearest(self._between(view), share * self.half.spacing_px)
            known = np.flatnonzero(target >= 0)
            targets_mm, seen_px = self.xyz_mm[target[known]], self.half.xy_px[known]
            view = resect(view, targets_mm, seen_px, self.sigma_px, prior=start, most_steps=_STEPS).view
        target = self._undoubted(view)
        residual = np.full(self.half.xy_px.shape, np.nan)
        known = np.flatnonzero(target >= 0)
        residual[known] = self.half.xy_px[known] - project(view, self.xyz_mm[target[known]])
        return Hypothesis(view, target, residual, self._cost(view, residual))

    def _undoubted(self, view: View) -> Indices:
        """(B,) the target in a blob's gate, if each is the only candidate of the other."""
        near = self._between(view) <= self.gate_px
        alone = near & (near.sum(axis=1, keepdims=True) == 1) & (near.sum(axis=0) == 1)
        return np.where(alone.any(axis=1), alone.argmax(axis=1), -1)

    def _between(self, view: View) -> Array:
        """(B, T) distances of blobs from predictions in px; given targets have distance 0."""
        between: Array = np.linalg.norm(self.half.xy_px[:, np.newaxis] - project(view, self.xyz_mm), axis=2)
        between[np.isnan(between)] = np.inf
        for blob, target in self.given.items():
            between[blob], between[:, target] = np.inf, np.inf
            between[blob, target] = 0.0
        return between

    def _cost(self, view: View, residual_px: Array) -> float:
        square = np.nan_to_num((residual_px**2).sum(axis=1) / self.sigma_px**2, nan=FALSE_BLOB)
        visible = self.half.shows(project(view, self.xyz_mm)).sum()
        behind = _BEHIND if view.Z0_mm < float(np.median(self.xyz_mm[:, 2])) else 0.0
        missing = max(0, int(visible) - int(np.isfinite(residual_px[:, 0]).sum()))
        return float(np.minimum(square, FALSE_BLOB).sum()) + MISSING_TARGET * missing + behind


def _rotation(view: View) -> Array:
    return rotation_matrix(view.omega_rad, view.phi_rad, view.kappa_rad)


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
        half = replace(explainer.half, view=replace(winner.view, b=(0.0,) * 9)).handed(one)
        views += regrow(half, explainer.xyz_mm, int(anchor), targets).views(explainer.xyz_mm, _FINALISTS)
    return [explainer.explain(view) for view in views]


_cost = attrgetter("cost")
