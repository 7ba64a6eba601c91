"""An analysis: every part of it against the simulated liner's own truth, and what it says where it cannot."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from core.chain.milking import (
    CLOSED_S,
    FAKE,
    MATERIAL,
    PERIOD_S,
    analysed,
    changed,
    field,
    grid,
    still,
    truth,
    whole,
)
from grabberd.errors import AnalysisError, InputError

MOST = 2.0
"""Of a root mean square by σ: the places share points, so that it scatters more than 35 numbers would."""


def states():
    """(state, truth) of every seventh field."""
    found = whole()
    moments = [one.timed.time_s for one in found.fields]
    return [(state, truth(moment)) for state, moment in zip(found.states[::7], moments[::7], strict=True)]


def rms(estimate, true, use=slice(None)):
    """Of the errors by their σ."""
    return np.sqrt(np.nanmean(((estimate.value - true) / estimate.sigma)[use] ** 2))


def descending(tensors):
    return np.linalg.eigvalsh(tensors)[:, ::-1]


def test_curvature_is_the_middle_surfaces_within_its_sigma() -> None:
    for state, true in states():
        assert rms(state.curvature_per_m, descending(true.curvature_per_m)) < MOST


def test_strain_is_the_middle_surfaces_to_two_thousandths_where_the_wall_is_smooth() -> None:
    smooth = [(state, true) for state, true in states() if np.abs(true.stretch - 1).max() < 1e-3]
    assert len(smooth) > 2
    for state, true in smooth:
        assert np.sqrt(np.mean((state.strain.value - (true.stretch - 1)) ** 2)) < 0.002


def test_strain_is_the_middle_surfaces_within_its_sigma() -> None:
    for state, true in states():
        assert rms(state.strain, true.stretch - 1) < 2.5


def test_tension_is_the_walls_within_its_sigma() -> None:
    for state, true in states():
        assert rms(state.tension_n_per_m, descending(true.tension_n_per_m)) < MOST


def test_the_cycle_is_that_of_the_liner() -> None:
    cycle = whole().cycle
    assert abs(cycle.pulsation.period_s - PERIOD_S) < 4 * cycle.pulsation.period_sigma_s < 0.004
    assert cycle.wall is not None
    assert cycle.vacuum is not None
    assert cycle.average is not None
    assert len(whole().phases) == 4


def test_the_vacuum_of_fields_and_phases_is_read_at_their_own_times() -> None:
    found = whole()
    for one, vacuum in zip(found.fields, found.vacuum, strict=True):
        assert_allclose(vacuum.pulsation_kpa, truth(one.timed.time_s).pulsation_kpa, atol=0.01)
    start_s = found.cycle.pulsation.runs[0].start_s
    for phase, vacuum in zip(found.phase, found.phase_vacuum, strict=True):
        at_s = start_s + (phase + 1) * PERIOD_S
        assert_allclose(vacuum.pulsation_kpa, truth(at_s).pulsation_kpa, atol=0.5)


def test_gaps_of_the_capture_are_named_and_not_filled() -> None:
    found = whole()
    assert "2 fields are missing and were not filled in: 2 after field 19" in found.problems[0]
    assert len(found.states) == 50


def test_progress_is_told_state_by_state() -> None:
    told = []
    analysed(still(3), progress=lambda done, of: told.append((done, of)))
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_without_inputs_there_is_the_shape_and_what_lacks_is_said() -> None:
    found = analysed(still(3))
    assert [state.strain for state in found.states] == [None] * 3
    assert [state.pressure for state in found.states] == [None] * 3
    assert all(np.isfinite(state.curvature_per_m.value).all() for state in found.states)
    assert {words.split(":")[0] for words in found.inputs.lacks} == {
        "reference",
        "material",
        "vacuum.pulsation",
        "vacuum.liner",
        "plane",
        "flow_stop",
    }


def test_a_wall_that_rests_has_no_pulsation_and_says_so() -> None:
    found = analysed(still(12))
    assert (found.cycle, len(found.phases)) == (None, 0)
    assert len(found.problems) == 1


def test_strain_counts_from_the_field_that_is_named() -> None:
    found = analysed(still(3), reference={"field": 1})
    sigma = found.states[1].strain.sigma
    assert np.nanmax(np.abs(found.states[1].strain.value) / np.maximum(sigma, 1e-6)) < 5
    with pytest.raises(InputError, match="field 7 has no points"):
        analysed(still(3), reference={"field": 7})


def test_without_a_pulsation_strain_from_a_phase_is_left_out_and_the_rest_is_there() -> None:
    found = analysed(still(3), reference={"phase": 0.4}, material=MATERIAL)
    assert [state.strain for state in found.states] == [None] * 3
    assert all(np.isfinite(state.curvature_per_m.value).all() for state in found.states)
    assert any("phase 0.4 of the mean cycle does not exist" in problem for problem in found.problems)


def test_without_a_pulsation_a_vacuum_whose_clock_it_would_give_is_left_out() -> None:
    wave = {"rate_per_min": 60, "ratio": 0.6, "system_kpa": 42, "a_s": 0.1, "c_s": 0.1, "sigma_kpa": 0.5}
    lag = {"opening_s": 0.004, "closing_s": -0.003, "sigma_s": 0.005, "near_s": 0.0}
    vacuum = {"pulsation": wave, "liner": {"kpa": 42, "sigma_kpa": 0.5}, "lag": lag}
    found = analysed(still(3), reference="nominal", material=MATERIAL, vacuum=vacuum, sought_kpa=1.0)
    assert found.source is None
    assert all(state.strain is not None for state in found.states)
    assert any(problem.startswith("no pressure: vacuum.lag") for problem in found.problems)


def test_a_hole_stays_a_hole() -> None:
    hole = (grid().row >= 2) & (grid().row <= 4) & (grid().column >= 1)
    found = analysed([changed(one, keep=~hole) for one in still(3)], reference="nominal", material=MATERIAL)
    inside = hole & (grid().row == 3) & (grid().column >= 2)
    for state in found.states:
        for estimate in (state.xyz_mm, state.curvature_per_m, state.strain, state.tension_n_per_m):
            assert np.isnan(estimate.value[inside]).all()
        assert state.area.covered < 0.9


def test_targets_that_have_changed_their_ids_are_left_out_by_name() -> None:
    fields = still(8)
    target = fields[5].timed.points.target.copy()
    target[[11, 22]] = target[[22, 11]]
    found = analysed([*fields[:5], changed(fields[5], target=target), *fields[6:]])
    named = [words for words in found.problems if words.startswith("field 5: ")]
    assert len(named) == 1
    assert "targets 12, 23" in named[0]
    assert_allclose(found.states[5].xyz_mm.value, found.states[4].xyz_mm.value, atol=0.3)


def test_folded_points_are_no_surface() -> None:
    fields = still(3)
    places = fields[1].timed.points.xyz_mm.copy()
    turned = grid().row >= 3
    places[turned, 0] = 2 * places[grid().row == 3, 0].mean() - places[turned, 0]
    found = analysed([fields[0], changed(fields[1], places=places), fields[2]])
    named = [words for words in found.problems if words.startswith("field 1: ")]
    assert named or 1 not in [one.n for one in found.fields]


def test_a_field_with_too_few_points_is_left_out_by_name() -> None:
    fields = still(4)
    few = changed(fields[2], keep=np.arange(35) < 4)
    found = analysed([*fields[:2], few, fields[3]])
    assert [one.n for one in found.fields] == [0, 1, 3]
    assert any(words.startswith("field 2: ") for words in found.problems)


def test_points_of_another_object_are_refused() -> None:
    fields = still(3)
    target = fields[1].timed.points.target + 1000
    with pytest.raises(AnalysisError, match="targets that the object model does not"):
        analysed([fields[0], changed(fields[1], target=target), fields[2]])


def test_a_capture_without_points_is_refused() -> None:
    with pytest.raises(AnalysisError, match="no points"):
        analysed([])
    with pytest.raises(AnalysisError, match="no points"):
        analysed([changed(one, keep=np.zeros(35, bool)) for one in still(3)])


def test_when_no_field_has_a_surface_the_commonest_reason_is_said() -> None:
    with pytest.raises(AnalysisError):
        analysed([changed(one, keep=np.arange(35) < 3) for one in still(3)])


def test_closed_and_open_are_told_apart_in_everything() -> None:
    opened, closed = (
        analysed([field(0, moment), field(1, moment), field(2, moment)], plane="symmetry")
        for moment in (0.2, CLOSED_S)
    )
    shift = opened.states[0].sections[1].distance_mm.value - closed.states[0].sections[1].distance_mm.value
    assert abs(shift - FAKE.ellipse.deflection_mm) < 0.1
