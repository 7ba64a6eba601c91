"""Decision between the hypotheses of a rig: by the picture, and where it leaves several, by a person's word.

What the picture shows is never taken for what the configuration says: swapped halves and mirrored views are
refused under their own name, and a calibration frame that looks the same in several ways is asked for.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.calibration.calibration_frame import targets_to_add
from grabberd.core.calibration.identification.rig_hypothesis import Arrangement, RigHypothesis, rivals_of
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AmbiguousView, AskedTarget, MeasurementError, MirroredPicture

_MOST_TOLD = 4
"""Ways to see a frame that a message has."""
_WHOLE = 0.9
"""Share of the targets from which a view shows the whole calibration frame."""
_UNMIRROR = "switch off the mirroring of camera or grabber"
_LEFT_HANDED = (
    "first make sure of the calibration frame's file: where X points down on the frame, Y points to the "
    "right, and a file with x and y exchanged, or one of them with the wrong sign, has the mirror image"
)


class Stated(NamedTuple):
    """Knowledge beside the picture.

    Attributes:
        handedness: Of the left and the right view, by their mirrors; None where it is not known.
        turn_deg: Turn of the calibration frame in the picture; None if nobody has looked.
        marked: Targets (index) of some blobs of either view.
        margin: Least difference of −2 ln(likelihood) that decides.
    """

    handedness: tuple[int | None, int | None]
    turn_deg: float | None
    marked: tuple[Mapping[int, int], Mapping[int, int]]
    margin: float

    @property
    def shows_mirrored(self) -> bool:
        """True if the mirrors of the left view's path show the calibration frame mirrored."""
        return self.handedness[0] == -1

    def is_answer(self, one: RigHypothesis, frame: ObjectModel) -> bool:
        """True if a hypothesis agrees with what a person has seen."""
        if not self.agrees_with_marks(one):
            return False
        if self.turn_deg is None:
            return True
        seen = one.orientation(frame)
        return seen.is_turned_like(self.turn_deg) and seen.is_mirrored == self.shows_mirrored

    def agrees_with_marks(self, one: RigHypothesis) -> bool:
        """True if it names every marked blob as it is marked."""
        return all(
            side.target[blob] == target
            for side, known in zip(one, self.marked, strict=True)
            for blob, target in known.items()
        )


class Decision(NamedTuple):
    """Decision between the hypotheses of a picture.

    Attributes:
        winner: The hypothesis that does.
        others: Those that contradict it, but not what is known, the best first.
        by_statement: True if the picture left several, and what a person has stated decided.
    """

    winner: RigHypothesis
    others: list[RigHypothesis]
    by_statement: bool


def decided(found: Sequence[RigHypothesis], frame: ObjectModel, left_px: Array, stated: Stated) -> Decision:
    """Decide between hypotheses, the best first.

    Args:
        found: The hypotheses.
        frame: The calibration frame.
        left_px: (B, 2) blobs of the left view.
        stated: What is known beside the picture.

    Raises:
        AmbiguousView: Several explain the picture, and what is known does not decide.
        MeasurementError: The picture contradicts what is known.
    """
    close = [found[0], *rivals_of(found[0], found, stated.margin)]
    answers = [one for one in close if stated.is_answer(one, frame)]
    if len(answers) > 1:
        raise _ambiguous(answers, frame, left_px, stated)
    right = (one for one in close if _contradiction(one, stated) is None)
    winner = answers[0] if answers else next(right, close[0])
    if (problem := _contradiction(winner, stated)) is not None:
        by_marks = any(stated.marked) and len(close) > 1
        raise (
            MirroredPicture(problem.message, f"if the marks are right: {problem.hint}")
            if by_marks
            else problem
        )
    if not answers:
        raise _unlike_stated(close, frame, left_px, stated)
    others = [one for one in found if one.is_rival_of(winner) and stated.is_answer(one, frame)]
    return Decision(winner, others, by_statement=len(close) > 1)


def _contradiction(winner: RigHypothesis, stated: Stated) -> MirroredPicture | None:
    """Refusal of a picture whose halves are swapped or mirrored; None if they are not."""
    mirrored = _mirrored(winner.handedness, stated.handedness)
    if winner.arrangement is Arrangement.SWAPPED:
        return _swapped(mirrored)
    contradicted = [
        one is not None and one != found
        for one, found in zip(stated.handedness, winner.handedness, strict=True)
    ]
    if not any(contradicted):
        return None
    names = " and ".join(mirrored)
    return MirroredPicture(
        f"the picture shows the {names} view{'s' if len(mirrored) > 1 else ''} mirrored: of handedness "
        f"{_signs(winner.handedness)} (left, right), where {_signs(stated.handedness)} is stated",
        mirrored_hint(winner.handedness, stated.handedness) or _UNMIRROR,
    )


def _signs(handedness: Sequence[int | None]) -> str:
    return ", ".join("unknown" if one is None else f"{one:+d}" for one in handedness)


def _mirrored(found: Sequence[int], stated: Sequence[int | None]) -> list[str]:
    """Names of the views that are seen mirrored."""
    return [
        name
        for name, one, built in zip(("left", "right"), found, stated, strict=True)
        if one != (1 if built is None else built)
    ]


def mirrored_hint(found: Sequence[int], stated: Sequence[int | None]) -> str | None:
    """Say what mirrors a picture, by the handedness of its views; None if nothing does."""
    mirrored = _mirrored(found, stated)
    if len(mirrored) == 2:
        return (
            f"both views are seen mirrored, each in its place: {_LEFT_HANDED}; then {_UNMIRROR}, or, if an "
            "odd number of mirrors stands before each view, state handedness: -1"
        )
    if mirrored:
        return (
            f"the {mirrored[0]} view is seen mirrored and the other is not: one half of the picture is "
            "mirrored, or its path has another number of mirrors than is configured"
        )
    return None


