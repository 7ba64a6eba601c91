from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.calibration.networks import TRUE, frame, network, seen_less
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import LENS, Unknowns
from grabberd.core.calibration.collocation import Collocation, Components, Solution
from grabberd.core.calibration.local_field_trial import LocalFieldSettings, try_local_fields
from grabberd.core.geometry import project

FREE = [f"b{i}" for i in (1, 2, 3, 6, 7, 8, 9)] + [
    "f_mm", "x0_px", "y0_px", "omega_rad", "phi_rad", "kappa_rad", "X0_mm", "Y0_mm", "Z0_mm",
]  # fmt: skip
NOISE_PX = 0.008
WITHIN = frame(23, 17) * [0.95, 0.95, 1.0]


def unevenness(xy_px, seed, rms_px=0.06):
    """Displacements (N, 2) by waves of 60 to 180 px, such as cheap mirrors make."""
    rng = np.random.default_rng(seed)
    length, heading = rng.uniform(60, 180, 12), rng.uniform(0, 2 * np.pi, 12)
    waves = 2 * np.pi / length * np.stack([np.cos(heading), np.sin(heading)])
    height = rng.normal(size=(12, 2))
    height *= rms_px / np.sqrt((height**2).sum(axis=0) / 2)
    return np.cos(xy_px @ waves + rng.uniform(0, 2 * np.pi, 12)) @ height


def uneven_network(rms_px=0.06, target_sigma_mm=0.0, exact_places=False, seed=1):
    """Pictures through uneven mirrors; their errors are those of means of many fields."""
    plain = network(sigma_px=NOISE_PX, target_sigma_mm=0.0 if exact_places else target_sigma_mm, seed=seed)
    moved = [unevenness(plain.xy_px[plain.view == view], [seed, view], rms_px) for view in (0, 1)]
    certified = np.full(plain.target_mm.shape, target_sigma_mm)
    return replace(plain, xy_px=plain.xy_px + np.concatenate(moved), target_sigma_mm=certified)


def adjusted(given):
    unknowns = Unknowns.of(given.views, FREE, shared=[name for name in LENS if name in FREE])
    return adjust(given, unknowns)


@cache
def trial(rms_px=0.06, target_sigma_mm=0.0, exact_places=False, seed=1):
    return try_local_fields(adjusted(uneven_network(rms_px, target_sigma_mm, exact_places, seed)), 576)


def misplaced(views, fields, seed=1):
    """(2, N, 2) what stays of the pictures of places within the frame: true less model less field."""
    left = []
    for index, (true, view, local_field) in enumerate(zip(TRUE, views, fields, strict=True)):
        xy = project(true, WITHIN)
        seen = xy + unevenness(xy, [seed, index])
        left.append(seen - project(view, WITHIN) - (0.0 if local_field is None else local_field.at(seen)))
    return np.array(left)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def test_uneven_mirrors_are_learned_from_the_calibration_frame():
    before = misplaced(adjusted(uneven_network()).views, (None, None))
    after = misplaced(trial().adjustment.views, trial().fields)
    assert trial().accepted
    assert rms(before) > 0.045
    assert rms(after) < 0.4 * rms(before)


def test_held_out_targets_are_predicted_better_in_either_view():
    without, with_field = trial().held_out_px.T
    assert (with_field < 0.8 * without).all()
    assert trial().gain > 5


def test_even_mirrors_have_no_local_field():
    even = trial(rms_px=0.0)
    assert not even.accepted
    assert even.fields == (None, None)
    assert even.adjustment.views == adjusted(uneven_network(0.0)).views
    assert even.adjustment.sigma0_px == pytest.approx(NOISE_PX, rel=0.1)


def test_the_settings_say_what_is_accepted():
    strict = LocalFieldSettings(evidence=1e6)
    assert not try_local_fields(adjusted(uneven_network()), 576, strict).accepted


def test_sigma_is_what_stays():
    left = misplaced(trial().adjustment.views, trial().fields)
    places = [project(view, WITHIN) for view in TRUE]
    sigma = np.array([one.sigma_at(xy) for one, xy in zip(trial().fields, places, strict=True)])
    assert 0.7 < rms(left / sigma) < 1.3


def test_errors_of_the_certificate_move_both_views_images_alike():
    frames_own = trial(target_sigma_mm=0.01).both.correlation
    assert min(frames_own) > 0.4
    assert np.abs(trial().both.correlation).max() < 0.1


def test_handed_otherwise_both_views_x_err_against_one_another():
    mirrored = replace(TRUE[1], handedness=-1)
    given = uneven_network(target_sigma_mm=0.01)
    right = given.view == 1
    xy_px = given.xy_px.copy()
    centre = project(TRUE[1], given.target_mm[given.target[right]])
    flipped = project(mirrored, given.target_mm[given.target[right]])
    xy_px[right] = flipped + (xy_px[right] - centre) * (-1, 1)
    found = try_local_fields(adjusted(replace(given, views=(TRUE[0], mirrored), xy_px=xy_px)), 576)
    x, y = found.both.correlation
    assert x < -0.4
    assert y > 0.4


