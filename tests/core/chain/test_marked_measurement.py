"""Fields of a simulated rig that is knocked while they are measured: marks bring the points back."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import measure_fields
from grabberd.core.measurement.marks import KEY, MarkLocator, MarkReference
from grabberd.core.reconstruction import CoverageTally
from grabberd.core.reconstruction.coverage import coverage_document
from grabberd.core.reconstruction.drift_check import MarkState

CUP = [
    {"id": 900 + i, "x_mm": x, "y_mm": y, "z_mm": 0.0}
    for i, (x, y) in enumerate([(60, 36), (-60, -36), (60, -36), (-60, 36)])
]
PLACES = [(314, 508), (45, 37), (46, 538), (313, 65), (673, 539), (404, 66), (404, 510), (672, 37)]
KNOCKED_AT, SETTLED = 70, 110
KNOCK = {"kind": "knock", "at_field": KNOCKED_AT, "what": "camera", "x_mrad": 0.8, "y_mrad": -0.6}


@pytest.fixture(scope="module")
def scene():
    return take_scene(150, scene="accuracy_object", seed=3, rig={"marks": CUP}, faults=[KNOCK])


@pytest.fixture(scope="module")
def fields(scene):
    locator = MarkLocator(PLACES)
    return [
        one._replace(packed=one.packed.with_marks(locator.locate(grey)))
        for one, (_, grey) in zip(scene.packed(1, "doubled"), scene.fields, strict=True)
    ]


@pytest.fixture(scope="module")
def setup(scene, fields):
    """The exact calibration, with marks as they were before the knock."""
    reference = MarkReference.learnt((one.packed.parity, one.packed.marks) for one in fields[:KNOCKED_AT])
    known = scene.setup.calibration
    return replace(scene.setup, calibration=replace(known, details={KEY: reference.to_document()}))


def errors_mm(scene, measured, first, end):
    """(N, 3) errors of all points of some fields, and the σ that the correction leaves in them."""
    truth = {
        (n, target): xyz_mm
        for n, target, xyz_mm in zip(
            scene.truth.n.tolist(), scene.truth.target.tolist(), scene.truth.xyz_mm, strict=True
        )
    }
    points = [(one.n, one.points) for one in measured[first:end]]
    off = [
        xyz_mm - truth[n, int(target)]
        for n, of_field in points
        for target, xyz_mm in zip(of_field.target, of_field.xyz_mm, strict=True)
    ]
    common = np.concatenate([of_field.calibration_covariance_mm2 for _, of_field in points])
    return np.array(off), np.sqrt(np.diagonal(common, axis1=1, axis2=2).mean(axis=0))


def test_points_come_back_to_where_they_were_with_the_corrections_sigma(scene, fields, setup):
    measured = list(measure_fields(fields, setup, None, 25))
    alone = list(measure_fields(fields, scene.setup, None, 25))
    before, _ = errors_mm(scene, measured, 0, KNOCKED_AT)
    after, sigma_mm = errors_mm(scene, measured, SETTLED, 150)
    wrong, _ = errors_mm(scene, alone, SETTLED, 150)
    left_mm = np.abs(after.mean(axis=0) - before.mean(axis=0))
    assert np.abs(wrong.mean(axis=0) - before.mean(axis=0)).max() > 0.15
    assert left_mm.max() < 0.015
    assert (left_mm < 4 * sigma_mm).all()
    assert (sigma_mm > 0).all()
    assert len(after) == 60 * (150 - SETTLED)


def test_fields_are_corrected_alike_however_many_are_taken_at_once(fields, setup):
    one_by_one, together = (list(measure_fields(fields, setup, None, ahead)) for ahead in (1, 25))
    for one, other in zip(one_by_one, together, strict=True):
        assert one.points.xyz_mm.tobytes() == other.points.xyz_mm.tobytes()
        assert one.points.calibration_covariance_mm2.tobytes() == (
            other.points.calibration_covariance_mm2.tobytes()
        )
        assert one.correction.movements[0] is None or one.n >= KNOCKED_AT


def test_the_coverage_lists_what_was_corrected_and_from_when_on(fields, setup):
    tally = CoverageTally(setup.calibration, setup.object_model)
    list(measure_fields(fields, setup, tally, 25))
    listed = coverage_document(tally.result())["corrections"]
    first = next(one for one in listed if one["left"]["state"] == MarkState.CORRECTED)
    assert KNOCKED_AT < first["n"] <= KNOCKED_AT + 24
    assert np.abs(first["left"]["shift_px"]) == pytest.approx([0.56, 0.77], abs=0.1)
    assert all(sigma > 0 for sigma in first["left"]["shift_sigma_px"])


def test_without_marks_nothing_is_corrected_nor_listed(scene):
    tally = CoverageTally(scene.setup.calibration, scene.setup.object_model)
    measured = list(measure_fields(scene.packed(1, "doubled"), scene.setup, tally, 25))
    assert all(one.correction is None for one in measured)
    assert "corrections" not in coverage_document(tally.result())
