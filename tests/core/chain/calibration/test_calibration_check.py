"""Ten seconds of the calibration frame: whether the calibration still holds."""

from dataclasses import replace

import pytest

from core.chain.fake_scene import take_scene
from core.shipped_models import PAPER, shipped_model
from grabberd.core.chain.calibration.calibration_check import CheckVerdict, check
from grabberd.core.field import NumberedField
from grabberd.core.geometry import NominalRig, rotation_angles, rotation_matrix
from grabberd.errors import MeasurementError

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
FRAME = shipped_model(PAPER)
PX_RAD = 0.0084 / 8.0
ACROSS, ALONG = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


@pytest.fixture(scope="module")
def scene():
    return take_scene(20, scene="calibration_frame", seed=5)


def turned(calibration, axis, px, views=("left",)):
    """The calibration with views turned in their cameras, as if their images had moved by so many pixels."""
    for name in views:
        view = getattr(calibration, name)
        turn = rotation_matrix(*(px * PX_RAD * share for share in axis))
        whole = turn @ rotation_matrix(view.omega_rad, view.phi_rad, view.kappa_rad)
        angles = dict(zip(("omega_rad", "phi_rad", "kappa_rad"), rotation_angles(whole), strict=True))
        calibration = replace(calibration, **{name: replace(view, **angles)})
    return calibration


def checked(scene, axis=ACROSS, px=0.0, bits=8, views=("left",), **options):
    lines = "doubled" if bits == 1 else "field"
    calibration = turned(scene.setup.calibration, axis, px, views)
    return check(scene.packed(bits, lines), NOMINAL, FRAME, calibration, **options)


@pytest.mark.parametrize("bits", [1, 8])
@pytest.mark.parametrize("in_place", [False, True])
def test_a_good_calibration_fits(scene, bits, in_place):
    found = checked(scene, bits=bits, in_place=in_place)
    assert found.verdict is CheckVerdict.FITS
    assert found.reasons == ()
    assert found.seen == found.of == 108
    assert found.chi2 < 3
    assert found.rmse.xyz_mm < 0.06


@pytest.mark.parametrize("axis", [ACROSS, ALONG])
@pytest.mark.parametrize("px", [3.0, 10.0])
def test_a_mirror_that_has_moved_is_found_whichever_way(scene, axis, px):
    found = checked(scene, axis, px, in_place=True)
    assert found.verdict is CheckVerdict.RECALIBRATE
    assert abs(found.shift_px[0]).max() == pytest.approx(px, rel=0.2)
    assert abs(found.shift_px[1]).max() < 0.1


def test_what_only_the_views_together_can_tell_is_told_without_a_place_too(scene):
    found = checked(scene, ACROSS, 1.0)
    assert found.parallax_px == pytest.approx(1.0, rel=0.2)
    assert found.verdict is CheckVerdict.RECALIBRATE
    assert "epipolar" in found.reasons[0]


def test_a_camera_that_has_moved_as_a_whole_is_seen_where_the_calibration_frame_stands_in_place(scene):
    both = ("left", "right")
    assert checked(scene, ACROSS, 1.0, views=both, in_place=True).verdict is CheckVerdict.RECALIBRATE
    assert checked(scene, ACROSS, 1.0, views=both).placed.shift_mm[0] == pytest.approx(0.26, abs=0.1)


def test_without_a_calibration_frame_in_the_picture_it_is_said_so():
    liner = take_scene(4)
    with pytest.raises(MeasurementError):
        check(liner.packed(8, "field"), NOMINAL, FRAME, liner.setup.calibration)


def test_no_field_is_no_check(scene):
    nothing: list[NumberedField] = []
    with pytest.raises(MeasurementError):
        check(nothing, NOMINAL, FRAME, scene.setup.calibration)
