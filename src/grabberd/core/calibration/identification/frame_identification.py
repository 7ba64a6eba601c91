"""Automatic identification of the calibration frame's targets among the blobs of both views (paper 3.6).

The nominal rig is good to ten per cent, which on a periodic grid is a whole pitch, so every hypothesis is
tried: every target at some blobs, the calibration frame rotated in any way, either handedness of either view.
Each is judged by the view that it implies: depth differences of the targets reveal a wrong one. An ambiguous
winner is refused, and so are two views that do not belong to one rig, close to the nominal one.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.identification.hypothesis import (
    Explainer,
    Hypothesis,
    Outcome,
    contest,
    settled,
)
from grabberd.core.calibration.identification.hypothesis_growth import Half
from grabberd.core.geometry import NominalRig, View, project
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AmbiguousView, MeasurementError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class IdentificationSettings:
    """Criteria for accepting an identification.

    Attributes:
        handedness: Of the left and the right view, +1 or −1; None finds it from the picture.
        least_targets: Least number of identified targets that determines a view.
        least_share: Share of a view's blobs that the winner must explain.
        sigma_px: Total standard deviation of an image coordinate, including errors of the rough model.
        most_rms_px: Greatest RMS of the identified targets' residuals; more indicates another calibration
            frame.
        margin: Least difference of −2 ln(likelihood) between runner-up and winner.
        relative: Greatest relative deviation of base and distance from nominal.
        relative_deg: Greatest deviation of the views' relative orientation from nominal.
    """

    handedness: tuple[int | None, int | None] = (None, None)
    least_targets: int = 12
    least_share: float = 0.8
    sigma_px: float = 0.5
    most_rms_px: float = 0.5
    margin: float = 60.0
    relative: float = 0.3
    relative_deg: float = 20.0


def check_pair(left: View, right: View, nominal: NominalRig, settings: IdentificationSettings) -> None:
    """Check that the views are oriented relative to one another and to the calibration frame as nominal.

    Raises:
        MeasurementError: The views are rotated against one another, or base or distance differ; the message
            has the values.
    """
    wanted = nominal.views((left.handedness, right.handedness))
    base_mm, nominal_mm = _base(left, right), _base(*wanted)
    turned_deg = max(
        _angle_deg(base_mm, nominal_mm), _turn_deg(_relative(left, right) @ _relative(*wanted).T)
    )
    if turned_deg > settings.relative_deg:
        raise MeasurementError(
            f"the views are rotated against one another by {turned_deg:.0f} degrees from the nominal rig; "
            f"up to {settings.relative_deg:g} are allowed",
            handedness_hint((left.handedness, right.handedness), nominal.handedness)
            or "check the rig's nominal geometry and that the file belongs to this calibration frame",
        )
    _check_length("base", _length(base_mm), _length(nominal_mm), settings.relative)
    for found, stated in zip((left, right), wanted, strict=True):
        _check_length(f"distance of the {found.name} view", _far(found), _far(stated), settings.relative)


def handedness_hint(found: Sequence[int], stated: Sequence[int | None]) -> str | None:
    """Hint for pictures that fit no rig, where the handedness betrays mirrored halves; None where not."""
    names = ("left", "right")
    wrong = [name for name, one, built in zip(names, found, stated, strict=True) if one == -1 and built != -1]
    if len(wrong) == 2:
        return (
            "both views are seen mirrored: switch off the mirroring of camera or grabber; only an odd number "
            "of mirrors before each view explains it, state it as handedness: -1 then"
        )
    if wrong:
        return (
            f"the {wrong[0]} view is seen mirrored and the other is not: one half of the picture is "
            "mirrored, or its path has another number of mirrors than is configured"
        )
    return None


def _check_length(what: str, found_mm: float, nominal_mm: float, allowed: float) -> None:
    if abs(found_mm / nominal_mm - 1) > allowed:
        raise MeasurementError(
            f"the {what} comes out as {found_mm:.0f} mm, but the nominal rig has {nominal_mm:.0f} mm",
            "check the rig's nominal geometry, the focal length too, and that the file belongs to this "
            "calibration frame: another pitch has the same effect",
        )


def _base(left: View, right: View) -> Array:
    """(3,) from the left centre to the right one, in the left camera's coordinates."""
    return left.axes @ (right.center_mm - left.center_mm)


def _relative(left: View, right: View) -> Array:
    """(3, 3) from the left camera's coordinates into the right one's."""
    return right.axes @ left.axes.T


def _far(view: View) -> float:
    """Distance of the object's origin."""
    return _length(view.center_mm)


def _length(vector: Array) -> float:
    return float(np.linalg.norm(vector))


def _turn_deg(rotation: Array) -> float:
    return math.degrees(math.acos(max(-1.0, min(1.0, (float(np.trace(rotation)) - 1) / 2))))


