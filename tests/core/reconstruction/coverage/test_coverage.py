"""A run says which targets it found, in how many fields, why not in the others, and whether that is well."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.liners import COLUMNS, model, see, wall
from grabberd.core.geometry import Rig, project
from grabberd.core.reconstruction import CoverageTally, ImageNoise, Tracker
from grabberd.core.reconstruction.coverage import (
    CoverageVerdict,
    FindingCode,
    coverage_document,
    finding_in_words,
    judge,
)
from grabberd.core.reconstruction.coverage_tally import TrackedField
from grabberd.core.reconstruction.points import Miss

MODEL = model()
FIELDS = 60
MIDDLE = 8 * COLUMNS + 2
"""Index of a target that both views see whole at any time."""


def deflection_mm(n):
    return 1.5 * (1.0 - np.cos(2.0 * np.pi * n / 50.0))


def scenes(count=FIELDS, seed=0):
    rng = np.random.default_rng(seed)
    for n in range(count):
        seen = see(*wall(deflection_mm(n)), rng, noise=0.5, missing=0.0, false=0.0)
        yield (seen.left, seen.right), (seen.left_is, seen.right_is)


def untouched(n, blobs, whose):
    return blobs


def covered(fields=FIELDS, change=untouched, calibrated=None, object_model=MODEL, lines=576):
    """Coverage of the liner's fields, whose blobs are changed on the way."""
    known = calibrated or calibration()
    rig = Rig.of(known)
    tracker = Tracker(rig, object_model, ImageNoise.of(rig, object_model, 0.12, 2))
    tally, track = CoverageTally(replace(known, lines=lines), object_model), tracker.start()
    for n, (blobs, whose) in enumerate(scenes(fields)):
        shown = change(n, blobs, whose)
        track, points = tracker.step(track, *shown, np.inf if n == 0 else 0.02)
        tally.add(n, TrackedField(track, points, shown), tracker.correspondence)
    return tally.result()


def without(target, *views):
    """Takes a target's blob away from views, in the fields that `at` chooses."""

    def change(n, blobs, whose, at=lambda n: n % 2 == 1):
        hidden = [view.select(own != target) for view, own in zip(blobs, whose, strict=True)]
        return tuple(hidden[k] if at(n) and k in views else blobs[k] for k in (0, 1))

    return change


def codes(findings):
    return [one.code for one in findings]


@pytest.fixture(scope="module")
def whole():
    return covered()


def test_where_all_are_found_it_is_measured_well(whole):
    findings = judge(whole)
    assert findings[0].verdict is CoverageVerdict.WELL
    assert codes(findings) == [FindingCode.ALL_FOUND]
    assert whole.share > 0.99
    assert whole.residual_sigma < 1.3


def test_every_field_says_how_many_were_expected_and_found(whole):
    assert whole.n.tolist() == list(range(FIELDS))
    assert (whole.field_found <= whole.field_expected).all()
    assert whole.field_found.sum() == whole.found.sum()
    assert whole.field_expected.sum() == whole.expected.sum()
    assert np.isfinite(whole.field_residual_px).all()


def test_expected_and_misses_add_up_for_every_target(whole):
    assert (whole.misses.sum(axis=1) == whole.expected).all()
    assert whole.expected[MIDDLE] == whole.found[MIDDLE] == FIELDS


