"""Fields of the calibration frame in, both virtual cameras out."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.chain.fake_scene import coordinates, take_scene
from core.chain.pinhole_pictures import Camera, frames, still
from core.shipped_models import PAPER, shipped_model
from grabberd.core.calibration.adjustment.network import LENS
from grabberd.core.calibration.identification.manual_identification import Mark
from grabberd.core.chain.calibration.acceptance.verdict import judge
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.calibration.calibration_result import CalibrateSettings
from grabberd.core.chain.calibration.report_document import report_document
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, quantise, split_frame
from grabberd.core.geometry import Calibration, NominalRig, project, rotation_matrix
from grabberd.core.measurement.marks import MarkLocator
from grabberd.core.reconstruction.accuracy import Truth, accuracy
from grabberd.documents.calibration_reports import CalibrationReport
from grabberd.errors import InputError, MeasurementError, RankDeficient

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
ABOUT = {"id": "test", "created_utc": "2026-01-02T03:04:05+00:00"}


FRAME = shipped_model(PAPER)
OBJECT = shipped_model("objects/accuracy-object.yaml")


@pytest.fixture(scope="module")
def scene():
    return take_scene(32, scene="calibration_frame", seed=5)


@pytest.fixture(scope="module")
def calibrated(scene):
    """What the scene's fields of so many bits and such lines are calibrated to; no test changes it."""
    return cache(lambda bits, lines: calibrate([scene.packed(bits, lines)], NOMINAL, FRAME))


@pytest.fixture(scope="module")
def made(calibrated):
    return calibrated(8, "field")


def report_of(result):
    """The report's document, which its model takes and gives back unchanged."""
    document = report_document(result, ABOUT)
    assert CalibrationReport.model_validate(document).model_dump(mode="json", by_alias=True) == document
    return document


def named(result, name="test"):
    return result.calibration(name, "2026-01-02T03:04:05+00:00", "a test", None, {})


def test_every_target_of_both_views_is_identified_without_a_click(made):
    for side in made.identification:
        assert sorted(side.target) == list(range(108))
    assert made.identification.handedness == (1, 1)


def test_points_measured_with_it_are_nearer_to_the_truth_than_with_the_exact_optics_alone(made):
    """The mirrors' local errors are in the calibration, but in no set of exact parameters."""
    measured = take_scene(32, scene="accuracy_object", seed=6)
    own = _rmse(measured, named(made))
    assert own < 0.036
    assert own < 0.75 * _rmse(measured, measured.setup.calibration)


def _rmse(scene, calibration):
    setup = replace(scene.setup, calibration=calibration)
    found = measure_fields(scene.packed(8, "field"), setup)
    return accuracy(coordinates(found), scene.truth).rmse.xyz_mm


def test_the_document_gives_back_the_same_calibration(made):
    document = json.loads(json.dumps(named(made).to_document()))
    again = Calibration.from_document(document)
    assert again.views == made.views
    np.testing.assert_array_equal(again.covariance, made.final.parameter_covariance)
    assert again.local_fields[0] is not None


def test_the_report_has_every_image_point_and_no_number_that_json_does_not_know(made):
    document = report_of(made)
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert len(document["residuals"]) == len(made.adjustment.network)
    assert [view["name"] for view in document["views"]] == ["left", "right"]
    assert document["local_field"]["accepted"]
    assert document["capture"] is None


def test_the_volume_says_what_one_field_is_worth(made):
    """One field's pointing, not that of the means which the calibration rests on."""
    x, y = made.pointing_px
    assert 0.03 < x < 0.08
    assert 0.01 < y < 0.04
    calibration, total = made.volume.calibration_sigma_mm, made.volume.sigma_mm
    assert np.nanmedian(total[..., 2]) > 2 * np.nanmedian(calibration[..., 2])


def test_parameters_and_their_comparison_are_of_one_adjustment(made):
    document = report_of(made)
    parameters = {one["name"]: one["value"] for one in document["views"][0]["parameters"]}
    for row in document["comparison"]:
        assert row["left"] == parameters[row["parameter"]]
    assert document["result"]["sigma0_px"] == named(made).sigma0_px