def test_the_noise_beside_the_fields_is_that_of_the_image_points():
    assert trial().adjustment.sigma0_px == pytest.approx(NOISE_PX, rel=0.6)


def test_far_from_all_targets_the_field_fades_and_sigma_grows():
    corner = np.array([[2.0, 2.0]])
    middle = np.array([[180.0, 288.0]])
    left, _ = trial().fields
    assert rms(left.at(corner)) < 0.01
    assert left.sigma_at(corner).min() > 0.9 * trial().components.signal_px
    assert left.sigma_at(middle).max() < 0.5 * trial().components.signal_px


def test_a_frame_better_than_its_certificate_is_found_out():
    found = trial(target_sigma_mm=0.01, exact_places=True)
    assert found.components.place < 0.2
    exact = misplaced(trial().adjustment.views, trial().fields)
    assert rms(misplaced(found.adjustment.views, found.fields)) < 1.1 * rms(exact)


@pytest.mark.parametrize("seed", [1, 2])
def test_errors_of_the_frame_are_told_from_those_of_the_mirrors(seed):
    given = uneven_network(target_sigma_mm=0.01, seed=seed)
    believed = trial(target_sigma_mm=0.01, seed=seed)
    held = try_local_fields(adjusted(replace(given, target_sigma_mm=np.zeros((108, 3)))), 576)
    assert 0.4 < believed.components.place < 1.6
    assert rms(misplaced(believed.adjustment.views, believed.fields, seed)) < rms(
        misplaced(held.adjustment.views, held.fields, seed)
    )


def test_given_sigmas_three_times_too_large_give_the_same_field():
    given = uneven_network()
    careful = try_local_fields(adjusted(replace(given, sigma_px=3 * given.sigma_px)), 576)
    places = project(TRUE[0], WITHIN)
    assert careful.components.noise == pytest.approx(1 / 3, rel=0.5)
    assert rms(careful.fields[0].at(places) - trial().fields[0].at(places)) < 0.003


def test_what_was_added_to_the_sigmas_for_the_models_misses_is_taken_off_again():
    given = uneven_network()
    enlarged = replace(given, sigma_px=np.hypot(given.sigma_px, 0.05))
    found = try_local_fields(adjusted(enlarged), 576, unmodelled_px=0.05)
    places = project(TRUE[0], WITHIN)
    assert found.components.noise == pytest.approx(trial().components.noise, rel=0.05)
    assert rms(found.fields[0].at(places) - trial().fields[0].at(places)) < 1e-3


def test_targets_that_one_view_alone_sees_do_no_harm():
    some = try_local_fields(adjusted(seen_less(uneven_network(), 0.1)), 576)
    assert some.accepted
    assert rms(misplaced(some.adjustment.views, some.fields)) < 0.03


SOME = Components(signal_px=0.06, length_px=25.0, noise=1.0, place=1.0)


def solved(given, components=SOME):
    one = adjusted(given)
    return Solution(Collocation(given, one.unknowns, one.views, one.xyz_mm), components)


def test_a_held_out_targets_error_is_that_of_a_solution_without_it():
    whole = solved(uneven_network())
    network_ = whole.collocation.network
    kept = network_.target != 40
    collocation = whole.collocation
    without = Solution(
        Collocation(network_.select(kept), collocation.unknowns, collocation.views, network_.target_mm), SOME
    )
    rows = np.concatenate([kept, kept])
    noise_free = without.collocation.misclosure - without.collocation.covariance(SOME) @ without.influence
    step = np.linalg.lstsq(without.collocation.trend, noise_free, rcond=None)[0]
    by_trend = collocation.trend[~rows] * collocation.scale / without.collocation.scale @ step
    by_signal = without.signal(network_.view[~kept], network_.xy_px[~kept]).T.ravel()
    expected = collocation.misclosure[~rows] - by_trend - by_signal
    assert whole.held_out()[~kept].T.ravel() == pytest.approx(expected, abs=1e-9)


def test_without_correlation_there_is_no_signal_between_targets():
    alone = solved(uneven_network(), SOME.uncorrelated)
    assert not alone.signal(0, np.array([[100.5, 200.5]])).any()


def test_views_share_no_signal():
    one = solved(uneven_network())
    apart = one.collocation.distance_px[
        np.ix_(one.collocation.network.view == 0, one.collocation.network.view == 1)
    ]
    assert np.isinf(apart).all()


def test_few_targets_make_no_field_out_of_nothing():
    few = network(places=frame(5, 4), sigma_px=NOISE_PX)
    assert not try_local_fields(adjusted(few), 576).accepted
