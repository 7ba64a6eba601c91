"""Hypothesis of the whole rig: one of either view, in an arrangement that the nominal rig can have.

Each view alone says too little: a swapped, mirrored or turned picture may explain it as well as the right
one. What the two say together, and the nominal rig, leave fewer ways, and between those that are left only a
person can choose.

Hypothesis: an assignment of a view's blobs to targets, with the resulting view and its likelihood; and the
contest of hypotheses, in which swapped, mirrored, turned and shifted ones always take part.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.adjustment.network import mutual_nearest
from grabberd.core.calibration.adjustment.starting_values import resect
from grabberd.core.calibration.calibration_frame import FALSE_BLOB, MISSING_TARGET, Symmetry
from grabberd.core.calibration.identification.hypothesis_growth import (
    QUICK,
    THOROUGH,
    Effort,
    Half,
    grow,
    regrow,
)
from grabberd.core.geometry import NominalRig, View, project
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import MeasurementError

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

    def is_rival_of(self, other: "Hypothesis") -> bool:
        """True if it contradicts another: by its targets, or by the view's handedness."""
        return self.view.handedness != other.view.handedness or not self.says_the_same(other)


@dataclass(frozen=True, slots=True, eq=False)
class Explainer:
    """Completes rough views to hypotheses.

    Attributes:
        half: The blobs.
        xyz_mm: (T, 3) targets of the calibration frame.
        sigma_px: Standard deviation of an image coordinate.
        symmetries: Motions that map most of the calibration frame onto itself.
        given: Certain targets by blob.
    """

    half: Half
    xyz_mm: Array
    sigma_px: float
    symmetries: Sequence[Symmetry] = ()
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


# All are always tried: on a nearly planar frame a mirrored view fits almost as well.
HANDEDNESS = (1, -1)
_FINALISTS = 3
_CHALLENGED = 24
"""Number of neighbouring targets that challenge a winner: all shifts by one and by two pitches."""
_MOST_CHALLENGES = 4
_BETTER = 1.0
"""Difference of cost from which a rival is better than the winner, and not as good but for rounding."""


def contest(explainer: Explainer, starts: Sequence[View], convincing: float) -> list[Hypothesis]:
    """Find the hypotheses of either handedness that explain a view best, including the winner's challengers.

    The search is repeated harder unless the winner explains a `convincing` share of the blobs.

    Args:
        explainer: The blobs and the calibration frame.
        starts: Nominal views to start from, of either handedness.
        convincing: Share of the blobs.
    """
    halves = [replace(explainer.half, view=one) for one in starts]
    rivals: list[Hypothesis] = []
    for effort in (QUICK, THOROUGH):
        rivals += _grown(explainer, halves, effort)
        if min(rivals, key=cost_of).found >= convincing * len(explainer.half.xy_px):
            break
    return _challenged(explainer, rivals)


def _grown(explainer: Explainer, halves: Sequence[Half], effort: Effort) -> list[Hypothesis]:
    growths = [grow(half, explainer.xyz_mm, effort) for half in halves]
    views = [view for growth in growths for view in growth.views(explainer.xyz_mm, _FINALISTS)]
    return [explainer.explain(view) for view in views]


def _challenged(explainer: Explainer, rivals: list[Hypothesis]) -> list[Hypothesis]:
    """Rivals after challenging the winner with what is easily mistaken for it."""
    winner: Hypothesis | None = None
    for _ in range(_MOST_CHALLENGES):
        best = min(rivals, key=cost_of)
        if not best.found or (winner and best.cost > winner.cost - _BETTER):
            break
        winner = best
        rivals += _challengers(explainer, winner)
    return rivals


def _challengers(explainer: Explainer, winner: Hypothesis) -> list[Hypothesis]:
    """Hypotheses that shift the winner by a pitch or two, turn it by quarters, mirror it, or move it as the
    frame is mapped onto itself.
    """
    known = np.flatnonzero(winner.target >= 0)
    middle = np.median(explainer.half.xy_px, axis=0)
    anchor = known[np.linalg.norm(explainer.half.xy_px[known] - middle, axis=1).argmin()]
    away = np.linalg.norm(explainer.xyz_mm - explainer.xyz_mm[winner.target[anchor]], axis=1)
    targets = np.argsort(away, kind="stable")[: _CHALLENGED + 1]
    middle_mm = explainer.xyz_mm.mean(axis=0)
    views: list[View] = [one.seen_from(winner.view, middle_mm) for one in explainer.symmetries]
    for one in HANDEDNESS:
        half = replace(explainer.half, view=replace(winner.view, b=(0.0,) * 9)).handed(one)
        views += regrow(half, explainer.xyz_mm, int(anchor), targets).views(explainer.xyz_mm, _FINALISTS)
    return [explainer.explain(view) for view in views]


cost_of = attrgetter("cost")