def test_blunders_do_not_stay_in_the_weights(scene):
    wrong = FRAME.xyz_mm.copy()
    wrong[[27, 56]] += [[0.3, 0, 0], [0, 0, 0.5]]
    result = calibrate([scene.packed(8, "field")], NOMINAL, replace(FRAME, xyz_mm=wrong))
    assert {int(FRAME.target[one.target]) for one in result.blunders} == {28, 57}
    assert result.adjustment.sigma0 == pytest.approx(1, abs=0.02)
    displaced = next(one for one in judge(result).reasons if one.code == "displaced")
    assert displaced.values["ids"] == "28 (0.29 mm), 57 (0.46 mm)"
    assert {one["target"] for one in report_of(result)["blunders"]} == {28, 57}


@pytest.mark.parametrize(("bits", "lines"), [(8, "field"), (1, "doubled")])
def test_repeated_fields_add_nothing_to_a_mean_and_are_said(scene, calibrated, bits, lines):
    distinct = list(scene.packed(bits, lines))
    frames = [distinct[n : n + 2] for n in range(0, len(distinct), 2)]
    twice = [field for frame in frames for field in (*frame, *frame)]
    once, again = calibrated(bits, lines), calibrate([twice], NOMINAL, FRAME)
    assert (once.repeated, again.repeated) == (0, len(distinct))
    for one, other in zip(once.images, again.images, strict=True):
        np.testing.assert_array_equal(one.sigma_px, other.sigma_px)
    said = [one for one in judge(again).reasons if one.code == "repeated"]
    assert "32 of 64 fields repeat the one before" in said[0].message


@pytest.mark.parametrize(
    ("bits", "lines", "said"), [(1, "field", True), (1, "doubled", False), (8, "field", False)]
)
def test_single_fields_of_one_bit_are_remarked_upon(calibrated, bits, lines, said):
    result = calibrated(bits, lines)
    assert ("one_bit" in {one.code for one in judge(result).reasons}) is said


def test_a_model_that_leaves_pixels_is_no_result(scene):
    with pytest.raises(MeasurementError, match="off by 3"):
        calibrate([scene.packed(8, "field")], NOMINAL, FRAME, CalibrateSettings(free=("b3",)))


def test_a_longer_rig_converges_too():
    rig = {"base_mm": 160, "distance_mm": 320, "seed": 9}
    taken = take_scene(16, scene="calibration_frame", rig=rig, camera={"f_mm": 10})
    nominal = replace(NOMINAL, base_mm=160.0, distance_mm=320.0, convergence_deg=28.07, focal_length_mm=10.0)
    result = calibrate([taken.packed(8, "field")], nominal, FRAME)
    assert result.unmodelled_px < 0.1


def test_the_imaging_geometry_of_the_report_is_the_rigs(made):
    geometry = report_of(made)["geometry"]
    assert geometry["base_mm"] == pytest.approx(128, rel=0.02)
    assert geometry["distance_mm"] == pytest.approx(240, rel=0.03)
    assert geometry["convergence_deg"] == pytest.approx(30, abs=2)


def test_one_mirror_a_view_is_found_as_left_handed():
    taken = take_scene(16, scene="calibration_frame", rig={"reflections": 1})
    result = calibrate([taken.packed(8, "field")], NOMINAL, FRAME)
    assert result.identification.handedness == (-1, -1)
    assert report_of(result)["geometry"]["planar_motion_mm"] < 0.5


def test_a_prescribed_handedness_that_the_picture_contradicts_is_refused(scene):
    with pytest.raises(MeasurementError):
        calibrate([scene.packed(8, "field")], NOMINAL, FRAME, CalibrateSettings(handedness=-1))


@pytest.mark.parametrize(("bits", "lines"), [(1, "doubled"), (1, "field")])
def test_one_bit_is_enough_for_a_calibration(scene, calibrated, bits, lines):
    result = calibrated(bits, lines)
    exact = scene.setup.calibration
    for view, true in zip(result.views, exact.views, strict=True):
        off = project(view, FRAME.xyz_mm) - project(true, FRAME.xyz_mm)
        assert np.sqrt((off**2).mean()) < 0.1


def test_the_papers_own_options_give_equal_weights_and_held_points(scene):
    settings = CalibrateSettings(equal_weights=True, held=True, tied=True, alpha=None, local_field=False)
    result = calibrate([scene.packed(8, "field")], NOMINAL, FRAME, settings)
    assert np.ptp(result.adjustment.network.sigma_px) < 1e-12
    np.testing.assert_array_equal(result.adjustment.xyz_mm, FRAME.xyz_mm)
    assert len(result.adjustment.unknowns) == 34
    assert all(view.b[7] == view.b[8] for view in result.views)
    assert result.local is None
    assert result.elimination is None
    assert report_of(result)["local_field"] is None