@pytest.mark.parametrize(
    ("views", "reason"), [((0,), Miss.NO_BLOB_LEFT), ((1,), Miss.NO_BLOB_RIGHT), ((0, 1), Miss.NO_BLOB)]
)
def test_a_target_covered_half_of_the_time_is_a_gap_with_its_view(views, reason):
    coverage = covered(change=without(MIDDLE, *views))
    assert (coverage.expected[MIDDLE], coverage.found[MIDDLE]) == (FIELDS, FIELDS // 2)
    assert coverage.misses[MIDDLE, reason] == FIELDS // 2
    findings = judge(coverage)
    assert findings[0].verdict is CoverageVerdict.GAPS
    (finding,) = findings
    assert (finding.code, finding.miss) == (FindingCode.TARGETS_MISSED, reason)
    assert finding.values["target"] == MODEL.target[MIDDLE]
    assert finding.values["share"] == 0.5


@pytest.mark.parametrize(("dark", "reason"), [(0, Miss.NO_BLOB_LEFT), (1, Miss.NO_BLOB_RIGHT)])
def test_with_one_view_dark_nothing_is_measured_and_the_view_is_named(dark, reason):
    def change(n, blobs, whose):
        return tuple(view.select(np.zeros(0, np.intp)) if k == dark else view for k, view in enumerate(blobs))

    coverage = covered(20, change)
    (finding,) = judge(coverage)
    assert (finding.verdict, finding.code) == (CoverageVerdict.NOT, FindingCode.FEW_FOUND)
    assert (finding.miss, finding.values["share"]) == (reason, 0.0)


def test_with_nothing_in_view_nothing_is_measured():
    coverage = covered(20, lambda n, blobs, whose: tuple(one.select(np.zeros(0, np.intp)) for one in blobs))
    (finding,) = judge(coverage)
    assert (finding.verdict, finding.miss) == (CoverageVerdict.NOT, Miss.NO_BLOB)
    assert np.isnan(coverage.residual_px)


def moved_px(y_px):
    known = calibration()
    return replace(known, right=replace(known.right, y0_px=known.right.y0_px + y_px))


def test_by_a_wrong_calibration_nothing_is_measured_because_the_rays_do_not_meet():
    findings = judge(covered(20, calibrated=moved_px(4.0)))
    assert findings[0].verdict is CoverageVerdict.NOT
    assert findings[0].miss is Miss.RAYS_APART
    assert FindingCode.RAYS_DO_NOT_MEET in codes(findings)


def test_points_by_a_calibration_that_does_not_quite_fit_are_not_measured_well():
    coverage = covered(calibrated=moved_px(0.5))
    assert coverage.found.any()
    findings = judge(coverage)
    assert findings[0].verdict is not CoverageVerdict.WELL
    assert FindingCode.RAYS_DO_NOT_MEET in codes(findings)


def displaced(by_mm):
    xyz_mm = MODEL.xyz_mm.copy()
    xyz_mm[MIDDLE] += by_mm
    return replace(MODEL, xyz_mm=xyz_mm)


@pytest.mark.parametrize("by_mm", [(1.5, 0.0, 0.0), (0.0, 1.6, 0.0)])
def test_a_target_off_its_place_in_the_object_file_is_told_with_its_distance(by_mm):
    coverage = covered(object_model=displaced(by_mm))
    assert coverage.chief_miss[MIDDLE] == Miss.OFF_PLACE
    assert coverage.displaced[MIDDLE]
    np.testing.assert_allclose(coverage.offset_mm[MIDDLE], -np.array(by_mm), atol=0.15)
    (finding,) = judge(coverage)
    words = finding_in_words(finding.code, finding.values, finding.miss.key)
    assert f"target {MODEL.target[MIDDLE]} " in words
    assert f"it is {np.linalg.norm(by_mm):.1f} mm from its place in the object file" in words


def test_the_offset_of_a_target_that_is_found_is_known_too():
    coverage = covered(object_model=displaced((0.39, 0.0, 0.0)))
    np.testing.assert_allclose(coverage.offset_mm[MIDDLE], (-0.39, 0.0, 0.0), atol=0.1)
    assert coverage.offset_sigma_mm[MIDDLE] < 0.1
    assert coverage.looks[MIDDLE] >= 5


def test_targets_that_the_edge_of_the_picture_cuts_off_are_told_from_covered_ones():
    lowest = int(project(calibration().left, MODEL.xyz_mm)[:, 1].argmax())
    lines = int(project(calibration().left, MODEL.xyz_mm)[lowest, 1]) + 2
    hide = without(lowest, 0, 1)
    coverage = covered(30, lambda *given: hide(*given, at=lambda n: n > 0), lines=lines)
    assert coverage.misses[lowest, Miss.CUT_OFF] >= 0.8 * coverage.expected[lowest] > 0


def test_what_turns_away_from_a_view_is_not_expected():
    turned = see(*wall(6.0), np.random.default_rng(0), missing=0.0, false=0.0)
    assert len(turned.visible) < len(MODEL)
    rig = Rig.of(calibration())
    tracker = Tracker(rig, MODEL, ImageNoise.of(rig, MODEL, 0.12, 2))
    tally, track = CoverageTally(calibration(), MODEL), tracker.start()
    rng = np.random.default_rng(1)
    for n in range(30):
        seen = see(*wall(min(6.0, 0.4 * n)), rng, noise=0.5, missing=0.0, false=0.0)
        blobs = seen.left, seen.right
        track, points = tracker.step(track, *blobs, np.inf if n == 0 else 0.02)
        tally.add(n, TrackedField(track, points, blobs), tracker.correspondence)
    assert tally.result().share > 0.99


def test_every_field_of_a_target_is_expected_or_has_a_reason_why_not(whole):
    assert (whole.expected + whole.unexpected.sum(axis=1) == FIELDS).all()
    assert not whole.unexpected[:, [Miss.FOUND, Miss.NO_BLOB, Miss.OUTSIDE]].any()
    assert whole.unexpected[:, Miss.TURNED_AWAY].reshape(-1, COLUMNS)[:, [0, -1]].any()


def test_an_object_beside_a_view_is_not_expected_because_it_is_outside():
    aside = replace(MODEL, xyz_mm=MODEL.xyz_mm + np.array([0.0, 60.0, 0.0]))
    dark = tuple(blobs.select(np.zeros(len(blobs), bool)) for blobs in next(scenes(1))[0])
    unexpected = covered(5, lambda n, blobs, whose: dark, object_model=aside).unexpected
    assert unexpected[MIDDLE].argmax() == Miss.OUTSIDE


def test_a_capture_without_fields_is_not_measured():
    coverage = covered(0)
    findings = judge(coverage)
    assert (findings[0].verdict, codes(findings)) == (CoverageVerdict.NOT, [FindingCode.NO_FIELDS])
    document = coverage_document(coverage)
    assert (document["share"], document["residual_px"], document["fields"]) == (None, None, 0)


@pytest.mark.parametrize(
    ("missing", "verdict"), [(1, CoverageVerdict.WELL), (6, CoverageVerdict.GAPS), (80, CoverageVerdict.NOT)]
)
def test_lost_and_damaged_fields_are_gaps(whole, missing, verdict):
    findings = judge(whole, missing)
    assert findings[0].verdict is verdict
    if verdict is not CoverageVerdict.WELL:
        (finding,) = findings
        assert finding.code is FindingCode.FIELDS_MISSING
        assert finding.values == {"missing": missing, "fields": FIELDS + missing}


def test_an_object_outside_both_views_is_not_measured():
    beside = replace(MODEL, xyz_mm=MODEL.xyz_mm + np.array([0.0, 900.0, 0.0]))
    findings = judge(covered(3, object_model=beside))
    assert codes(findings) == [FindingCode.NOTHING_EXPECTED]


def test_the_document_lists_the_worst_fields_and_all_targets():
    document = coverage_document(covered(change=without(MIDDLE, 0)), missing=2)
    assert document["missing_fields"] == 2
    assert len(document["targets"]["target"]) == len(MODEL)
    assert document["targets"]["misses"]["no_blob_left"][MIDDLE] == FIELDS // 2
    assert all(one["found"] < one["expected"] for one in document["worst_fields"])
    assert len(document["worst_fields"]) == 20
