from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.stats import chi2

from core.calibration.networks import SIGMA_PX, THREE, TRUE, deviation, frame, network, rough, seen_less, tied
from grabberd.core.calibration.adjustment.adjustment import AdjustmentSettings, adjust
from grabberd.core.calibration.adjustment.network import LENS, Unknowns
from grabberd.core.geometry import project
from grabberd.errors import MeasurementError, RankDeficient
from proofs.bench.adjustment import full_covariance

SMALL = frame(6, 5)
KNOWN = {"held": 0.0, "weighted": 0.005}


def likely(statistic: float, freedom: int) -> bool:
    """Whether a χ² of so many degrees of freedom may have come about by chance, one in ten thousand."""
    return bool(chi2.ppf(5e-5, freedom) < statistic < chi2.ppf(1 - 5e-5, freedom))


@pytest.mark.parametrize("seed", range(6))
def test_pictures_without_error_give_the_truth_from_nominal_values_ten_per_cent_wrong(seed):
    adjusted = adjust(network(seed=None, start=rough(seed=seed)), tied())
    assert adjusted.sigma0 < 1e-3
    assert np.abs(adjusted.residual_px).max() < 1e-4
    assert np.allclose(adjusted.values, adjusted.unknowns.values(TRUE), rtol=1e-4, atol=1e-8)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_any_number_of_views_is_adjusted(count):
    views = THREE[:count]
    adjusted = adjust(network(views, start=rough(views)), tied(views))
    assert len(adjusted.views) == count
    assert adjusted.freedom == count * (2 * 108 - 17)
    off = deviation(adjusted, views)
    assert likely(off @ np.linalg.solve(adjusted.covariance / adjusted.sigma0**2, off), count * 17)


@pytest.mark.parametrize("handedness", [1, -1])
def test_left_handed_views_are_adjusted_as_well(handedness):
    views = tuple(replace(view, handedness=handedness, b=(0.0,) * 9) for view in TRUE)
    free = [name for name in tied(views).names if ".b" not in name]
    away = SMALL * [0.3, 0.3, 1.0] if handedness < 0 else SMALL
    adjusted = adjust(network(views, away, start=views), Unknowns.of(views, free))
    assert adjusted.sigma0 == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("way", KNOWN)
def test_the_covariance_is_that_of_repeated_adjustments(way):
    repeats, unknowns, known = 100, tied(), KNOWN[way]
    found = [
        adjust(network(sigma_px=0.02, target_sigma_mm=known, seed=seed), unknowns) for seed in range(repeats)
    ]
    squares = [
        deviation(one) @ np.linalg.solve(one.covariance / one.sigma0**2, deviation(one)) for one in found
    ]
    assert likely(sum(squares), repeats * len(unknowns))
    assert likely(sum(one.sum_of_squares for one in found), sum(one.freedom for one in found))


@pytest.mark.parametrize("sigma_mm", [0.05, np.inf])
def test_the_places_covariance_is_that_of_repeated_adjustments(sigma_mm):
    known = np.full(SMALL.shape, sigma_mm)
    known[:12] = 0.0
    unknowns = Unknowns.of(TRUE, ("kappa_rad", "X0_mm", "Y0_mm", "Z0_mm", "f_mm"))
    repeats, free = 100, slice(12, None)
    total = 0.0
    for seed in range(repeats):
        one = adjust(network(places=SMALL, target_sigma_mm=known, seed=seed), unknowns)
        off = (one.xyz_mm - SMALL)[free]
        weight = np.linalg.inv(one.place_covariance_mm2[free] / one.sigma0**2)
        total += np.einsum("tk,tkl,tl->", off, weight, off)
    expected = repeats * off.size
    assert total == pytest.approx(expected, rel=0.08)  # the places correlate, so the χ² is wider than theirs
    assert not one.place_covariance_mm2[:12].any()