def _swapped(mirrored: Sequence[str]) -> MirroredPicture:
    if len(mirrored) == 2:
        return MirroredPicture(
            "the picture is mirrored as a whole, left to right or upside down: the views are swapped, and "
            "each is seen mirrored",
            f"{_LEFT_HANDED}; then {_UNMIRROR}, or, if an odd number of mirrors stands before each view, "
            "swap the columns of the views in the rig's configuration",
        )
    also = f", and the {mirrored[0]} one is seen mirrored" if mirrored else ""
    return MirroredPicture(
        "the views are swapped: the left one sees the calibration frame from the right, the right one from "
        f"the left{also}",
        "swap the columns of the left and the right view in the rig's configuration",
    )


def _unlike_stated(
    close: Sequence[RigHypothesis], frame: ObjectModel, left_px: Array, stated: Stated
) -> MeasurementError:
    """Refusal of what a person has seen, where the picture shows it otherwise."""
    marked = [one for one in close if stated.agrees_with_marks(one)]
    ways = sorted(marked or close, key=lambda one: _unlikeliness(one, frame))
    shown = "; or ".join(
        f"{_stance(one, frame)} with {one.corners(frame, left_px)}" for one in ways[:_MOST_TOLD]
    )
    if not marked:
        return MeasurementError(
            f"the marks contradict the picture, which shows calibration frame {frame.name} {shown}",
            "mark the targets again, by their ids in the calibration frame's file",
        )
    return MeasurementError(
        f"a turn by {stated.turn_deg:g} degrees is stated, but the picture shows calibration frame "
        f"{frame.name} {shown}",
        "look at the picture again, and state how the frame stands there, or nothing if nobody asks",
    )


def _ambiguous(
    answers: Sequence[RigHypothesis], frame: ObjectModel, left_px: Array, stated: Stated
) -> AmbiguousView:
    answers = sorted(answers, key=lambda one: _unlikeliness(one, frame))
    ways = " or ".join(dict.fromkeys(_stance(one, frame) for one in answers))
    right = [one for one in answers if one.orientation(frame).is_mirrored == stated.shows_mirrored]
    turns = {one.orientation(frame).quarter_deg: str(one.corners(frame, left_px)) for one in right}
    found = [side.found for side in answers[0]]
    subject, first = "the picture", ""
    if min(found) < _WHOLE * len(frame):
        subject = f"the views show {found[0]} and {found[1]} of {len(frame)} targets, and the part in view"
        first = "let both views show the whole calibration frame; or "
    if len(turns) < len(right):
        hint = "use a calibration frame with more depth: the part in view looks the same shifted"
        turns = {}
    elif turns:
        hint = turns_hint(turns, "a turn of {} degrees")
    else:
        hint = f"the picture is mirrored: {_UNMIRROR}, or count the mirrors and state the rig's handedness"
    return AmbiguousView(
        f"{subject} does not tell how calibration frame {frame.name} stands: {ways}",
        first + hint,
        _asked(answers, frame, left_px),
        tuple(tuple(place.tolist()) for place in targets_to_add(frame, stated.margin)),
        turns,
    )


def turns_hint(turns: Mapping[int, str], answer: str) -> str:
    """Say which answer belongs to what the picture shows.

    Args:
        turns: What it shows, by the frame's turn in degrees.
        answer: How a turn is stated, with {} for the degrees.
    """
    seen = ", ".join(f"{answer.format(deg)} if it shows {corners}" for deg, corners in turns.items())
    return (
        f"look at the left half of the picture, and state {seen}; if it shows none of these, it is mirrored: "
        f"{_UNMIRROR}"
    )


def _unlikeliness(one: RigHypothesis, frame: ObjectModel) -> tuple[bool, bool, int]:
    """Order in which ways to see a frame are told: those of a picture as it should be come first."""
    seen = one.orientation(frame)
    return one.arrangement is Arrangement.SWAPPED, seen.is_mirrored, seen.quarter_deg


def _stance(one: RigHypothesis, frame: ObjectModel) -> str:
    """Say how a hypothesis sees the calibration frame."""
    seen = one.orientation(frame)
    return f"{'mirrored and ' if seen.is_mirrored else ''}turned by {seen.quarter_deg} degrees"


def _asked(answers: Sequence[RigHypothesis], frame: ObjectModel, left_px: Array) -> tuple[AskedTarget, ...]:
    """The targets, as few as possible, whose places in the left view tell the answers apart."""
    blobs = np.array([_blob_of(one, len(frame)) for one in answers])
    asked: list[AskedTarget] = []
    groups = [np.arange(len(answers))]
    while any(len(group) > 1 for group in groups):
        told = [sum(len(np.unique(blobs[group, one])) for group in groups) for one in range(len(frame))]
        best = int(np.argmax(told))
        parts = [
            group[blobs[group, best] == blob] for group in groups for blob in np.unique(blobs[group, best])
        ]
        if len(parts) == len(groups):
            break
        seen = np.unique(blobs[:, best])
        places = tuple((x, y) for x, y in left_px[seen[seen >= 0]].tolist())
        asked.append(AskedTarget(int(frame.target[best]), places))
        groups = parts
    return tuple(asked)


def _blob_of(one: RigHypothesis, targets: int) -> Indices:
    """(T,) index of the left view's blob that is each target; −1 for none."""
    blob = np.full(targets, -1, np.intp)
    known = np.flatnonzero(one.left.target >= 0)
    blob[one.left.target[known]] = known
    return blob
