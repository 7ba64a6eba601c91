"""The load over height: against walls that were solved as solids, with σ of heights and of their sums."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from grabberd_fake.wall_states import Patch
from grabberd_liner.analysis.load.load_fit import Response, posterior
from grabberd_liner.analysis.load.load_profile import profile_heights
from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.wall_model import Difference, LoadPrior, TubePrior, WallModel
from liner.analysis.load.profiles import DIFFERENCES_KPA, solved_profiles
from liner.analysis.walls import as_points, solved


@pytest.fixture(scope="module")
def closing():
    """Profiles of the reference liner closing on a round teat."""
    return solved_profiles("reference-round")


def true_compression_kpa(liner, outer_kpa, x_mm):
    """Mean contact pressure over the arc with targets."""
    nominal = liner.grid.nominal_mm
    end = np.arctan2(nominal[:, 1], nominal[:, 2]).max()
    contact = Patch(liner.states, x_mm, np.linspace(-end, end, 41)).values(
        liner.states.contact_kpa(outer_kpa)
    )
    return np.trapezoid(contact, axis=1) / (contact.shape[1] - 1)


def over_elements(profile, states):
    """Weights (E, H) that average a profile over the truth's elements of the tube, and which those are."""
    borders = states.x_mm[::2]
    weights = []
    for start, end in pairwise(borders):
        within = (profile.x_mm > start - 0.01) & (profile.x_mm < end + 0.01)
        if within.sum() == 3:
            simpson = np.zeros(len(profile.x_mm))
            simpson[within] = np.array([1.0, 4.0, 1.0]) * profile.length[within]
            weights.append(simpson / simpson.sum())
        else:
            weights.append(np.zeros(len(profile.x_mm)))
    weights = np.array(weights)
    known = weights.any(axis=1)
    return weights[known], known


def loads(profile, outer_kpa, states):
    """Force per height on the truth's elements: found with σ, and true."""
    weights, known = over_elements(profile, states)
    return profile.load_n_per_mm.summed(weights), states.force_n_per_mm(outer_kpa)[known]


def test_force_per_height_is_that_of_the_solved_wall_within_15_percent_where_it_presses(closing):
    states = solved("reference-round").states
    found, true = loads(closing[-1], DIFFERENCES_KPA[-1], states)
    pressed = true > 0.3
    assert pressed.sum() >= 3
    assert np.sqrt(np.mean((found.value[pressed] / true[pressed] - 1) ** 2)) < 0.15
    assert found.value[pressed].mean() == pytest.approx(true[pressed].mean(), rel=0.05)


def test_sigma_of_force_per_height_says_how_far_it_is_off(closing):
    states = solved("reference-round").states
    ratios = []
    for profile, kpa in zip(closing, DIFFERENCES_KPA, strict=True):
        found, true = loads(profile, kpa, states)
        ratios.append((found.value - true) / found.sigma)
    assert 0.2 < np.mean(np.square(ratios)) < 1.4


def test_compression_is_that_of_the_solved_wall_within_2_kpa(closing):
    liner = solved("reference-round")
    for profile, kpa in zip(closing, DIFFERENCES_KPA, strict=True):
        off = profile.compression_kpa.value - true_compression_kpa(liner, kpa, profile.x_mm)
        assert np.sqrt(np.mean(off**2)) < 2.2
        assert np.mean((off / profile.compression_kpa.estimate.sigma) ** 2) < 1.4


def test_the_force_of_the_whole_side_is_right_within_2_sigma(closing):
    states = solved("reference-round").states
    for profile, kpa in zip(closing, DIFFERENCES_KPA, strict=True):
        weights, known = over_elements(profile, states)
        lengths = np.diff(states.borders_mm(kpa))[known]
        total = profile.load_n_per_mm.summed(lengths @ weights)
        assert abs(total.value - states.force_n_per_mm(kpa)[known] @ lengths) < 2 * total.sigma


def test_errors_of_neighbouring_heights_go_together_and_sums_know_it(closing):
    for profile in closing:
        covariance = profile.load_n_per_mm.covariance
        assert np.allclose(covariance, covariance.T)
        assert np.linalg.eigvalsh(covariance).min() > -1e-12
        total = profile.load_n_per_mm.summed(np.ones(len(profile.x_mm)))
        assert total.sigma**2 == pytest.approx(covariance.sum())
        assert total.sigma > np.sqrt(np.diagonal(covariance).sum())


