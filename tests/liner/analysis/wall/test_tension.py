"""Tension: what the law makes of the stretches, pre-tension and all."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd_liner.analysis.wall.material import Zone, mixed_tension, pre_stretch, wall_at
from grabberd_liner.analysis.wall.strain import middle_forms, principal_values
from liner.analysis.shapes import sheet
from liner.analysis.wall.test_material import rubber

U, V = np.linspace(0.0, 30.0, 4), np.linspace(-12.0, 12.0, 4)
STRETCHES = st.floats(0.8, 1.3)


def principal_tension(forms, before, wall):
    """(N, 2) principal values in N/m."""
    return principal_values(1e3 * mixed_tension(forms.first, before.first, wall))


def stretched(material, along, around):
    forms, before = (
        middle_forms(sheet(U, V, *by), material.depth_mm) for by in ((along, around), (1.0, 1.0))
    )
    return principal_tension(forms, before, wall_at([Zone(0.0, 30.0, material)], U))


@settings(max_examples=50, deadline=None)
@given(STRETCHES, STRETCHES)
def test_the_neo_hookean_law_is_the_field_s_formula(along, around):
    """T1 = µ t λ3 (λ1² − λ3²)."""
    thin = 1 / (along * around)
    expected = sorted(
        (1e3 * 2.5 * thin * (stretch**2 - thin**2) for stretch in (along, around)), reverse=True
    )
    values = stretched(rubber(F0_n=0.0), along, around)
    assert values == pytest.approx(np.tile(expected, (4, 1)), abs=1e-8)


@settings(max_examples=50, deadline=None)
@given(STRETCHES, STRETCHES)
def test_the_linear_law_is_the_field_s_formula(along, around):
    """T1 = E t / (1 − ν²) (ε1 + ν ε2)."""
    one, other = max(along, around) - 1, min(along, around) - 1
    scale = 1e3 * 3.0 * 2.5 / (1 - 0.09)
    values = stretched(rubber(F0_n=0.0, law="linear", poisson=0.3), along, around)
    assert values == pytest.approx(
        np.tile([scale * (one + 0.3 * other), scale * (other + 0.3 * one)], (4, 1))
    )


@pytest.mark.parametrize("law", ["neo_hookean", "linear"])
def test_unmoved_the_wall_carries_the_mounting_force_along_and_nothing_round(law):
    result = stretched(rubber(law=law), 1.0, 1.0)
    assert result == pytest.approx(np.tile([1e3 * 60 / (2 * np.pi * 12.5), 0.0], (4, 1)), abs=1e-9)


def test_pre_tension_composes_as_a_stretch():
    """Stretching the mounted wall further is stretching the free wall by the product."""
    along, across = pre_stretch(rubber())
    thin = 1 / (along * across)
    free = rubber(F0_n=0.0, wall_mm=2.5 / thin)
    mounted = stretched(rubber(), 1.05, 0.98)
    assert stretched(free, 1.05 * along, 0.98 * across) == pytest.approx(mounted)


def test_small_strains_give_the_same_tension_by_both_laws():
    both = [stretched(rubber(F0_n=0.0, law=law), 1 + 2e-5, 1 + 1e-5) for law in ("neo_hookean", "linear")]
    assert both[0] == pytest.approx(both[1], rel=1e-3)
