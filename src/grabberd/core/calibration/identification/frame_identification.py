"""Automatic identification of the calibration frame's targets among the blobs of both views (paper 3.6).

The nominal rig is good to ten per cent, which on a periodic grid is a whole pitch, so every hypothesis is
tried: every target at some blobs, the calibration frame turned in any way, either handedness of either
view, the views as configured and swapped. Each is judged by the view that it implies: depth differences of
the targets reveal a wrong one. What two views of one rig say together decides; what it leaves open is
refused, and so is a picture that contradicts the rig's configuration.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.calibration_frame import Symmetry, symmetries
from grabberd.core.calibration.identification.decision import Stated, decided
from grabberd.core.calibration.identification.hypothesis_growth import Half
from grabberd.core.calibration.identification.rig_hypothesis import (
    Explainer,
    Hypothesis,
    Orientation,
    RelativeLimits,
    RigHypothesis,
    contest,
    cost_of,
    least_misfit,
    paired,
    start_views,
)
from grabberd.core.geometry import NominalRig, View, project
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AmbiguousView, MeasurementError

NAMES = ("left", "right")
_SAME_SCALE = 1.35
"""Ratio of seen to expected spacing that the nominal rig's ten per cent explain."""
_UNITS = {"cm": 10.0, "inches": 25.4, "m": 1000.0, "µm": 0.001}
_MANY = 0.5
"""Blobs per target of the frame from which a view alone is seldom explained wrongly."""
_MOST_SYMMETRIES = 8
"""The most complete ones; shifts are tried in any case."""


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Criteria for accepting an identification.

    Attributes:
        handedness: Of the left and the right view, +1 or −1, as their mirrors make it; None where it is not
            known. A picture that contradicts it is refused.
        least_targets: Least number of identified targets that determines a view.
        least_share: Share of a view's blobs that the winner must explain.
        sigma_px: Total standard deviation of an image coordinate, including errors of the rough model.
        most_rms_px: Greatest RMS of the identified targets' residuals; more indicates another calibration
            frame.
        margin: Least difference of −2 ln(likelihood) between runner-up and winner, of both views together:
            one target more that both views show where only the winner has one makes 36 at most.
        relative: Greatest relative deviation of base and distance from nominal.
        relative_deg: Greatest deviation of the views' relative orientation from nominal.
        turn_deg: Turn of the calibration frame in the picture, one of the quarter turns, by a person who has
            looked; None where nobody has.
    """

    handedness: tuple[int | None, int | None] = (None, None)
    least_targets: int = 12
    least_share: float = 0.8
    sigma_px: float = 0.5
    most_rms_px: float = 0.5
    margin: float = 20.0
    relative: float = 0.3
    relative_deg: float = 20.0
    turn_deg: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ViewIdentification:
    """Identification of one view's B blobs.

    Attributes:
        view: The view that fits: start values for the adjustment, handedness included.
        target: (B,) index of each blob's target in the calibration frame; −1 for none.
        residual_px: (B, 2) residuals of the view's rough model; NaN without a target.
        rms_px: Root mean square of these residuals.
        runner_up_rms_px: That of the best contradicting hypothesis, over the blobs that it explains; NaN if
            there is none.
        runner_up_targets: Number of those blobs.
        margin: Difference of −2 ln(likelihood), of both views, between winner and runner-up; infinite if
            there is none.
        description: Description of the winning hypothesis, for people.
    """

    view: View
    target: Indices
    residual_px: Array
    rms_px: float
    runner_up_rms_px: float
    runner_up_targets: int
    margin: float
    description: str

    @property
    def unmatched(self) -> Indices:
        """Indices of blobs without a target."""
        return np.flatnonzero(self.target < 0)


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Identification of both views, left then right.

    Attributes:
        orientation: How the left view shows the calibration frame.
        by_statement: True if the picture left several ways, and only what a person has stated decides.
    """

    left: ViewIdentification
    right: ViewIdentification
    orientation: Orientation
    by_statement: bool = False

    def __iter__(self) -> Iterator[ViewIdentification]:
        return iter((self.left, self.right))

    @property
    def views(self) -> tuple[View, View]:
        """Left and right view, as start values for an adjustment."""
        return self.left.view, self.right.view

    @property
    def handedness(self) -> tuple[int, int]:
        """Handedness of the left and the right view."""
        return self.left.view.handedness, self.right.view.handedness