@pytest.mark.parametrize("sigma_mm", [0.0, 0.02])
def test_redundancies_sum_to_the_degrees_of_freedom(sigma_mm):
    adjusted = adjust(seen_less(network(target_sigma_mm=sigma_mm), 0.1), tied())
    total = adjusted.redundancy.sum()
    if sigma_mm:  # the given places are observations, too
        variance = np.einsum("tkk->tk", adjusted.place_covariance_mm2) / adjusted.sigma0**2
        total += (1.0 - variance / sigma_mm**2).sum()
    assert total == pytest.approx(adjusted.freedom, abs=1e-6)
    assert (adjusted.redundancy > 0).all()
    assert (adjusted.redundancy < 1).all()


def test_held_places_are_the_limit_of_very_well_known_ones():
    held, weighted = adjust(network(), tied()), adjust(network(target_sigma_mm=1e-7), tied())
    assert np.abs((held.values - weighted.values) / held.sigma).max() < 1e-3
    assert np.allclose(held.sigma, weighted.sigma, rtol=1e-3)
    assert np.abs(weighted.xyz_mm - frame()).max() < 1e-5


def test_places_of_which_nothing_is_known_are_the_limit_of_badly_known_ones():
    known = np.zeros(SMALL.shape)
    known[::3] = np.inf
    free = adjust(network(places=SMALL, target_sigma_mm=known), tied())
    given_mm = replace(free.network, target_sigma_mm=np.where(known > 0, 1e4, 0.0))
    weak = adjust(given_mm, tied())
    assert weak.freedom - free.freedom == np.isinf(known).sum()
    assert np.abs((free.values - weak.values) / free.sigma).max() < 1e-3
    assert np.abs(free.xyz_mm - weak.xyz_mm).max() < 1e-4
    assert np.allclose(free.sigma / free.sigma0, weak.sigma / weak.sigma0, rtol=1e-3)


def test_shared_parameters_come_out_the_same_in_all_views_and_better():
    start = rough(share=0.03)
    shared = adjust(network(start=start), Unknowns.of(TRUE, tied=True, shared=LENS))
    apart = adjust(network(start=start), tied())
    left, right = shared.views
    assert left.f_mm == pytest.approx(right.f_mm, abs=1e-12)
    assert left.b[2:7] == pytest.approx(right.b[2:7], abs=1e-15)
    assert left.Z0_mm != right.Z0_mm
    index = shared.unknowns.names.index("lens.f_mm")
    assert shared.sigma[index] < apart.sigma[apart.unknowns.names.index("left.f_mm")]
    assert len(shared.unknowns) == 34 - len(LENS)


def test_tied_mirror_terms_come_out_the_same():
    adjusted = adjust(network(start=rough()), tied())
    assert all(view.b[7] == view.b[8] != 0.0 for view in adjusted.views)
    assert "left.b8=b9" in adjusted.unknowns.names


def test_a_parameter_free_in_one_view_stays_in_the_other():
    start = rough(share=0.001)
    unknowns = Unknowns.of(start, ("kappa_rad", "left.f_mm"))
    adjusted = adjust(network(start=start), unknowns)
    assert unknowns.names == ("left.f_mm", "left.kappa_rad", "right.kappa_rad")
    assert adjusted.views[1] == replace(start[1], kappa_rad=adjusted.views[1].kappa_rad)
    held = np.delete(np.arange(36), [0, 5, 23])
    assert not adjusted.parameter_covariance[held].any()
    assert adjusted.parameter_covariance[0, 23] == adjusted.covariance[0, 2]


def test_nothing_sought_but_places_is_an_intersection():
    unknown = np.full(SMALL.shape, np.inf)
    adjusted = adjust(network(places=SMALL, target_sigma_mm=unknown, seed=3), Unknowns.of(TRUE, ()))
    assert adjusted.freedom == len(SMALL)
    assert np.abs(adjusted.xyz_mm - SMALL).max() < 0.2
    assert adjusted.sigma0 == pytest.approx(1.0, abs=0.4)