Pair = tuple[View, View]

_KEPT = 24
"""Hypotheses of one view that take part, the best first."""
_SAME_CENTER_DEG = 5.0
"""Angle between the sights of two views that see the frame from the same side."""
_SAME_TURN_DEG = 45.0


class Arrangement(StrEnum):
    """Arrangement of the views."""

    CONFIGURED = "as configured"
    SWAPPED = "swapped"


class RelativeLimits(NamedTuple):
    """Greatest deviation of base and distance from nominal, as a share, and of the relative orientation."""

    relative: float
    relative_deg: float


class Orientation(NamedTuple):
    """The calibration frame as the picture shows it.

    Attributes:
        turn_deg: Turn counter-clockwise, −180 to 180; 0 if its X points down the picture.
        is_mirrored: True if its Y points to the other side of its X than it does on the frame.
    """

    turn_deg: float
    is_mirrored: bool

    @classmethod
    def of(cls, view: View, middle_mm: Array) -> "Orientation":
        """Determine it in one view, at the frame's middle."""
        start, x, y = project(view, middle_mm + np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]))
        (x_along, x_down), (y_along, y_down) = (x - start).tolist(), (y - start).tolist()
        return cls(math.degrees(math.atan2(x_along, x_down)), x_along * y_down > x_down * y_along)

    def is_turned_like(self, turn_deg: float) -> bool:
        """True if a person would call it turned by this, one of the quarter turns."""
        return abs((self.turn_deg - turn_deg + 180) % 360 - 180) <= _SAME_TURN_DEG

    @property
    def quarter_deg(self) -> int:
        """The nearest quarter turn: 0, 90, 180 or 270."""
        return round(self.turn_deg / 90) % 4 * 90


class Corners(NamedTuple):
    """Ids of the targets at the top left and top right of the left view."""

    top_left: int
    top_right: int

    def __str__(self) -> str:
        return f"target {self.top_left} top left and {self.top_right} top right"


@dataclass(frozen=True, slots=True, eq=False)
class RigHypothesis:
    """Explanation of both views.

    Attributes:
        left, right: What explains each.
        arrangement: Which of them is seen from which side.
    """

    left: Hypothesis
    right: Hypothesis
    arrangement: Arrangement

    @property
    def sides(self) -> tuple[Hypothesis, Hypothesis]:
        """Hypotheses of the left and the right view."""
        return self.left, self.right

    def __iter__(self) -> Iterator[Hypothesis]:
        return iter(self.sides)

    @property
    def cost(self) -> float:
        """−2 ln of the likelihood, up to a constant of the picture."""
        return self.left.cost + self.right.cost

    @property
    def handedness(self) -> tuple[int, int]:
        """Handedness of the left and the right view."""
        return self.left.view.handedness, self.right.view.handedness

    def is_rival_of(self, other: "RigHypothesis") -> bool:
        """True if it contradicts another in any way."""
        if self.arrangement is not other.arrangement:
            return True
        return any(one.is_rival_of(another) for one, another in zip(self, other, strict=True))

    def orientation(self, frame: ObjectModel) -> Orientation:
        """Orientation of the calibration frame in the left view."""
        return Orientation.of(self.left.view, frame.xyz_mm.mean(axis=0))

    def corners(self, frame: ObjectModel, xy_px: Array) -> Corners:
        """Its corners among the left view's blobs (B, 2)."""
        known = np.flatnonzero(self.left.target >= 0)
        x, y = xy_px[known].T
        ids = frame.target[self.left.target[known]]
        return Corners(int(ids[(x + y).argmin()]), int(ids[(y - x).argmin()]))


def paired(
    left: Sequence[Hypothesis], right: Sequence[Hypothesis], nominal: NominalRig, limits: RelativeLimits
) -> list[RigHypothesis]:
    """Pair the hypotheses that one rig explains, the best first."""
    pairs = sorted(((one, other) for one in _distinct(left) for other in _distinct(right)), key=_sum)
    return [
        RigHypothesis(one, other, arrangement)
        for one, other in pairs
        for arrangement in dict.fromkeys(
            arrangement
            for arrangement, wanted in _as_built(nominal, one.view, other.view)
            if misfit((one.view, other.view), wanted, limits) is None
        )
    ]


def start_views(nominal: NominalRig, index: int) -> tuple[View, ...]:
    """Nominal views of the left (0) or right (1) half, whatever may have happened to the picture.

    As configured, from the other side, and either as another number of mirrors shows it; then of halves that
    were exchanged, or mirrored in their places, which moves the principal point with them.
    """
    own, other = nominal.views()[index], nominal.views()[1 - index]
    shift = own.first_column - other.first_column
    exchanged = replace(
        other,
        name=own.name,
        first_column=own.first_column,
        end_column=own.end_column,
        x0_px=other.x0_px + shift,
    )
    in_place = replace(_flipped(own), x0_px=own.first_column + own.end_column - 1 - own.x0_px)
    handed = [rig.views((sign, sign))[index] for rig in (nominal, nominal.swapped) for sign in (1, -1)]
    return (*handed, exchanged, in_place)


