"""Manual identification: from targets marked by a person, if the picture alone is ambiguous."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.calibration.calibration_frame import symmetries
from grabberd.core.calibration.identification.frame_identification import (
    NAMES,
    Identification,
    IdentificationSettings,
    check_count,
    halves_of,
    identified,
    rivals_of_view,
)
from grabberd.core.calibration.identification.hypothesis_growth import TURNS, Half, Poses, improved, pixels
from grabberd.core.calibration.identification.rig_hypothesis import HANDEDNESS, Explainer, Hypothesis, cost_of
from grabberd.core.geometry import NominalRig, View, project
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import InputError

ENOUGH_MARKS = 4
"""Marks of a view, of targets that are not all on one line, that determine it without any search."""
_STEPS = 15
_SUSPECTS = 6
"""Number of the worst marks among which a swapped pair is sought."""


@dataclass(frozen=True, slots=True)
class Mark:
    """Statement that the blob near (x_px, y_px), frame pixels, in a view is the target with an id."""

    view: Literal["left", "right"]
    target: int
    x_px: float
    y_px: float


def identify_by_hand(
    nominal: NominalRig,
    frame: ObjectModel,
    left_px: Array,
    right_px: Array,
    marks: Sequence[Mark],
    settings: IdentificationSettings | None = None,
) -> Identification:
    """Identify the targets of a calibration frame with the help of some that are marked by hand.

    The blob nearest to a mark gets its target. Four marks of a view determine it, and the rest are predicted
    from it. Fewer decide between the hypotheses that the picture leaves open; one may be enough.

    The other arguments are those of `identify_frame`.

    Raises:
        InputError: There is an unknown target, one marked twice, no blob near a mark, or a mark that
            contradicts the others.
        MeasurementError: As `identify_frame`.
    """
    settings = settings or IdentificationSettings()
    halves = halves_of(nominal, (left_px, right_px), settings)
    marked = [
        _given(half, frame, [mark for mark in marks if mark.view == name])
        for half, name in zip(halves, NAMES, strict=True)
    ]
    alike = symmetries(frame)
    rivals = [
        _by_marks(half, frame, given, settings)
        if len(given) >= ENOUGH_MARKS
        else rivals_of_view(nominal, frame, half, alike, settings)
        for half, given in zip(halves, marked, strict=True)
    ]
    return identified(nominal, frame, halves, rivals, settings, (marked[0], marked[1]))


def _by_marks(
    half: Half, frame: ObjectModel, given: Mapping[int, int], settings: IdentificationSettings
) -> list[Hypothesis]:
    """Hypotheses of either handedness that follow from the marks alone."""
    explainer = Explainer(half, frame.xyz_mm, settings.sigma_px, given=given)
    rivals = _explained(explainer, frame)
    winner = min(rivals, key=cost_of)
    _check_marks(explainer, winner.view, frame, settings.least_share)
    check_count(half.view.name, winner.found, "targets that can be identified", settings.least_targets)
    return rivals


def _given(half: Half, frame: ObjectModel, marks: Sequence[Mark]) -> dict[int, int]:
    """Marked targets (index) by blob."""
    given: dict[int, int] = {}
    for mark in marks:
        blob, target = _blob(half, mark), _target(frame, mark)
        if target in given.values():
            raise InputError(f"{_named(mark)} is marked twice", "remove one of the two marks")
        if blob in given:
            raise InputError(
                f"{_named(mark)} is at the blob that is marked as target {frame.target[given[blob]]}",
                "remove one of the two marks",
            )
        given[blob] = target
    return given


def _blob(half: Half, mark: Mark) -> int:
    away = np.linalg.norm(half.xy_px - (mark.x_px, mark.y_px), axis=1)
    if not away.min() <= 0.5 * half.spacing_px:
        raise InputError(
            f"no blob is near the mark of {_named(mark)}, the nearest is {away.min():.0f} px away",
            "give frame pixels: x in columns of the whole picture, y in frame lines",
        )
    return int(away.argmin())


def _target(frame: ObjectModel, mark: Mark) -> int:
    index = np.flatnonzero(frame.target == mark.target)
    if not len(index):
        raise InputError(
            f"the calibration frame {frame.name} has no target {mark.target}", "use ids from its file"
        )
    return int(index[0])


def _named(mark: Mark) -> str:
    return f"target {mark.target} at ({mark.x_px:.0f}, {mark.y_px:.0f}) in the {mark.view} view"


def _seen(half: Half, frame: ObjectModel, given: Mapping[int, int]) -> View:
    """Find the view that fits the marked targets best, with the nominal lens."""
    xy_px, xyz_mm = half.xy_px[list(given)], frame.xyz_mm[list(given.values())]
    middle = np.array([xy_px.mean(axis=0)])
    poses = Poses.anchored(half.view, TURNS, middle, np.array([xyz_mm.mean(axis=0)]))
    targets_mm = np.broadcast_to(xyz_mm, (len(poses), *xyz_mm.shape))
    weight = np.ones(targets_mm.shape[:2])
    for _ in range(_STEPS):
        poses = improved(
            half.view, poses, targets_mm, xy_px - pixels(half.view, poses.seen_mm(targets_mm)), weight
        )
    off = np.linalg.norm(xy_px - pixels(half.view, poses.seen_mm(targets_mm)), axis=2).sum(axis=1)
    return poses.view(half.view, int(np.nan_to_num(off, nan=np.inf).argmin()))


def _explained(explainer: Explainer, frame: ObjectModel) -> list[Hypothesis]:
    return [
        explainer.explain(_seen(explainer.half.handed(one), frame, explainer.given)) for one in HANDEDNESS
    ]


def _check_marks(explainer: Explainer, view: View, frame: ObjectModel, least_share: float) -> None:
    """Check that each mark lies where the winner sees its target."""
    away = _away(explainer, view)
    worst = int(away.argmax())
    if away[worst] <= 2 * explainer.gate_px:
        return
    suspects = [list(explainer.given)[index] for index in (-away).argsort()[:_SUSPECTS]]
    if pair := _swapped(explainer, frame, suspects, least_share):
        first, second = sorted(frame.target[list(pair)].tolist())
        raise InputError(
            f"the marks of targets {first} and {second} in the {view.name} view are swapped: with each in "
            "place of the other all marks agree",
            "swap these two ids, and identify again",
        )
    blob, target = list(explainer.given.items())[worst]
    x, y = explainer.half.xy_px[blob]
    raise InputError(
        f"the marks in the {view.name} view contradict each other: target {frame.target[target]} "
        f"at ({x:.0f}, {y:.0f}) lies {away[worst]:.1f} px from where the others have it",
        "mark it again, or remove it",
    )


def _away(explainer: Explainer, view: View) -> Array:
    """Distances of the marked blobs in px from where a view has their targets."""
    blobs, targets = list(explainer.given), list(explainer.given.values())
    away = np.linalg.norm(explainer.half.xy_px[blobs] - project(view, explainer.xyz_mm[targets]), axis=1)
    return np.nan_to_num(away, nan=np.inf)


def _swapped(
    explainer: Explainer, frame: ObjectModel, suspects: Sequence[int], least_share: float
) -> tuple[int, int] | None:
    """The two targets whose swap makes all marks agree; None unless there is one such pair.

    Sought among the targets of the suspected blobs.
    """
    given, pairs = explainer.given, []
    for first, second in combinations(suspects, 2):
        other_way = replace(explainer, given={**given, first: given[second], second: given[first]})
        winner = min(_explained(other_way, frame), key=cost_of)
        enough = winner.found >= least_share * len(explainer.half.xy_px)
        if enough and (_away(other_way, winner.view) <= 2 * explainer.gate_px).all():
            pairs.append((given[first], given[second]))
    return pairs[0] if len(pairs) == 1 else None