@pytest.mark.parametrize("sigma_mm", [0.0, 0.02])
def test_another_program_finds_the_same_minimum(sigma_mm):
    unknowns, given_all = tied(), seen_less(network(places=SMALL, target_sigma_mm=sigma_mm), 0.05)
    ours = adjust(given_all.starting_from(rough(share=0.02)), unknowns)
    count = len(unknowns)

    def misclosures(x):
        views = unknowns.with_values(TRUE, x[:count] * ours.sigma)
        places = x[count:].reshape(-1, 3) if sigma_mm else given_all.target_mm
        image = np.array([project(view, places) for view in views])[given_all.view, given_all.target]
        whitened = ((image - given_all.xy_px) / given_all.sigma_px).ravel()
        return (
            np.append(whitened, (places - given_all.target_mm).ravel() / sigma_mm) if sigma_mm else whitened
        )

    start = unknowns.values(TRUE) / ours.sigma
    start = np.append(start, given_all.target_mm.ravel()) if sigma_mm else start
    theirs = least_squares(misclosures, start, method="lm", x_scale="jac", xtol=1e-13, ftol=1e-13)
    assert 2 * theirs.cost == pytest.approx(ours.sum_of_squares, rel=1e-6)
    assert np.abs(theirs.x[:count] - ours.values / ours.sigma).max() < 0.01
    cofactor = np.linalg.inv(theirs.jac.T @ theirs.jac)[:count, :count]
    assert np.allclose(np.sqrt(np.diag(cofactor)) * ours.sigma0, 1.0, rtol=0.01)


def test_the_full_covariance_has_the_places_of_all_targets():
    adjusted = adjust(network(places=SMALL, target_sigma_mm=0.02), tied())
    full, count = full_covariance(adjusted), 34
    assert full.shape == (34 + 90, 34 + 90)
    assert np.array_equal(full[:count, :count], adjusted.covariance)
    assert np.allclose(full[count + 6 : count + 9, count + 6 : count + 9], adjusted.place_covariance_mm2[2])
    scale = np.sqrt(np.diag(full))
    assert np.linalg.eigvalsh(full / np.outer(scale, scale))[0] > -1e-9
    shifted = adjust(replace(adjusted.network, xy_px=adjusted.network.xy_px + 0.01), tied())
    assert np.allclose(
        full_covariance(shifted) / shifted.sigma0**2, full / adjusted.sigma0**2, rtol=0.05, atol=1e-6
    )


def test_an_unseen_target_changes_nothing_and_keeps_what_was_known_of_it():
    whole = network(places=SMALL)
    known = np.zeros(SMALL.shape)
    known[4], known[5] = np.inf, 0.5
    partly = whole.select(~np.isin(whole.target, [4, 5]))
    adjusted = adjust(replace(partly, target_sigma_mm=known), tied())
    assert np.allclose(adjusted.values, adjust(partly, tied()).values, rtol=1e-9)
    assert np.isinf(adjusted.place_covariance_mm2[4].diagonal()).all()
    assert adjusted.place_covariance_mm2[5, 0, 0] == pytest.approx(0.25 * adjusted.sigma0**2)


@given(seed=st.integers(0, 1000), factor=st.floats(0.1, 10.0))
@settings(max_examples=10)
def test_neither_the_order_nor_the_unit_of_weight_matters(seed, factor):
    one = seen_less(network(places=SMALL, target_sigma_mm=0.02), 0.1)
    order, names = (
        np.random.default_rng(seed).permutation(len(one)),
        np.random.default_rng(seed).permutation(len(SMALL)),
    )
    other = replace(
        one,
        view=one.view[order],
        target=np.argsort(names)[one.target[order]],
        xy_px=one.xy_px[order],
        sigma_px=factor * one.sigma_px[order],
        target_mm=one.target_mm[names],
        target_sigma_mm=factor * one.target_sigma_mm[names],
    )
    first, second = adjust(one, tied()), adjust(other, tied())
    assert np.abs((first.values - second.values) / first.sigma).max() < 1e-3
    assert np.allclose(first.sigma, second.sigma, rtol=1e-6)
    assert np.allclose(first.redundancy[order], second.redundancy, atol=1e-6)
    assert second.sigma0 == pytest.approx(first.sigma0 / factor, rel=1e-6)