def test_a_shared_lens_is_the_same_in_both_views(scene):
    result = calibrate([scene.packed(8, "field")], NOMINAL, FRAME, CalibrateSettings(shared=LENS))
    left, right = result.views
    assert (left.f_mm, left.x0_px, left.y0_px, left.b[2:7]) == (
        right.f_mm,
        right.x0_px,
        right.y0_px,
        right.b[2:7],
    )
    assert left.b[0] != right.b[0]
    assert report_of(result)["settings"]["shared"] == list(LENS)


def test_an_interior_parameter_that_is_not_adjusted_is_as_the_rig_was_built(scene):
    settings = CalibrateSettings(
        free=("omega_rad", "phi_rad", "kappa_rad", "X0_mm", "Y0_mm", "Z0_mm", "left.f_mm")
    )
    result = calibrate([scene.packed(8, "field")], NOMINAL, FRAME, settings)
    left, right = result.views
    assert (right.f_mm, right.x0_px, right.b) == (8.0, 359.5, (0.0,) * 9)
    assert left.f_mm != 8.0
    reasons = report_of(result)["acceptance"]["reasons"]
    assert any("parameters that were held" in reason["message"] for reason in reasons)


def test_a_parameter_that_does_not_exist_is_named(scene):
    with pytest.raises(InputError, match="b10"):
        calibrate([scene.packed(8, "field")], NOMINAL, FRAME, CalibrateSettings(free=("f_mm", "b10")))


def test_identifications_by_hand_lead_to_the_same_calibration(scene, made):
    marks = [
        Mark(view.name, int(FRAME.target[index]), *project(view, FRAME.xyz_mm[[index]])[0])
        for view in scene.setup.calibration.views
        for index in (0, 8, 54, 99, 107)
    ]
    result = calibrate([scene.packed(8, "field")], NOMINAL, FRAME, by_hand=[marks])
    np.testing.assert_allclose(result.adjustment.values, made.adjustment.values, rtol=1e-6, atol=1e-9)


class TestBadInput:
    def test_no_fields(self):
        with pytest.raises(MeasurementError, match="no field"):
            calibrate([[]], NOMINAL, FRAME)

    def test_a_dark_view_is_named(self, scene):
        with pytest.raises(MeasurementError, match="right"):
            calibrate([_darkened(scene, slice(360, 720))], NOMINAL, FRAME)

    def test_too_few_targets(self, scene):
        with pytest.raises(MeasurementError, match="left"):
            calibrate([_darkened(scene, slice(0, 265))], NOMINAL, FRAME)

    def test_another_calibration_frames_file(self, scene):
        with pytest.raises(MeasurementError):
            calibrate([scene.packed(8, "field")], NOMINAL, OBJECT)

    def test_swapped_views(self, scene):
        swapped = (
            one._replace(packed=replace(one.packed, data=np.roll(one.packed.data, 360, axis=2)))
            for one in scene.packed(8, "field")
        )
        with pytest.raises(MeasurementError, match="swapped"):
            calibrate([swapped], NOMINAL, FRAME)

    def test_a_planar_calibration_frame_names_what_it_does_not_determine(self):
        flat = replace(FRAME, xyz_mm=FRAME.xyz_mm * [1, 1, 0])
        with pytest.raises(RankDeficient, match=r"plane.*f_mm, x0_px, y0_px"):
            calibrate([_fields(still(flat.xyz_mm, 1.5), 2)], NOMINAL, flat)

    def test_a_field_order_that_is_the_wrong_way_round(self, scene):
        wrong = (
            one._replace(packed=replace(one.packed, y0=1 - one.packed.y0, parity=1 - one.packed.parity))
            for one in scene.packed(8, "field")
        )
        with pytest.raises(MeasurementError, match="field order"):
            calibrate([wrong], NOMINAL, FRAME)

    def test_a_calibration_frame_that_is_moved(self, scene):
        other = take_scene(16, scene="calibration_frame", rig={"camera_tilt_mrad": 12.0})
        fields = [*scene.packed(8, "field"), *other.packed(8, "field")]
        with pytest.raises(MeasurementError, match="moved"):
            calibrate([fields], NOMINAL, FRAME)


def _darkened(scene, columns):
    for one in scene.packed(8, "field"):
        one.packed.data[:, :, columns] = 20
        yield one