def identify_frame(
    nominal: NominalRig,
    frame: ObjectModel,
    left_px: Array,
    right_px: Array,
    settings: IdentificationSettings | None = None,
) -> Identification:
    """Identify the targets of a calibration frame among the blobs of both views.

    Args:
        nominal: The nominal rig, each number good to ten per cent.
        frame: The calibration frame; Z points toward the cameras, its rotation in the plane is free.
        left_px: (B, 2) frame pixels of the left view's blobs, targets and others, in any order.
        right_px: Likewise for the right view.
        settings: Criteria of acceptance, and what is known of the picture.

    Raises:
        AmbiguousView: The picture fits several hypotheses; the message has them, the hint says what decides.
        MeasurementError: A view is dark or shows too few targets, no hypothesis explains it, or the views
            contradict each other, the nominal rig or the settings; the message says which, with values.
    """
    settings = settings or IdentificationSettings()
    halves = halves_of(nominal, (left_px, right_px), settings)
    alike = symmetries(frame)
    rivals = [rivals_of_view(nominal, frame, half, alike, settings) for half in halves]
    return identified(nominal, frame, halves, rivals, settings)


def halves_of(
    nominal: NominalRig, blobs_px: Sequence[Array], settings: IdentificationSettings
) -> tuple[Half, Half]:
    """Prepare the blobs of both views.

    Raises:
        MeasurementError: A view is dark, or shows too few.
    """
    for name, xy_px in zip(NAMES, blobs_px, strict=True):
        check_count(name, len(xy_px), "blobs", settings.least_targets)
    left, right = (
        Half.of(view, nominal.lines, xy_px) for view, xy_px in zip(nominal.views(), blobs_px, strict=True)
    )
    return left, right


def rivals_of_view(
    nominal: NominalRig,
    frame: ObjectModel,
    half: Half,
    alike: Sequence[Symmetry],
    settings: IdentificationSettings,
) -> list[Hypothesis]:
    """Hypotheses that explain one view, whatever the picture may have suffered.

    Raises:
        MeasurementError: None explains enough of it.
    """
    explainer = Explainer(half, frame.xyz_mm, settings.sigma_px, alike[:_MOST_SYMMETRIES])
    starts = start_views(nominal, NAMES.index(half.view.name))
    rivals = contest(explainer, starts, settings.least_share)
    _check_explained(half, min(rivals, key=cost_of), nominal, frame, settings)
    return rivals


def identified(
    nominal: NominalRig,
    frame: ObjectModel,
    halves: tuple[Half, Half],
    rivals: Sequence[Sequence[Hypothesis]],
    settings: IdentificationSettings,
    marked: tuple[Mapping[int, int], Mapping[int, int]] = ({}, {}),
) -> Identification:
    """Decide between the hypotheses of both views.

    Args:
        nominal: The nominal rig.
        frame: The calibration frame.
        halves: The blobs of both views.
        rivals: Hypotheses of either view.
        settings: Criteria of acceptance, and what is known of the picture.
        marked: Targets (index) of some blobs of either view, by a person who has looked.

    Raises:
        AmbiguousView: Several explain the picture.
        MeasurementError: None does, or the best contradicts the rig or what is known.
    """
    limits = RelativeLimits(settings.relative, settings.relative_deg)
    left, right = rivals
    found = paired(left, right, nominal, limits)
    if not found or not all(
        _explains(side, half, settings) for side, half in zip(found[0], halves, strict=True)
    ):
        # Each view alone is explained well, but not by one rig.
        for half, own in zip(halves, rivals, strict=True):
            _check_clear(half, own, frame, settings)
        raise _unlike_one_rig(
            least_misfit(min(left, key=cost_of), min(right, key=cost_of), nominal, limits), halves, frame
        )
    stated = Stated(settings.handedness, settings.turn_deg, marked, settings.margin)
    winner, others, by_statement = decided(found, frame, halves[0].xy_px, stated)
    for half, side in zip(halves, winner, strict=True):
        _check_explained(half, side, nominal, frame, settings)
    sides = [_side(winner, others, index, half, frame) for index, half in enumerate(halves)]
    return Identification(sides[0], sides[1], winner.orientation(frame), by_statement)


def _unlike_one_rig(misfit: MeasurementError, halves: Sequence[Half], frame: ObjectModel) -> MeasurementError:
    """The misfit of both views, or what is likelier to be wrong: a view that shows little fits anything."""
    few = [half for half in halves if len(half.xy_px) < _MANY * len(frame)]
    if not few:
        return misfit
    shown = " and ".join(f"the {half.view.name} view shows {len(half.xy_px)} blobs" for half in few)
    return MeasurementError(
        f"{shown} of {len(frame)} targets, too few to tell which they are: {misfit.message}",
        "let both views show the whole calibration frame; check light and threshold",
    )


