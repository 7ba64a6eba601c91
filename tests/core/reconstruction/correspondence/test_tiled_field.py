import numpy as np
import pytest

from core.reconstruction.liners import model
from core.reconstruction.many import grid
from grabberd.core.reconstruction import Smoothness
from grabberd.core.reconstruction.correspondence.displacement_field import (
    MOST_AT_ONCE,
    PART,
    DisplacementField,
    TiledField,
    field_of,
)

MANY = grid(864)
SMOOTHNESS = Smoothness()
EXACT = DisplacementField.of(MANY.xyz_mm, SMOOTHNESS)
TILED = TiledField(MANY.xyz_mm, SMOOTHNESS)
RNG = np.random.default_rng(1)
MOVED = np.linalg.cholesky(np.linalg.inv(EXACT.precision)) @ RNG.normal(size=(864, 3))
SEEN = {
    "all": np.ones(864, bool),
    "most": RNG.random(864) < 0.9,
    "some": RNG.random(864) < 0.3,
    "those of one half": MANY.xyz_mm[:, 0] < 10,
}


def expect(field, seen):
    """All targets' displacements, from the true ones of those seen."""
    return field.expect(np.flatnonzero(seen), MOVED[seen])


def test_few_targets_are_one_field_and_many_are_parts():
    assert isinstance(field_of(model(), SMOOTHNESS, 6.5), DisplacementField)
    assert len(MANY) > MOST_AT_ONCE
    assert isinstance(field_of(MANY, SMOOTHNESS, 6.5), TiledField)


def test_every_target_is_in_one_part():
    own = [part.asked[: part.own] for part in TILED._parts]
    assert max(map(len, own)) <= PART
    assert np.array_equal(np.sort(np.concatenate(own)), np.arange(864))
    assert all(len(set(part.asked.tolist())) == len(part.asked) for part in TILED._parts)


@pytest.mark.parametrize("who", SEEN)
def test_parts_expect_of_those_who_are_seen_what_the_whole_does(who):
    seen = SEEN[who]
    whole, parts = (expect(field, seen) for field in (EXACT, TILED))
    off = (parts.displacement_mm - whole.displacement_mm)[seen] / whole.sigma_mm[seen, np.newaxis]
    assert np.sqrt((off**2).mean()) < 0.25
    ratio = parts.sigma_mm[seen] / whole.sigma_mm[seen]
    assert np.quantile(ratio, 0.95) < 1.1
    assert ratio.max() < 1.5


@pytest.mark.parametrize("who", SEEN)
def test_sigma_is_what_the_errors_are(who):
    seen = SEEN[who]
    expected = expect(TILED, seen)
    off = MOVED - expected.displacement_mm
    for group in (seen, ~seen):
        if group.sum() > 100:
            standardised = off[group] / np.hypot(expected.sigma_mm[group], SMOOTHNESS.noise_mm)[:, np.newaxis]
            assert 0.8 < np.sqrt((standardised**2).mean()) < 1.25


def test_nobody_is_more_sure_by_parts():
    for seen in SEEN.values():
        assert (expect(TILED, seen).sigma_mm >= expect(EXACT, seen).sigma_mm - 1e-9).all()


def test_when_nobody_is_seen_all_are_expected_at_their_nominal_places_with_the_prior_sigma():
    expected = expect(TILED, np.zeros(864, bool))
    assert not expected.displacement_mm.any()
    assert np.allclose(expected.sigma_mm, SMOOTHNESS.sigma_mm)


def test_what_was_asked_before_changes_no_bit_of_the_answer():
    for seen in [*SEEN.values(), *reversed(SEEN.values())]:
        found, fresh = (expect(one, seen) for one in (TILED, TiledField(MANY.xyz_mm, SMOOTHNESS)))
        np.testing.assert_array_equal(found.displacement_mm, fresh.displacement_mm)
        np.testing.assert_array_equal(found.sigma_mm, fresh.sigma_mm)
