"""What is planned against the paper's own numbers, and against what the simulator then gives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from core.chain.fake_scene import coordinates, take_scene
from core.shipped_models import shipped_model
from grabberd.core.chain.plan import PlanSettings, nominal_calibration, plan, variations
from grabberd.core.geometry import NominalRig, Rig
from grabberd.core.reconstruction.accuracy import accuracy
from grabberd.errors import InputError

HALVES = {"columns": 720, "lines": 576, "left": (0, 360), "right": (360, 720)}
PAPER = NominalRig(
    **HALVES,
    distance_mm=240.0,
    base_mm=0.53 * 240.0,
    convergence_deg=2 * math.degrees(math.atan(0.265)),
    focal_length_mm=8.0,
    pixel_x_mm=0.01,
    pixel_y_mm=0.01,
)
"""Scale 1:30, pixels of 10 µm, base over height .53."""
REFERENCE = NominalRig(
    **HALVES,
    distance_mm=240.0,
    base_mm=128.0,
    convergence_deg=30.0,
    focal_length_mm=8.0,
    pixel_x_mm=0.0086,
    pixel_y_mm=0.0083,
)
FRAME = shipped_model("calibration-frames/paper-108.yaml")
LOW, HIGH = np.array([-45.0, -20.0, -6.0]), np.array([45.0, 20.0, 6.0])


def planned(rig=REFERENCE, settings=None):
    return plan(Rig.of_views(rig.views()), LOW, HIGH, settings or PlanSettings())


def test_the_papers_precision_comes_out_of_its_pointing():
    centre = planned(PAPER, PlanSettings(sigma_px=(0.170, 0.225))).places[0]
    assert centre.pointing[:3] == pytest.approx((0.048, 0.036, 0.135), rel=0.03)
    assert centre.pointing.xyz_mm == pytest.approx(0.148, rel=0.03)


def test_its_scale_is_that_of_the_paper():
    assert planned(PAPER).mm_per_px == pytest.approx((0.30, 0.30), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bits", "lines"),
    [(1, "doubled"), (8, "field"), (1, "progressive"), (4, "progressive"), (8, "progressive")],
)
def test_what_is_planned_is_what_the_simulator_gives(bits, lines):
    order = "progressive" if lines == "progressive" else "alternate"
    scene = take_scene(20, scene="accuracy_object", rig={"mirror_error_px": 0.0}, driver={"order": order})
    measured = scene.measured(bits, "doubled" if lines == "doubled" else "field")
    found = accuracy(coordinates(measured), scene.truth).rmse
    places = planned(settings=PlanSettings(bits=bits, lines=lines)).places
    expected = np.sqrt(np.mean([np.square(place.pointing) for place in places], axis=0))
    assert np.array(found) == pytest.approx(expected, rel=0.25 if lines == "progressive" else 0.45)


def test_centre_faces_and_corners_of_the_volume_are_given():
    places = {place.name: place.xyz_mm for place in planned().places}
    assert len(places) == 15
    assert places["centre"] == (0, 0, 0)
    assert places["−Y"] == (0, -20, 0)
    assert places["+X −Y +Z"] == (45, -20, 6)


def test_a_place_that_not_both_views_see_has_no_sigma():
    wide = plan(Rig.of_views(REFERENCE.views()), -200 * np.ones(3), 200 * np.ones(3), PlanSettings())
    assert wide.places[0].pointing is not None
    assert all(place.pointing is None for place in wide.places if place.name in {"−Y", "+Y"})


def test_a_volume_that_is_not_seen_is_refused():
    with pytest.raises(InputError, match="middle of the volume"):
        plan(Rig.of_views(REFERENCE.views()), LOW + 300.0, HIGH + 300.0, PlanSettings())


def test_twice_the_pointing_is_twice_the_sigma():
    once, twice = (planned(settings=PlanSettings(sigma_px=(s, s))).places[3].pointing for s in (0.1, 0.2))
    assert np.array(twice) == pytest.approx(2 * np.array(once))


def test_larger_base_and_smaller_distance_and_more_bits_better_the_depth():
    sigma = {
        name: planned(rig, settings).places[0].pointing.z_mm
        for name, rig, settings in variations(REFERENCE, PlanSettings())
    }
    assert sigma["base +20 %"] < sigma["as it is"] < sigma["base -20 %"]
    assert sigma["distance -20 %"] < sigma["as it is"] < sigma["distance +20 %"]
    assert sigma["8 bits, intact lines"] < sigma["4 bits, intact lines"] < sigma["1 bit, doubled lines"]
    assert sigma["1 bit, doubled lines"] < sigma["1 bit, intact lines"]


@pytest.mark.parametrize("bits", [1, 8])
def test_all_lines_of_a_picture_are_better_than_those_of_a_field(bits):
    """By what lines are worth: twice as many, and none of them shifts."""
    whole, field = (
        planned(settings=PlanSettings(bits=bits, lines=lines)) for lines in ("progressive", "field")
    )
    assert (np.array(whole.sigma_px) < field.sigma_px).all()
    assert whole.places[0].pointing.xyz_mm < field.places[0].pointing.xyz_mm
    fixed = planned(settings=PlanSettings(bits=bits, lines="progressive", line_jitter_px=0.5))
    assert fixed.places[0].pointing == whole.places[0].pointing


def test_a_progressive_camera_is_varied_by_bits_alone():
    kinds = {name for name, _, _ in variations(REFERENCE, PlanSettings(bits=8, lines="progressive"))}
    assert {name for name in kinds if "bit" in name} == {
        f"{bits}, progressive lines" for bits in ("1 bit", "4 bits", "8 bits")
    }


def test_a_given_pointing_is_not_varied_by_bits():
    names = [name for name, _, _ in variations(REFERENCE, PlanSettings(sigma_px=(0.1, 0.1)))]
    assert not any("bit" in name for name in names)


def test_without_a_covariance_the_calibrations_share_is_not_known():
    assert planned().places[0].calibration is None


def test_a_simulated_calibration_adds_a_share_smaller_than_the_pointings():
    settings = PlanSettings(sigma_px=(0.15, 0.15))
    rig = Rig.of(nominal_calibration(REFERENCE, FRAME, settings))
    places = plan(rig, LOW, HIGH, settings).places
    for place in places:
        assert 0.003 < place.calibration.xyz_mm < place.pointing.xyz_mm
    assert places[0].calibration.z_mm > places[0].calibration.x_mm
    assert places[0].calibration.xyz_mm < min(place.calibration.xyz_mm for place in places[7:])


def test_a_simulated_calibration_scales_with_the_pointing():
    exact = replace(FRAME, sigma_mm=1e-6)
    shares = [
        plan(Rig.of(nominal_calibration(REFERENCE, exact, settings)), LOW, HIGH, settings)
        .places[0]
        .calibration
        for settings in (PlanSettings(sigma_px=(s, s)) for s in (0.05, 0.1))
    ]
    assert np.array(shares[1]) == pytest.approx(2 * np.array(shares[0]), rel=0.02)


def test_a_left_handed_rig_is_expected_to_measure_as_well():
    settings = PlanSettings(sigma_px=(0.15, 0.15))
    right, left = (
        plan(Rig.of(nominal_calibration(REFERENCE, FRAME, settings, hands)), LOW, HIGH, settings).places[0]
        for hands in ((1, 1), (-1, -1))
    )
    assert np.array(left.pointing) == pytest.approx(np.array(right.pointing), rel=0.02)


def test_a_calibration_frame_outside_the_views_is_refused():
    far = replace(FRAME, xyz_mm=FRAME.xyz_mm + np.array([0.0, 300.0, 0.0]))
    with pytest.raises(InputError, match="of 108 targets"):
        nominal_calibration(REFERENCE, far, PlanSettings())