def _side(
    both: RigHypothesis, others: Sequence[RigHypothesis], index: int, half: Half, frame: ObjectModel
) -> ViewIdentification:
    winner = both.sides[index]
    rival = next((one for one in others if one.sides[index].is_rival_of(winner)), None)
    other = None if rival is None else rival.sides[index]
    return ViewIdentification(
        view=winner.view,
        target=winner.target,
        residual_px=winner.residual_px,
        rms_px=winner.rms_px,
        runner_up_rms_px=np.nan if other is None else other.rms_px,
        runner_up_targets=0 if other is None else other.found,
        margin=np.inf if rival is None else rival.cost - both.cost,
        description=described(winner, half, frame),
    )


def described(hypothesis: Hypothesis, half: Half, frame: ObjectModel) -> str:
    """Describe a hypothesis of one view for people."""
    known = np.flatnonzero(hypothesis.target >= 0)
    if not len(known):
        return "nothing explained"
    away = np.linalg.norm(half.xy_px[known] - np.median(half.xy_px, axis=0), axis=1)
    blob = known[away.argmin()]
    x, y = half.xy_px[blob]
    turn_deg = round(Orientation.of(hypothesis.view, frame.xyz_mm.mean(axis=0)).turn_deg) + 0
    return (
        f"target {frame.target[hypothesis.target[blob]]} at ({x:.0f}, {y:.0f}) px, the calibration frame "
        f"turned by {turn_deg} degrees, handedness {hypothesis.view.handedness:+d}: "
        f"{len(known)} of {len(half.xy_px)} blobs explained to {hypothesis.rms_px:.2f} px"
    )


def check_count(name: str, count: int, what: str, least: int) -> None:
    """Check that a view shows enough blobs or targets.

    Raises:
        MeasurementError: It is dark, or shows too few.
    """
    if not count:
        raise MeasurementError(
            f"the {name} view is dark: it shows no {what}",
            "light the calibration frame for both views, or lower the threshold; look at the preview",
        )
    if count < least:
        raise MeasurementError(
            f"the {name} view shows {count} {what}, at least {least} are needed",
            "place the calibration frame in both views; check light and threshold",
        )


def _check_explained(
    half: Half, best: Hypothesis, nominal: NominalRig, frame: ObjectModel, settings: IdentificationSettings
) -> None:
    name, count = half.view.name, len(half.xy_px)
    if best.found >= settings.least_share * count:
        check_count(name, best.found, "targets that can be identified", settings.least_targets)
    if not _explains(best, half, settings):
        explained = f"{best.found} to {best.rms_px:.2f} px" if best.found else "none"
        raise MeasurementError(
            f"the {name} view does not show the calibration frame {frame.name}: of its {count} blobs the "
            f"best hypothesis explains {explained}, but "
            f"{settings.least_share:.0%} to {settings.most_rms_px:g} px are needed"
            + (f" ({described(best, half, frame)})" if best.found else ""),
            _scale_hint(nominal, frame, half)
            or "check that the file belongs to this calibration frame, the rig's nominal geometry, and that "
            "nothing else reflects",
        )


def _check_clear(
    half: Half, rivals: Sequence[Hypothesis], frame: ObjectModel, settings: IdentificationSettings
) -> None:
    """Check that one view does not fit several hypotheses, of which the right one may be no rig's best."""
    best = min(rivals, key=cost_of)
    others = [one for one in rivals if one.is_rival_of(best) and one.cost - best.cost < settings.margin]
    if others:
        raise AmbiguousView(
            f"the {half.view.name} view is ambiguous: {described(best, half, frame)}; or "
            f"{described(min(others, key=cost_of), half, frame)}",
            "let both views show the whole calibration frame, or mark some targets by hand",
        )


def _explains(one: Hypothesis, half: Half, settings: IdentificationSettings) -> bool:
    enough = one.found >= settings.least_share * len(half.xy_px)
    return enough and one.rms_px <= settings.most_rms_px


def _scale_hint(nominal: NominalRig, frame: ObjectModel, half: Half) -> str | None:
    """Hint for targets that lie much closer or wider than nominal rig and file let expect; None otherwise."""
    if len(frame) < 2:
        return None
    wanted = Half.of(half.view, nominal.lines, project(half.view, frame.xyz_mm))
    ratio = half.spacing_px / wanted.spacing_px
    if 1 / _SAME_SCALE < ratio < _SAME_SCALE:
        return None
    unit = next((name for name, mm in _UNITS.items() if 0.8 < ratio / mm < 1.25), None)
    cause = f"is the file in {unit} instead of mm? " if unit else ""
    return (
        f"{cause}the targets lie {ratio:.2f} times as far apart in the picture as the file and the nominal "
        "rig let expect: check the unit and pitch of the calibration frame's file, focal length and distance"
    )