def test_sums_over_points_have_the_covariance_of_the_points():
    liner = solved("reference-round")
    mounting = Mounting.of(liner.grid, liner.zones()[0].material, None)
    wall = WallModel(mounting.half, mounting.targets, LoadPrior(), TubePrior(0.035, 0.02, 0.1))
    response = Response.of(wall, wall.start(Difference(5.0, 0.5)))
    sights = mounting.sights(liner.points(5.0, 0), liner.grid)
    found = posterior(response, sights, Difference(5.0, 0.5))
    basis = wall.half.grid.basis(np.linspace(-15.0, 15.0, 40), np.linspace(-60.0, 60.0, 40))
    weights = np.random.default_rng(0).normal(size=(3, 40))
    sums = found.contact_sums(basis, weights[np.newaxis])
    value, covariance = found.contact_kpa(basis)
    assert np.allclose(sums.value, weights @ value)
    assert np.allclose(sums.covariance, weights @ covariance @ weights.T)


def test_the_noise_of_sums_is_how_far_they_scatter_with_the_noise_of_the_points():
    liner = solved("reference-round")
    open_liner = as_points(liner.places_mm(0.0), np.full(3, 0.005))
    mounting = Mounting.of(liner.grid, liner.zones()[0].material, open_liner)
    wall = WallModel(mounting.half, mounting.targets, LoadPrior(), TubePrior(0.035, 0.02, 0.1))
    response = Response.of(wall, wall.start(Difference(5.0, 0.5)))
    sights = mounting.sights(liner.points(5.0, 0), liner.grid)
    found = posterior(response, sights, Difference(5.0, 0.5))
    basis = wall.half.grid.basis(np.linspace(-15.0, 15.0, 40), np.linspace(-60.0, 60.0, 40))
    weights = np.random.default_rng(0).normal(size=(1, 3, 40))
    nothing = response.followers(np.zeros((1, wall.count)))
    parts = found.noise_of_sums(basis, weights, nothing, mounting.shared_mm2)
    own, of_reference = (one[:-1, :-1] for one in parts)
    alone = mounting.sights(liner.points(5.0, 0), liner.grid, shared=False)
    for part, covariance in ((own, alone.covariance), (of_reference, sights.covariance - alone.covariance)):
        scattered = _scattered(found, basis, weights, covariance)
        assert np.diagonal(part) == pytest.approx(np.diagonal(scattered), rel=0.35)
        assert (np.diagonal(part) < np.diagonal(found.contact_sums(basis, weights).covariance)).all()


def _scattered(found, basis, weights, covariance, draws=200, share=1e-2):
    """Covariance of the sums, drawn: of a small part of the noise, since contact is not linear."""
    root = np.linalg.cholesky(covariance + 1e-12 * np.eye(len(covariance)))
    noise = np.random.default_rng(1).normal(size=(draws, len(covariance))) @ root.T * share
    moved = (replace(found.sights, value=found.sights.value + one) for one in noise)
    sums = [posterior(found.response, one, found.difference).contact_sums(basis, weights) for one in moved]
    return np.cov(np.array([one.value for one in sums]).T) / share**2


def test_the_gap_is_that_of_the_inner_faces(closing):
    liner = solved("reference-round")
    for profile, kpa in zip(closing, DIFFERENCES_KPA, strict=True):
        crest_mm, _ = Patch(liner.states, profile.x_mm, np.zeros(1)).surface(liner.states.outer_mm(kpa))
        outside_mm = 2 * crest_mm[:, 0, 2] - 2 * liner.design["wall_mm"]
        assert np.abs(profile.gap_mm.value - outside_mm).max() < 0.6
        assert (profile.gap_mm.sigma > 0).all()


def test_heights_reach_from_the_first_row_to_the_last():
    heights = profile_heights(np.array([-10.0, 3.0, 10.0]))
    assert heights[[0, -1]] == pytest.approx([-10.0, 10.0])
    assert np.diff(heights) == pytest.approx(20 / 6)


def test_a_section_that_the_wall_has_stretched_stands_for_more_of_the_tube(closing):
    profile = closing[-1]
    mounted_mm = profile.x_mm[-1] - profile.x_mm[0]
    spans_mm = profile.spans_within(profile.x_mm[0], profile.x_mm[-1])
    assert spans_mm.sum() == pytest.approx(mounted_mm, rel=0.02)
    assert spans_mm[5] / profile.length[5] == pytest.approx(profile.x_mm[1] - profile.x_mm[0])
