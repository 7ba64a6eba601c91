"""Tension and bending moment of the simulated wall."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd_fake.ellipse_truth import moment, pre_stretch, tension
from grabberd_fake.options import FakeOptions


def liner(**material):
    return FakeOptions.read({"ellipse": {"material": material}}).ellipse


def metric(along, around, shear=0.0):
    deformation = np.array([[along, shear], [0.0, around]])
    return deformation.T @ deformation


def principal(force, present):
    """Physical components of a diagonal tensor."""
    return force[0, 0] * present[0, 0], force[1, 1] * present[1, 1]


stretches = st.floats(0.8, 1.3)


@given(stretches, stretches)
def test_free_neo_hookean_rubber_has_the_tension_of_its_formula(along: float, around: float) -> None:
    present = metric(along, around)
    thin = 1 / (along * around)
    wanted = [1.0 * 2.5 * thin * (stretch**2 - thin**2) for stretch in (along, around)]
    assert_allclose(
        principal(tension(liner(pretension_n=0), np.eye(2), present), present), wanted, atol=1e-12
    )


@given(st.floats(0, 300))
def test_mounted_it_carries_the_pretension_along_and_nothing_around(force_n: float) -> None:
    for law in ("neo_hookean", "linear"):
        force = tension(liner(pretension_n=force_n, law=law), np.eye(2), np.eye(2))
        assert force[0, 0] == pytest.approx(force_n / (2 * math.pi * 12.5), abs=1e-12)
        assert_allclose(force[1, 1], 0, atol=1e-12)


def test_pretension_composes_as_a_stretch() -> None:
    """Stretched further it is as if it had been stretched at once."""
    options = liner()
    pre, around = pre_stretch(options)
    assert around == pytest.approx(1 / math.sqrt(pre))
    assert pre == pytest.approx(1.10154, abs=1e-5)
    present = metric(1.1, 1 / math.sqrt(1.1))
    whole, wall_mm = pre * 1.1, 2.5 * math.sqrt(pre)
    wanted = wall_mm / math.sqrt(whole) * (whole**2 - 1 / whole)
    assert principal(tension(options, np.eye(2), present), present)[0] == pytest.approx(wanted)


@given(st.floats(-0.01, 0.01), st.floats(-0.01, 0.01))
def test_the_linear_law_is_hookes(along: float, around: float) -> None:
    options = liner(law="linear", poisson=0.3, pretension_n=0)
    present = metric(1 + along, 1 + around)
    force = tension(options, np.eye(2), present)
    stiffness = 3 * 2.5 / (1 - 0.09)
    assert_allclose(
        principal(force, present),
        [stiffness * (along + 0.3 * around), stiffness * (around + 0.3 * along)],
        atol=1e-12,
    )


@given(stretches, stretches, st.floats(-0.2, 0.2), st.floats(0, 6.3))
def test_turning_the_coordinates_turns_the_tension(
    along: float, around: float, shear: float, angle: float
) -> None:
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    present, options = metric(along, around, shear), liner(pretension_n=0)
    assert_allclose(
        tension(options, np.eye(2), turn.T @ present @ turn),
        turn.T @ tension(options, np.eye(2), present) @ turn,
        atol=1e-12,
    )


def test_both_laws_agree_for_small_strains() -> None:
    present = metric(1.001, 1.0005, 0.0004)
    forces = [
        tension(liner(law=law, pretension_n=0), np.eye(2), present) for law in ("linear", "neo_hookean")
    ]
    assert_allclose(forces[0], forces[1], rtol=1e-2)


def test_bending_a_strip_round_one_axis_needs_poissons_moment_round_the_other() -> None:
    bend = moment(liner(), np.eye(2), np.array([[0.0, 0.0], [0.0, 0.02]]))
    stiffness = 3 * 2.5**3 / 12 / 0.75
    assert_allclose(bend, stiffness * 0.02 * np.diag([0.5, 1.0]), atol=1e-12)


def test_rubber_of_the_neo_hookean_law_is_incompressible() -> None:
    with pytest.raises(ValueError, match="neo_hookean rubber is incompressible"):
        liner(poisson=0.4)