def _flipped(view: View) -> View:
    """The view of a picture mirrored about its principal point."""
    return view.with_axes(np.diag([-1.0, 1.0, 1.0]) @ view.axes)


def _as_built(nominal: NominalRig, left: View, right: View) -> Iterator[tuple[Arrangement, Pair]]:
    """The nominal views in every arrangement, with the handedness of these."""
    signs = left.handedness, right.handedness
    yield Arrangement.CONFIGURED, nominal.views(signs)
    yield Arrangement.SWAPPED, nominal.swapped.views(signs)
    one, other = nominal.views()
    for arrangement, views in ((Arrangement.CONFIGURED, (one, other)), (Arrangement.SWAPPED, (other, one))):
        first, second = (
            _flipped(view) if sign < 0 else view for view, sign in zip(views, signs, strict=True)
        )
        yield arrangement, (first, second)


def rivals_of(
    winner: RigHypothesis, found: Sequence[RigHypothesis], margin: float
) -> Iterator[RigHypothesis]:
    """Yield the hypotheses that contradict the winner and one another, and cost less than a margin more."""
    kept = [winner]
    for one in found:
        if one.cost - winner.cost < margin and all(one.is_rival_of(other) for other in kept):
            kept.append(one)
            yield one


def misfit(found: Pair, wanted: Pair, limits: RelativeLimits) -> MeasurementError | None:
    """Say how two views contradict the nominal ones: by orientation, base or distance; or None."""
    base_mm, nominal_mm = _base(*found), _base(*wanted)
    turned_deg = max(_angle_deg(base_mm, nominal_mm), _turn_deg(_relative(*found) @ _relative(*wanted).T))
    if turned_deg > limits.relative_deg:
        return MeasurementError(
            f"the views are rotated against one another by {turned_deg:.0f} degrees from the nominal rig; "
            f"up to {limits.relative_deg:g} are allowed",
            "check the rig's nominal geometry and that the file belongs to this calibration frame",
        )
    lengths = [("base", _length(base_mm), _length(nominal_mm))]
    for view, built in zip(found, wanted, strict=True):
        lengths.append(
            (f"distance of the {view.name} view", _length(view.center_mm), _length(built.center_mm))
        )
    for what, found_mm, stated_mm in lengths:
        if abs(found_mm / stated_mm - 1) > limits.relative:
            return MeasurementError(
                f"the {what} comes out as {found_mm:.0f} mm, but the nominal rig has {stated_mm:.0f} mm",
                "check the rig's nominal geometry, the focal length too, and that the file belongs to this "
                "calibration frame: another pitch has the same effect",
            )
    return None


def least_misfit(
    left: Hypothesis, right: Hypothesis, nominal: NominalRig, limits: RelativeLimits
) -> MeasurementError:
    """Say what contradicts the arrangement that a pair, which no rig explains, comes nearest to."""
    pair = left.view, right.view
    base_mm = _base(*pair)
    wanted = min(
        (views for _, views in _as_built(nominal, *pair)),
        key=lambda views: _angle_deg(base_mm, _base(*views)),
    )
    reason = misfit(pair, wanted, limits)
    assert reason is not None, "a pair without one would have been found"
    return reason


def _distinct(rivals: Sequence[Hypothesis]) -> list[Hypothesis]:
    """The best hypotheses that differ in targets, handedness or the side that they see the frame from."""
    kept: list[Hypothesis] = []
    for one in sorted(rivals, key=cost_of):
        if len(kept) == _KEPT:
            break
        if one.found and all(one.is_rival_of(other) or _sees_otherwise(one, other) for other in kept):
            kept.append(one)
    return kept


def _sees_otherwise(one: Hypothesis, other: Hypothesis) -> bool:
    return _angle_deg(one.view.center_mm, other.view.center_mm) > _SAME_CENTER_DEG


def _sum(pair: tuple[Hypothesis, Hypothesis]) -> float:
    return pair[0].cost + pair[1].cost


def _base(left: View, right: View) -> Array:
    """(3,) from the left centre to the right one, in the left camera's coordinates."""
    return left.axes @ (right.center_mm - left.center_mm)


def _relative(left: View, right: View) -> Array:
    """(3, 3) from the left camera's coordinates into the right one's."""
    return right.axes @ left.axes.T


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _turn_deg(rotation: Array) -> float:
    return math.degrees(math.acos(max(-1.0, min(1.0, (float(np.trace(rotation)) - 1) / 2))))


def _angle_deg(first: Array, second: Array) -> float:
    cosine = float(first @ second) / (_length(first) * _length(second))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
