"""Marks on the cup: what moves is noticed and taken off, what stands still is left alone."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from core.chain.marked_pictures import CORNERS, VIEWS, Watched, calibration, left_px
from grabberd.core.chain import mark_watch
from grabberd.core.chain.mark_watch import MarkWatch, chi_square
from grabberd.core.geometry import Calibration
from grabberd.core.measurement.marks import KEY, MarkReference
from grabberd.core.reconstruction.drift_check import MarkState
from grabberd.errors import InputError, MeasurementError
from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import calibration_document
from grabberd_fake.optics import build_views, knocked

MOVEMENTS = {
    "both along the epipolar lines": lambda px: {view: {"turn_px": (0, px, 0)} for view in VIEWS},
    "both across": lambda px: {view: {"turn_px": (px, 0, 0)} for view in VIEWS},
    "one along": lambda px: {"right": {"turn_px": (0, px, 0)}},
    "one across": lambda px: {"left": {"turn_px": (px, 0, 0)}},
    "one rotated": lambda px: {"right": {"turn_px": (0, 0, 4 * px)}},
    "one bent by a keystone": lambda px: {"left": {"keystone": (12e-6 * px, 6e-6 * px)}},
}
SLOW = pytest.mark.slow


def noticed(corrections):
    """Number of fields until something is said."""
    return next(n for n, one in enumerate(corrections, 1) if one.corrects or MarkState.MOVING in one.states)


@pytest.mark.parametrize(
    ("count", "what", "px"),
    [
        (4, "both along the epipolar lines", 0.1),
        (4, "one rotated", 1.0),
        (4, "one bent by a keystone", 1.0),
        (2, "both across", 0.3),
        *[
            pytest.param(count, what, px, marks=SLOW)
            for count in (2, 3, 4)
            for what in MOVEMENTS
            for px in (0.1, 0.5, 2.0)
            if count == 4 or "keystone" not in what
        ],
    ],
)
def test_a_movement_is_noticed_within_a_second_and_taken_off(count, what, px):
    watched, movements = Watched(count, seed=7), MOVEMENTS[what](px)
    assert not watched.see(48)[-1].corrects
    corrections = watched.see(110, movements)
    assert noticed(corrections) <= 50
    for view, (rms_px, chi_square_of_view) in left_px(corrections[-1], movements).items():
        assert rms_px <= 0.021
        # Of a movement that is not that of a turned camera some is taken for noise while it is small.
        assert (chi_square_of_view is None) == (view not in movements)
        assert chi_square_of_view is None or chi_square_of_view < 4.0


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.slow
def test_sigma_predicts_what_is_left(count):
    kinds, found = [kind for what, kind in MOVEMENTS.items() if "keystone" not in what], []
    for seed in range(64):
        movements = kinds[seed % len(kinds)]((0.1, 0.2, 0.5, 1.0)[seed % 4])
        correction = Watched(count, seed=100 + seed).see(96, movements)[-1]
        found += [chi for _, chi in left_px(correction, movements).values() if chi is not None]
    assert 0.7 < np.mean(found) < 1.4


@pytest.mark.parametrize("count", [2, 3, 4])
def test_sigma_predicts_what_is_left_of_knocks_to_the_simulated_camera_and_mirror(count):
    cup = np.array([(60, 36, 0), (-60, -36, 0), (60, -36, 0), (-60, 36, 0)][:count], float)
    over = np.array([(x, y, 0.0) for x in np.linspace(-55, 55, 7) for y in np.linspace(-34, 34, 7)])
    found = []
    for seed, what in product(range(24), ("camera", "left")):
        rng, options = np.random.default_rng(seed), FakeOptions.read({"rig": {"seed": seed}})
        before = build_views(options)
        now = knocked(before, what, rng.normal(0, 0.7 * (0.1, 0.3, 1.0, 2.0)[seed % 4], 3))
        learnt, seen = (np.vstack([view.image(cup) for view in views]) for views in (before, now))
        reference = MarkReference.learnt((n % 2, quiet_marks(rng, learnt)) for n in range(80))
        watch = MarkWatch(Calibration.from_document(calibration_document(options)), reference)
        corrections = [watch.see(n % 2, quiet_marks(rng, seen)) for n in range(110)]
        for old, new, movement in zip(before, now, corrections[-1].movements, strict=True):
            if movement is not None:
                at = new.image(over)
                off = at - old.image(over) - movement.at(at)
                found.append(np.mean(np.square(off / movement.sigma_at(at))))
    assert len(found) > 50
    assert 0.65 < np.mean(found) < 1.4


@pytest.mark.parametrize("seeds", [range(4), pytest.param(range(4, 32), marks=SLOW)])
def test_quiet_series_are_not_corrected(seeds):
    for seed in seeds:
        watched = Watched(4 if seed % 2 else 2, seed=1000 + seed, noise=0.02 if seed % 4 < 2 else 0.04)
        assert not any(one.corrects for one in watched.see(150))


def quiet_marks(rng, places):
    """Places of marks as single fields of good pictures scatter."""
    located = rng.normal([*places.T, np.full(len(places), 28.0)], [[0.07], [0.02], [0.5]])
    return located.T.astype(np.float32)


@pytest.mark.parametrize("fields", [200, pytest.param(1000, marks=SLOW)])
def test_sixty_four_quiet_series_are_not_corrected(fields):
    places = np.array([place for view in VIEWS for place in CORNERS[view]], float)
    for seed in range(64):
        rng = np.random.default_rng(seed)
        reference = MarkReference.learnt((n % 2, quiet_marks(rng, places)) for n in range(80))
        watch = MarkWatch(calibration(), reference)
        assert not any(watch.see(n % 2, quiet_marks(rng, places)).corrects for n in range(fields))


def test_what_moves_back_is_no_longer_corrected():
    watched, movements = Watched(4, seed=3), MOVEMENTS["both across"](0.5)
    assert watched.see(60, movements)[-1].corrects
    last = watched.see(60)[-1]
    assert not last.corrects
    assert last.states == (MarkState.AT_REST, MarkState.AT_REST)


def test_it_is_waited_until_the_rig_has_come_to_rest():
    watched = Watched(4, seed=4)
    watched.see(24)
    states = {watched.see(6, MOVEMENTS["both across"](px))[-1].states[0] for px in (0.5, -0.9, 0.4, -1.0)}
    assert states == {MarkState.MOVING}
    movements = MOVEMENTS["both across"](0.3)
    assert max(rms for rms, _ in left_px(watched.see(48, movements)[-1], movements).values()) < 0.03


def test_hidden_marks_leave_the_correction_in_force_and_say_so():
    watched, movements = Watched(2, seed=5), MOVEMENTS["both across"](0.5)
    watched.see(48, movements)
    last = watched.see(24, movements, hide=(0,))[-1]
    assert last.states == (MarkState.HIDDEN, MarkState.CORRECTED)
    assert last.movements[0] is not None


@pytest.mark.parametrize("hide", [(0, 1, 2, 3), (0, 1, 2)])
def test_marks_that_come_back_moved_after_seconds_are_followed(hide):
    watched, movements = Watched(2, seed=3), MOVEMENTS["both across"](0.5)
    watched.see(12)
    hidden = watched.see(96, hide=hide)[-1]
    assert hidden.states[0] is MarkState.HIDDEN
    last = watched.see(48, movements)[-1]
    assert last.states == (MarkState.CORRECTED, MarkState.CORRECTED)
    assert max(rms for rms, _ in left_px(last, movements).values()) < 0.03


def test_a_single_mark_decides_nothing():
    last = Watched(1, seed=5).see(48, MOVEMENTS["both across"](1.0))[-1]
    assert last.states == (MarkState.UNKNOWN, MarkState.UNKNOWN)


@pytest.mark.parametrize("px", [0.0, 0.7])
def test_of_four_marks_one_that_comes_off_is_left_out_in_a_movement_too(px):
    movements = MOVEMENTS["one across"](px) if px else {}
    last = Watched(4, seed=6).see(60, movements, off={2: (1.0, 0.0)})[-1]
    assert (last.marks, last.states[0]) == ((3, 4), MarkState.CORRECTED if px else MarkState.AT_REST)
    assert left_px(last, movements)["left"][0] < 0.02


@pytest.mark.parametrize("px", [0.0, 0.7])
def test_a_mark_that_was_left_out_is_used_again_once_it_agrees(px):
    watched, movements = Watched(4, seed=6), MOVEMENTS["one across"](px) if px else {}
    assert watched.see(60, movements, off={2: (1.0, 0.0)})[-1].marks == (3, 4)
    assert watched.see(60, movements, off={2: (1.0, 0.0)})[-1].marks == (3, 4)
    last = watched.see(102, movements)[-1]
    assert last.marks == (4, 4)
    assert left_px(last, movements)["left"][0] < 0.02


@pytest.mark.parametrize("off", [(0.3, 0.0), (0.0, -0.3)])
@pytest.mark.parametrize("px", [0.0, 0.1, 0.5])
def test_three_marks_of_which_one_comes_off_correct_nothing(px, off):
    last = Watched(3, seed=6).see(60, MOVEMENTS["both across"](px), off={1: off})[-1]
    assert (last.movements[0], last.states[0]) == (None, MarkState.CONTRADICTORY)


def test_two_marks_whose_distance_changes_correct_nothing():
    last = Watched(2, seed=6).see(60, MOVEMENTS["both across"](0.5), off={1: (0.3, 0.4)})[-1]
    assert (last.movements[0], last.states[0]) == (None, MarkState.CONTRADICTORY)


def test_of_two_marks_one_that_moves_alone_corrects_nothing():
    # At right angles to the line that joins them, so that their distance stays.
    last = Watched(2, seed=6).see(60, off={1: (-0.43, 0.26)})[-1]
    assert (last.movements[0], last.states[0]) == (None, MarkState.CONTRADICTORY)


def test_a_mark_whose_area_has_shrunk_is_not_used():
    rng = np.random.default_rng(3)
    places = np.array([place for view in VIEWS for place in CORNERS[view]], float)
    reference = MarkReference.learnt((n % 2, quiet_marks(rng, places)) for n in range(80))
    watch = MarkWatch(calibration(), reference)
    for n in range(60):
        marks = quiet_marks(rng, places)
        marks[3] += np.array([0.2, 0.0, -0.1 * 28], np.float32)
        last = watch.see(n % 2, marks)
    assert (last.corrects, last.marks) == (False, (3, 4))


def test_a_correction_is_the_same_object_until_it_changes():
    watched = Watched(2, seed=8)
    assert len({id(one) for one in watched.see(96)}) == 2
    assert watched.watch.correction.applied_to(watched.calibration) is watched.calibration


def test_marks_of_another_number_or_far_away_are_not_seen():
    reference = MarkReference.of(Watched(2, seed=1).calibration)
    located = np.column_stack([reference.place_px[0], reference.area_px2]).astype(np.float32)
    assert np.isfinite(reference.change(0, located)).all()
    assert np.isnan(reference.change(0, located[:3])).all()
    assert np.isnan(reference.change(0, None)).all()
    assert np.isnan(reference.change(0, located + np.float32(20))).all()
    covered = located * np.array([1, 1, 0.7], np.float32)
    assert np.isnan(reference.change(0, covered)).all()


def test_a_mark_that_is_seldom_seen_cannot_be_learnt():
    nothing = np.full((2, 3), np.nan, np.float32)
    with pytest.raises(MeasurementError, match="mark 1 was seen in 0 fields"):
        MarkReference.learnt((n % 2, nothing) for n in range(50))
    assert MarkReference.learnt([]) is None


def test_a_disc_that_is_named_twice_cannot_be_learnt():
    rng, places = np.random.default_rng(2), np.array([(30.0, 40.0), (330.0, 536.0), (30.0, 40.0)])
    with pytest.raises(MeasurementError, match="marks 1 and 3 are the same disc"):
        MarkReference.learnt((n % 2, quiet_marks(rng, places)) for n in range(50))


def test_marks_of_a_progressive_camera_have_one_place():
    marks = np.array([[30, 40, 28.0]], np.float32)
    reference = MarkReference.learnt((2, marks) for _ in range(20))
    assert reference.fields.tolist() == [20]
    assert np.array_equal(reference.place_px[0], reference.place_px[1])


def test_what_a_calibration_keeps_of_marks_is_read_back_or_refused():
    known = Watched(2, seed=1).calibration
    assert MarkReference.of(known).to_document() == known.details[KEY]
    for wrong in ("none", [{"x_px": [1, 2]}], [{**known.details[KEY][0], "area_px2": -1}]):
        broken = replace(known, details={KEY: wrong})
        with pytest.raises(InputError, match="marks"):
            MarkReference.of(broken)


def test_the_quantiles_are_those_of_chi_square():
    assert chi_square(8, 0.0) == pytest.approx(7.344, abs=0.01)
    assert chi_square(4, 3.0902) == pytest.approx(18.47, rel=0.02)
    assert mark_watch.CLEARLY > 5
