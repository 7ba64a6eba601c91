"""Objects whose targets are others in every field: what there is of them, and why there is not more."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.chain.milking import CLOSED_S, CONSTANT, MATERIAL, OPEN_S, analysed, changed, field, grid, model
from grabberd.errors import AnalysisError
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.render.model_pictures import Modelling

MOMENTS_S = (OPEN_S, 0.4, CLOSED_S)


def renamed(one):
    """The same places, with ids given anew."""
    target = np.random.default_rng(one.n).permutation(grid().target)
    return changed(one, target=target)


@cache
def found():
    others = replace(grid(), homologous=False)
    inputs = read_inputs(
        {
            "reference": "nominal",
            "material": MATERIAL,
            "vacuum": CONSTANT,
            "sought_kpa": 1,
            "plane": "symmetry",
        },
        others,
    )
    return analyse([[renamed(field(n, time_s)) for n, time_s in enumerate(MOMENTS_S)]], others, inputs)


@cache
def followed():
    return analysed([field(n, time_s) for n, time_s in enumerate(MOMENTS_S)], plane="symmetry")


def test_every_field_has_its_surface_and_sections_as_if_the_targets_had_been_followed():
    assert len(found().states) == len(MOMENTS_S)
    for state, other in zip(found().states, followed().states, strict=True):
        assert len(state.sections) == 3
        for one, true in zip(state.sections, other.sections, strict=True):
            both = float(np.hypot(one.distance_mm.sigma, true.distance_mm.sigma))
            assert one.distance_mm.value == pytest.approx(float(true.distance_mm.value), abs=4 * both)
            assert both < 0.2


def test_curvature_is_that_of_the_outer_face():
    median = np.nanmedian(found().states[0].curvature_per_m.value[:, 0])
    assert median == pytest.approx(1e3 / 13.75, rel=0.03)


def test_there_is_no_strain_and_the_reason_is_said():
    for state in found().states:
        assert (state.strain, state.tension_n_per_m, state.pressure) == (None,) * 3
    assert (found().movement, found().cycle, found().reference, found().phases) == (None, None, None, ())
    (reason,) = found().inputs.lacks
    assert "other points of the wall in every field" in reason
    assert "no strain, tension, pressure" in reason


def test_the_tables_have_no_rows_of_strain():
    made = tables(found())
    assert (len(made["triangles"]), len(made["edges"])) == (0, 0)
    assert len(made["sections"]) == 9


def test_places_are_fixed_in_space_and_not_in_the_material():
    """Of a closed wall too: at the nominal heights, however the wall has been stretched."""
    for state in found().states:
        assert np.nanmax(np.abs(state.xyz_mm.value[:, 0] - grid().nominal_mm[:, 0])) < 1e-9


def test_their_model_is_not_drawn():
    with pytest.raises(AnalysisError, match="others in every field"):
        Modelling.of(replace(model(), homologous=False), [field(0).timed.points])