def test_sigma0_is_one_where_the_stated_errors_are_true_and_in_px_what_they_are():
    adjusted = adjust(network(), tied())
    assert adjusted.sigma0 == pytest.approx(1.0, abs=0.12)
    assert adjusted.sigma0_px == pytest.approx(SIGMA_PX * adjusted.sigma0)
    assert np.nanstd(adjusted.standardised) == pytest.approx(1.0, abs=0.05)


def test_a_start_behind_a_camera_is_refused():
    behind = tuple(replace(view, Z0_mm=-view.Z0_mm) for view in TRUE)
    with pytest.raises(MeasurementError, match="behind a camera") as refused:
        adjust(network(start=behind), tied())
    assert "nominal geometry" in refused.value.hint


def test_wrong_identification_does_not_converge_and_says_where_to_look():
    mixed = network(start=rough())
    mixed = replace(mixed, target=np.concatenate([mixed.target[107::-1], mixed.target[108:]]))
    with pytest.raises(MeasurementError, match=r"not converged after .* the last 10 neither") as refused:
        adjust(mixed, tied(), AdjustmentSettings(most_steps=10))
    assert "which target is which" in refused.value.hint


def test_a_target_of_unknown_place_in_one_view_is_refused():
    one = network(places=SMALL)
    known = np.zeros(SMALL.shape)
    known[7] = np.inf
    lonely = replace(one.select(~((one.target == 7) & (one.view == 1))), target_sigma_mm=known)
    with pytest.raises(MeasurementError, match="targets 7 have too few image points"):
        adjust(lonely, tied())


def test_fewer_observations_than_unknowns_are_refused():
    few = network(places=SMALL)
    with pytest.raises(MeasurementError, match="16 image points do not determine 34 parameters"):
        adjust(few.select(few.target < 8), tied())


def test_a_view_without_any_picture_is_named():
    one = network()
    with pytest.raises(RankDeficient, match=r"no image point depends on right\.f_mm") as refused:
        adjust(one.select(one.view == 0), tied())
    assert refused.value.parameters == tied().names[17:]


def test_unknowns_that_nothing_tells_apart_are_named():
    plane = SMALL * [1.0, 1.0, 0.0]
    views = tuple(replace(view, b=(0.0,) * 9) for view in TRUE)
    free = [name for name in tied().names if ".b" not in name]
    with pytest.raises(RankDeficient, match=r"do not determine .*left\.f_mm") as refused:
        adjust(network(views, plane, seed=None), Unknowns.of(views, free))
    assert set(refused.value.parameters) <= set(free)


@pytest.mark.parametrize("seed", range(4))
def test_the_covariance_is_symmetric_to_the_last_digit_however_hard_parameters_are_told_apart(seed):
    flat = SMALL * [1.0, 1.0, 0.4]
    adjusted = adjust(network(places=flat, seed=seed, start=TRUE), tied())
    assert np.array_equal(adjusted.covariance, adjusted.covariance.T)
    assert np.array_equal(adjusted.parameter_covariance, adjusted.parameter_covariance.T)


@pytest.mark.parametrize("seed", range(4))
def test_where_rounding_hides_the_rest_of_the_way_it_has_converged(seed):
    """Asked for more than doubles have, it ends where no step lowers the sum any longer."""
    one = network(seed=seed, start=rough(seed=seed))
    to_the_end = adjust(one, tied(), AdjustmentSettings(settled=0.0))
    usual = adjust(one, tied())
    sigma = np.sqrt(np.diag(usual.covariance))
    assert np.abs((to_the_end.values - usual.values) / sigma).max() < 1e-2
