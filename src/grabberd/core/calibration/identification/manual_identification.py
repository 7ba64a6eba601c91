"""Manual identification: from targets marked by a person, if the picture alone is ambiguous."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration.identification.frame_identification import (
    NAMES,
    Identification,
    IdentificationSettings,
    ViewIdentification,
    check_count,
    check_pair,
    identified,
)
from grabberd.core.calibration.identification.hypothesis import HANDEDNESS, Explainer, Hypothesis, settled
from grabberd.core.calibration.identification.hypothesis_growth import TURNS, Half, Poses, improved, pixels
from grabberd.core.geometry import NominalRig, View, project
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import InputError

Array = NDArray[np.float64]

LEAST_MARKS = 4
"""Marks needed in each view, of targets that are not all on one line."""
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
    """Identify the targets of a calibration frame from some that are marked by hand.

    The blob nearest to a mark gets its target; the rest are predicted from the view that the marks determine.

    At least four marks are needed in each view; the other arguments are those of `identify_frame`.

    Raises:
        InputError: There are too few marks, an unknown target, one marked twice, no blob near a mark, or a
            mark that contradicts the others.
        MeasurementError: As `identify_frame`.
    """
    settings = settings or IdentificationSettings()
    sides = [
        _by_marks(index, nominal, frame, xy_px, marks, settings)
        for index, xy_px in enumerate((left_px, right_px))
    ]
    check_pair(sides[0].view, sides[1].view, nominal, settings)
    return Identification(*sides)


def _by_marks(
    index: int,
    nominal: NominalRig,
    frame: ObjectModel,
    xy_px: Array,
    marks: Sequence[Mark],
    settings: IdentificationSettings,
) -> ViewIdentification:
    check_count(NAMES[index], len(xy_px), "blobs", settings.least_targets)
    half = Half.of(nominal.views()[index], nominal.lines, xy_px)
    given = _given(half, frame, [mark for mark in marks if mark.view == NAMES[index]])
    explainer = Explainer(half, frame.xyz_mm, settings.sigma_px, given)
    rivals = _explained(explainer, frame)
    winner = settled(rivals).winner
    _check_marks(explainer, winner.view, frame, settings.least_share)
    check_count(NAMES[index], winner.found, "targets that can be identified", settings.least_targets)
    return identified(half, rivals, frame, settings, settings.handedness[index])


def _given(half: Half, frame: ObjectModel, marks: Sequence[Mark]) -> dict[int, int]:
    """Marked targets (index) by blob."""
    if len(marks) < LEAST_MARKS:
        raise InputError(
            f"{len(marks)} targets are marked in the {half.view.name} view, {LEAST_MARKS} are needed",
            "mark more of them, far apart and not all in one row",
        )
    given: dict[int, int] = {}
    for mark in marks:
        blob, target = _blob(half, mark), _target(frame, mark)
        if blob in given or target in given.values():
            raise InputError(f"{_named(mark)} is marked twice", "remove one of the two marks")
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
        winner = settled(_explained(other_way, frame)).winner
        enough = winner.found >= least_share * len(explainer.half.xy_px)
        if enough and (_away(other_way, winner.view) <= 2 * explainer.gate_px).all():
            pairs.append((given[first], given[second]))
    return pairs[0] if len(pairs) == 1 else None
