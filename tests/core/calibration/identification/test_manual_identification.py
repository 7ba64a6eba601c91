"""Which blob is which target, where a person says some of them."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.sights import FRAME, NOMINAL, placed, see
from grabberd.core.calibration.identification.manual_identification import Mark, identify_by_hand
from grabberd.errors import AmbiguousView, InputError, MeasurementError, MirroredPicture

FLAT = replace(FRAME, xyz_mm=FRAME.xyz_mm * (1.0, 1.0, 0.0))


def scene(seed, frame=FRAME, handedness=(1, 1)):
    rng = np.random.default_rng(seed)
    return [see(rng, view, frame) for view in placed(rng, handedness)]


def marks_of(sights, count=6, off_px=3.0):
    """Marks beside targets all over either view."""
    marks = []
    for name, sight in zip(("left", "right"), sights, strict=True):
        real = np.flatnonzero(sight.target >= 0)
        for blob in real[np.linspace(0, len(real) - 1, count).astype(int)]:
            x, y = sight.xy_px[blob]
            marks.append(Mark(name, int(FRAME.target[sight.target[blob]]), x + off_px, y - off_px))
    return marks


def identify(sights, marks, frame=FRAME):
    return identify_by_hand(NOMINAL, frame, sights[0].xy_px, sights[1].xy_px, marks)


@pytest.mark.parametrize("handedness", [(1, 1), (-1, -1), (1, -1)])
def test_the_others_follow_from_a_few_marks(handedness):
    sights = scene(1, handedness=handedness)
    found = identify(sights, marks_of(sights))
    assert found.handedness == handedness
    for side, sight in zip((found.left, found.right), sights, strict=True):
        real = sight.target >= 0
        assert ((side.target == sight.target) | (side.target < 0))[real].all()
        assert (side.target[real] < 0).sum() <= 2


def test_marks_identify_a_planar_frame_of_which_the_ends_are_not_seen():
    sights = [sight.within(150, 420) for sight in scene(2, FLAT)]
    found = identify(sights, marks_of(sights), FLAT)
    for side, sight in zip((found.left, found.right), sights, strict=True):
        real = (sight.target >= 0) & (side.target >= 0)
        np.testing.assert_array_equal(side.target[real], sight.target[real])


def test_a_wrong_mark_is_named():
    sights = scene(3)
    marks = marks_of(sights, 8)
    used = {mark.target for mark in marks}
    marks[2] = replace(
        marks[2], target=next(t for t in (marks[2].target + 1, marks[2].target - 1) if t not in used)
    )
    with pytest.raises(InputError, match="the marks in the left view contradict each other: target"):
        identify(sights, marks)


@pytest.mark.parametrize("pair", [(0, 1), (2, 7)])
def test_two_marks_with_each_others_id_are_named_as_a_pair(pair):
    sights = scene(3)
    marks = marks_of(sights, 8)
    one, other = (marks[index] for index in pair)
    marks[pair[0]], marks[pair[1]] = replace(one, target=other.target), replace(other, target=one.target)
    low, high = sorted((one.target, other.target))
    with pytest.raises(InputError, match=f"marks of targets {low} and {high} in the left view are swapped"):
        identify(sights, marks)


def test_fewer_marks_than_determine_a_view_decide_between_what_the_picture_leaves_open():
    """A flat grid looks the same turned by half and mirrored; one corner tells."""
    sights = scene(4, FLAT)
    with pytest.raises(AmbiguousView) as raised:
        identify(sights, [], FLAT)
    (asked,) = raised.value.asks
    blob = np.flatnonzero(FRAME.target[sights[0].target] == asked.id)[0]
    assert tuple(sights[0].xy_px[blob]) in asked.places_px
    found = identify(sights, [Mark("left", asked.id, *sights[0].xy_px[blob])], FLAT)
    for side, sight in zip(found, sights, strict=True):
        real = (sight.target >= 0) & (side.target >= 0)
        np.testing.assert_array_equal(side.target[real], sight.target[real])


def test_a_mark_far_from_any_blob_is_refused():
    sights = scene(5)
    with pytest.raises(
        InputError, match=r"no blob is near the mark of target 1 at \(5, 5\) in the left view"
    ):
        identify(sights, [*marks_of(sights), Mark("left", 1, 5.0, 5.0)])


def test_an_unknown_target_and_one_marked_twice_are_refused():
    sights = scene(6)
    marks = marks_of(sights)
    with pytest.raises(InputError, match="has no target 999"):
        identify(sights, [*marks, replace(marks[0], target=999)])
    with pytest.raises(InputError, match="is marked twice"):
        identify(sights, [*marks, marks[0]])
    with pytest.raises(InputError, match=rf"is at the blob that is marked as target {marks[0].target}"):
        identify(sights, [marks[0], replace(marks[0], target=marks[1].target)])


def test_a_mark_that_makes_the_picture_a_mirrored_one_may_be_wrong_itself():
    sights = scene(4, FLAT)
    with pytest.raises(AmbiguousView) as raised:
        identify(sights, [], FLAT)
    (asked,) = raised.value.asks
    refused = []
    for place in asked.places_px:
        try:
            identify(sights, [Mark("left", asked.id, *place)], FLAT)
        except MirroredPicture as error:
            refused.append(error.hint)
    assert len(refused) == 2
    assert all(hint.startswith("if the marks are right: ") for hint in refused)


def test_a_dark_view_is_named():
    sights = scene(7)
    with pytest.raises(MeasurementError, match="the right view is dark"):
        identify([sights[0], sights[1].first(0)], marks_of(sights))