def _fields(picture, count, seed=0):
    for number, frame in enumerate(frames(picture, count, np.random.default_rng(seed))):
        for parity, field in enumerate(split_frame(frame)):
            assert isinstance(field, Field)
            n = 2 * number + parity
            yield NumberedField(n, n * 20_000_000, n, quantise(field, 8, 50))


@pytest.mark.parametrize("mirrored", [False, True])
def test_pictures_that_another_program_made_are_measured_as_well(mirrored):
    rng = np.random.default_rng(3)
    places = FRAME.xyz_mm + rng.normal(0, FRAME.sigma_mm, FRAME.xyz_mm.shape)
    result = calibrate([_fields(still(places, 1.5, mirrored), 12)], NOMINAL, FRAME)
    assert result.identification.handedness == ((-1, -1) if mirrored else (1, 1))
    for view in result.views:
        off = project(view, FRAME.xyz_mm) - Camera(view.name, mirrored).project(FRAME.xyz_mm)
        assert np.sqrt((off**2).mean()) < 0.05
    there = OBJECT.xyz_mm + rng.uniform(-0.1, 0.1, OBJECT.xyz_mm.shape)
    setup = MeasureSetup(calibration=named(result), object_model=OBJECT)
    found = measure_fields(_fields(still(there, 1.5, mirrored), 12, seed=1), setup)
    truth = Truth(None, OBJECT.target, there, np.ones(len(OBJECT), np.bool_))
    reached = accuracy(coordinates(found), truth)
    assert (reached.missing, reached.wrong) == (0, 0)
    assert reached.rmse.xyz_mm < 0.045


def test_several_poses_of_the_calibration_frame_give_one_rig():
    places = FRAME.xyz_mm
    turn = rotation_matrix(*np.radians([10.0, -8.0, 25.0]).tolist())
    normal = dict(zip(("nx", "ny", "nz"), (turn @ [0.0, 0.0, 1.0]).tolist(), strict=True))
    points = [
        {"id": int(number), "x_mm": x, "y_mm": y, "z_mm": z, **normal}
        for number, (x, y, z) in zip(FRAME.target, (places @ turn.T + [3.0, -2.0, 2.0]).tolist(), strict=True)
    ]
    captures = [
        list(take_scene(4, scene="calibration_frame", seed=5).packed(8, "field")),
        list(take_scene(4, scene="points", points=points, seed=6).packed(8, "field")),
    ]
    result = calibrate(captures, NOMINAL, FRAME)
    (pose,) = result.poses
    assert pose.turn_deg == pytest.approx(np.degrees(np.arccos((np.trace(turn) - 1) / 2)), abs=0.1)
    assert np.abs(pose.values[3:] - [3.0, -2.0, 2.0]).max() < 0.1
    assert report_of(result)["result"]["poses"][0]["image_points"] == pose.count > 180
    assert named(result).covariance.shape == (36, 36)
    few = list(take_scene(4, scene="points", points=points[:5]).packed(8, "field"))
    with pytest.raises(MeasurementError, match="capture 2: "):
        calibrate([captures[0], few], NOMINAL, FRAME)
    with pytest.raises(MeasurementError, match="no capture"):
        calibrate([], NOMINAL, FRAME)


def test_marks_beside_the_frame_are_learnt_by_parity_and_no_target_is_mistaken_for_one():
    cup = [
        {"id": 900 + i, "x_mm": x, "y_mm": y, "z_mm": 0.0} for i, (x, y) in enumerate([(60, 36), (-60, -36)])
    ]
    marked = take_scene(32, scene="calibration_frame", seed=5, rig={"marks": cup})
    places = [(314, 508), (45, 37), (673, 539), (404, 66)]
    locator = MarkLocator(places)
    fields = [
        one._replace(packed=one.packed.with_marks(locator.locate(grey)))
        for one, (_, grey) in zip(marked.packed(1, "doubled"), marked.fields, strict=True)
    ]
    result = calibrate([fields], NOMINAL, FRAME)
    assert result.image_points > 200
    marks = result.marks
    assert marks.fields.tolist() == [32] * 4
    # Of the simulated grabber's own optics, whose mirrors are uneven.
    cup_mm = np.array([[one["x_mm"], one["y_mm"], one["z_mm"]] for one in cup])
    exact = np.concatenate([project(view, cup_mm) for view in marked.setup.calibration.views])
    assert np.abs(marks.place_px.mean(axis=0) - exact).max() < 0.4
    assert (marks.sigma_px < 0.12).all()


def test_a_calibration_without_marks_has_learnt_none(made):
    assert made.marks is None