def _angle_deg(first: Array, second: Array) -> float:
    cosine = float(first @ second) / (_length(first) * _length(second))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


Indices = NDArray[np.intp]

NAMES = ("left", "right")
_SAME_SCALE = 1.35
"""Ratio of seen to expected spacing that the nominal rig's ten per cent explain."""
_SAME_TURN_DEG = 20.0
_UNITS = {"cm": 10.0, "inches": 25.4, "m": 1000.0, "µm": 0.001}
WAY_OUT = "or identify some targets by hand"


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
        margin: Difference of its −2 ln(likelihood) to the winner's; infinite if there is none.
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
    """Identification of both views, left then right."""

    left: ViewIdentification
    right: ViewIdentification

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
        settings: Criteria of acceptance.

    Raises:
        MeasurementError: A view is dark or shows too few targets, no hypothesis or more than one explains it,
            or the views contradict each other or the nominal rig; the message says which, with values.
    """
    settings = settings or IdentificationSettings()
    for name, xy_px in zip(NAMES, (left_px, right_px), strict=True):
        check_count(name, len(xy_px), "blobs", settings.least_targets)
    try:
        return _found(nominal, frame, (left_px, right_px), settings)
    except AmbiguousView:
        # Another rig would only make another of its hypotheses win.
        raise
    except MeasurementError as error:
        # Tried only now, because it is another whole search.
        other_way = _with_swapped_cameras(nominal, frame, (left_px, right_px), settings)
        if other_way is not None:
            raise _swapped(other_way, nominal) from None
        if (hint := _scale_hint(nominal, frame, left_px)) is not None:
            raise MeasurementError(error.message, hint) from error
        raise


def _found(
    nominal: NominalRig, frame: ObjectModel, blobs_px: tuple[Array, Array], settings: IdentificationSettings
) -> Identification:
    left, right = (
        _identified(index, nominal, frame, xy_px, settings) for index, xy_px in enumerate(blobs_px)
    )
    check_pair(left.view, right.view, nominal, settings)
    return Identification(left, right)


def _with_swapped_cameras(
    nominal: NominalRig, frame: ObjectModel, blobs_px: tuple[Array, Array], settings: IdentificationSettings
) -> Identification | None:
    """The identification with the two cameras swapped; None if it fails, too."""
    try:
        return _found(replace(nominal, base_mm=-nominal.base_mm), frame, blobs_px, settings)
    except MeasurementError:
        return None


def _swapped(found: Identification, nominal: NominalRig) -> MeasurementError:
    """Refusal of swapped halves, or of a picture that is mirrored as a whole."""
    if found.handedness == (-1, -1) and -1 not in nominal.handedness:
        return MeasurementError(
            "the picture is mirrored as a whole: the views are swapped, and each is seen mirrored",
            "switch off the mirroring of camera or grabber; if an odd number of mirrors stands before each "
            "view, swap the columns of the views in the rig's configuration instead",
        )
    return MeasurementError(
        "the views are swapped: the left one sees the calibration frame from the right, the right one from "
        "the left",
        "swap the columns of the left and the right view in the rig's configuration",
    )


def _scale_hint(nominal: NominalRig, frame: ObjectModel, xy_px: Array) -> str | None:
    """Hint for targets that lie much closer or wider than nominal rig and file let expect; None otherwise."""
    view = nominal.views()[0]
    if len(xy_px) < 2 or len(frame) < 2:
        return None
    wanted_px = Half.of(view, nominal.lines, project(view, frame.xyz_mm)).spacing_px
    ratio = Half.of(view, nominal.lines, xy_px).spacing_px / wanted_px
    if 1 / _SAME_SCALE < ratio < _SAME_SCALE:
        return None
    unit = next((name for name, mm in _UNITS.items() if 0.8 < ratio / mm < 1.25), None)
    cause = f"is the file in {unit} instead of mm? " if unit else ""
    return (
        f"{cause}the targets lie {ratio:.2f} times as far apart in the picture as the file and the nominal "
        "rig let expect: check the unit and pitch of the calibration frame's file, focal length and distance"
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


def _identified(
    index: int, nominal: NominalRig, frame: ObjectModel, xy_px: Array, settings: IdentificationSettings
) -> ViewIdentification:
    half = Half.of(nominal.views()[index], nominal.lines, xy_px)
    rivals = contest(Explainer(half, frame.xyz_mm, settings.sigma_px), settings.least_share)
    _check_explained(half, settled(rivals).winner, frame, settings)
    return identified(half, rivals, frame, settings, settings.handedness[index])


def identified(
    half: Half,
    rivals: Sequence[Hypothesis],
    frame: ObjectModel,
    settings: IdentificationSettings,
    handedness: int | None,
) -> ViewIdentification:
    """Accept the winner of a contest of hypotheses.

    If a handedness is given, it is the only one allowed.

    Raises:
        AmbiguousView: Another hypothesis explains the view nearly as well as the winner.
        MeasurementError: The winner is clearly not of the handedness allowed.
    """
    outcome = settled(rivals)
    if handedness is not None:
        _check_handedness(half, outcome, frame, settings, handedness)
        outcome = settled(one for one in rivals if one.view.handedness == handedness)
    _check_clear(half, outcome, frame, settings)
    winner, other = outcome.winner, outcome.runner_up
    return ViewIdentification(
        view=winner.view,
        target=winner.target,
        residual_px=winner.residual_px,
        rms_px=winner.rms_px,
        runner_up_rms_px=np.nan if other is None else other.rms_px,
        runner_up_targets=0 if other is None else other.found,
        margin=outcome.margin,
        description=described(winner, half, frame),
    )


def described(hypothesis: Hypothesis, half: Half, frame: ObjectModel) -> str:
    """Describe a hypothesis for people."""
    known = np.flatnonzero(hypothesis.target >= 0)
    if not len(known):
        return "nothing explained"
    away = np.linalg.norm(half.xy_px[known] - np.median(half.xy_px, axis=0), axis=1)
    blob = known[away.argmin()]
    x, y = half.xy_px[blob]
    turned_deg, handedness = round(hypothesis.turned_deg(half.view)), hypothesis.view.handedness
    return (
        f"target {frame.target[hypothesis.target[blob]]} at ({x:.0f}, {y:.0f}) px, the calibration frame "
        f"turned by {turned_deg} degrees, handedness {handedness:+d}: "
        f"{len(known)} of {len(half.xy_px)} blobs explained to {hypothesis.rms_px:.2f} px"
    )


def _check_explained(
    half: Half, winner: Hypothesis, frame: ObjectModel, settings: IdentificationSettings
) -> None:
    name, count = half.view.name, len(half.xy_px)
    if winner.found >= settings.least_share * count:
        check_count(name, winner.found, "targets that can be identified", settings.least_targets)
    if winner.found < settings.least_share * count or winner.rms_px > settings.most_rms_px:
        explained = f"{winner.found} to {winner.rms_px:.2f} px" if winner.found else "none"
        raise MeasurementError(
            f"the {name} view does not show the calibration frame {frame.name}: of its {count} blobs the "
            f"best hypothesis explains {explained}, but "
            f"{settings.least_share:.0%} to {settings.most_rms_px:g} px are needed"
            + (f" ({described(winner, half, frame)})" if winner.found else ""),
            "check that the file belongs to this calibration frame, the rig's nominal geometry, and that "
            "nothing else reflects",
        )


def _check_handedness(
    half: Half, outcome: Outcome, frame: ObjectModel, settings: IdentificationSettings, handedness: int
) -> None:
    """Let the stated handedness decide an ambiguous picture, but never overrule a clear one."""
    if outcome.winner.view.handedness == handedness or outcome.margin < settings.margin:
        return
    raise MeasurementError(
        f"handedness {handedness:+d} is stated for the {half.view.name} view, but its picture says "
        f"{outcome.winner.view.handedness:+d}: {described(outcome.winner, half, frame)}",
        "count the mirrors of that view, an odd number makes -1; or let the handedness be found",
    )


def _check_clear(half: Half, outcome: Outcome, frame: ObjectModel, settings: IdentificationSettings) -> None:
    """Check that nothing else explains a view nearly as well."""
    if outcome.runner_up is None or outcome.margin >= settings.margin:
        return
    raise AmbiguousView(
        f"the {half.view.name} view is ambiguous: {described(outcome.winner, half, frame)}; or "
        f"{described(outcome.runner_up, half, frame)} (margin {outcome.margin:.0f}, {settings.margin:g} "
        "needed)",
        f"the part in view looks the same {_ambiguity(half, outcome, frame)}: let the whole calibration "
        f"frame be seen, use one with more depth or with a unique mark, {WAY_OUT}",
    )


def _ambiguity(half: Half, outcome: Outcome, frame: ObjectModel) -> str:
    """Name the motion that leads from the winner to the runner-up."""
    winner, other = outcome.winner, outcome.runner_up
    assert other is not None
    if winner.view.handedness != other.view.handedness:
        return "mirrored"
    turned_deg = abs((winner.turned_deg(half.view) - other.turned_deg(half.view) + 180) % 360 - 180)
    if turned_deg > _SAME_TURN_DEG:
        return f"turned by {turned_deg:.0f} degrees"
    both = (winner.target >= 0) & (other.target >= 0)
    one, another = winner.target[both], other.target[both]
    steps = [np.abs(grid[one] - grid[another]) for grid in (frame.row, frame.column)]
    rows, columns = (int(np.median(step)) if len(step) else 0 for step in steps)
    said = [f"{n} {name}{'s' if n > 1 else ''}" for n, name in ((rows, "row"), (columns, "column")) if n]
    return f"shifted by {' and '.join(said)}" if said else "in another way"
