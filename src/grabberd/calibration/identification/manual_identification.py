"""Manual identification: from targets marked by a person, if the picture alone is ambiguous."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration.identification.acceptance import IdentificationSettings, check_pair
from grabberd.calibration.identification.frame_identification import (
    NAMES,
    Identification,
    ViewIdentification,
    check_count,
    identified,
)
from grabberd.calibration.identification.hypothesis import Explainer
from grabberd.calibration.identification.hypothesis_growth import TURNS, Half
from grabberd.calibration.identification.hypothesis_ranking import HANDEDNESS, settled
from grabberd.calibration.identification.poses import Poses, improved, pixels
from grabberd.errors import InputError
from grabberd.geometry import NominalRig, View, project
from grabberd.reconstruction import ObjectModel

Array = NDArray[np.float64]

LEAST_MARKS = 4
"""Marks needed in each view, of targets that are not all on one line."""
_STEPS = 15


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
    rivals = [explainer.explain(_seen(half.handed(one), frame, given)) for one in HANDEDNESS]
    winner = settled(rivals).winner
    _check_marks(explainer, winner.view, frame)
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


def _check_marks(explainer: Explainer, view: View, frame: ObjectModel) -> None:
    """Check that each mark lies where the winner sees its target."""
    blobs, targets = list(explainer.given), list(explainer.given.values())
    predicted = project(view, explainer.xyz_mm[targets])
    away = np.linalg.norm(explainer.half.xy_px[blobs] - predicted, axis=1)
    worst = int(np.nan_to_num(away, nan=np.inf).argmax())
    if not away[worst] <= 2 * explainer.gate_px:
        x, y = explainer.half.xy_px[blobs[worst]]
        raise InputError(
            f"the marks in the {view.name} view contradict each other: target {frame.target[targets[worst]]} "
            f"at ({x:.0f}, {y:.0f}) lies {away[worst]:.1f} px from where the others have it",
            "mark it again, or remove it",
        )
