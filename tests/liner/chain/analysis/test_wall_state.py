"""The wall at one field: only what was asked for, at places that data support."""

import numpy as np
from numpy.testing import assert_allclose

from core.chain.milking import CLOSED_S, FAKE, MATERIAL, changed, field, grid, inputs, still, truth
from grabberd_liner.analysis.surface.fitting import fit_surface
from grabberd_liner.analysis.surface.sections import symmetry_plane
from grabberd_liner.analysis.wall.strain import outer_places
from grabberd_liner.chain.analysis.wall_series import Smoothings
from grabberd_liner.chain.analysis.wall_state import Question, wall_states


def wall_state(points, question, smoothing):
    """The wall at one field."""
    surface = fit_surface(question.grid, points, smoothing)
    return wall_states([points], [surface], question, [None])[0]


def state(points, **question):
    smoothing = Smoothings.of(grid(), [points]).for_points(points)
    return wall_state(points, Question(grid(), **question), smoothing)


def test_a_question_without_anything_asks_for_the_shape() -> None:
    found = state(field(0, 0.2).timed.points)
    assert (found.strain, found.tension_n_per_m, found.pressure, found.volume_mm3) == (None,) * 4
    assert found.sections == ()
    assert found.within.all()


def test_curvature_is_of_the_outer_face_until_the_material_is_known() -> None:
    points = field(0, 0.2).timed.points
    outer, middle = state(points), state(points, zones=inputs(material=MATERIAL).zones)
    half_mm = MATERIAL["wall_mm"] / 2
    radius_mm = FAKE.ellipse.radius_mm
    assert_allclose(np.median(outer.curvature_per_m.value[:, 0]), 1e3 / (radius_mm + half_mm), rtol=0.02)
    assert_allclose(np.median(middle.curvature_per_m.value[:, 0]), 1e3 / radius_mm, rtol=0.02)


def test_places_are_those_of_the_targets() -> None:
    points = field(0, CLOSED_S).timed.points
    assert np.abs(state(points).xyz_mm.value - points.xyz_mm).max() < 0.2


def test_sections_out_of_the_walls_reach_are_problems_and_the_others_are_there() -> None:
    plane = symmetry_plane(grid())
    found = state(field(0, 0.2).timed.points, heights_mm=(-10.0, 10.0, 90.0), plane=plane)
    assert [section.x_mm for section in found.sections] == [-10.0, 10.0]
    assert len(found.problems) == 1
    assert "90" in found.problems[0]
    assert found.volume_mm3 is not None


def test_distances_count_from_the_plane() -> None:
    found = state(field(0, 0.2).timed.points, heights_mm=(0.0,), plane=symmetry_plane(grid()))
    (section,) = found.sections
    assert section.distance_mm is not None
    off_mm = section.distance_mm.value - FAKE.ellipse.radius_mm - 1.25
    assert abs(off_mm) < 5 * section.distance_mm.sigma < 0.1


def test_strain_of_the_reference_itself_is_nothing_and_its_sigma_counts() -> None:
    points = field(0, CLOSED_S).timed.points
    smoothing = Smoothings.of(grid(), [points]).for_points(points)
    first = fit_surface(grid(), points, smoothing)
    again = wall_state(points, Question(grid(), reference=first), smoothing)
    assert again.strain is not None
    assert_allclose(again.strain.value, 0, atol=1e-9)
    assert (again.strain.sigma > 0).all()


def test_tension_at_rest_is_the_mounting() -> None:
    zones = inputs(material=MATERIAL).zones
    reference = inputs(reference="nominal").reference
    assert reference is not None
    points = still(1)[0].timed.points
    smoothing = Smoothings.of(grid(), [points]).for_points(points)
    nominal = fit_surface(grid(), points, smoothing)
    found = wall_state(points, Question(grid(), zones=zones, reference=nominal), smoothing)
    assert found.tension_n_per_m is not None
    mounted = truth(0.2).tension_n_per_m[:, 0, 0]
    assert_allclose(found.tension_n_per_m.value[:, 0], mounted, rtol=1e-6)
    assert_allclose(found.tension_n_per_m.value[:, 1], 0, atol=1e-3)


def test_places_without_data_have_no_numbers() -> None:
    keep = grid().row < 4
    found = state(changed(field(0, 0.2), keep=keep).timed.points)
    beyond = grid().row > 5
    assert not found.within[beyond].any()
    assert np.isnan(found.xyz_mm.value[beyond]).all()
    assert np.isnan(found.curvature_per_m.sigma[beyond]).all()


def test_fields_looked_at_together_are_as_each_alone():
    zones, plane = inputs(material=MATERIAL).zones, symmetry_plane(grid())
    fields = [field(n, time_s).timed.points for n, time_s in enumerate((0.2, 0.4, CLOSED_S))]
    smoothing = Smoothings.of(grid(), fields).for_points(fields[1])
    first, *surfaces = (fit_surface(grid(), points, smoothing) for points in fields)
    places = outer_places(grid(), fields[0])
    question = Question(grid(), (-10.0, 10.0), plane, first, places, zones)
    together = wall_states(fields[1:], surfaces, question, [None, None])
    for state, points in zip(together, fields[1:], strict=True):
        alone = wall_state(points, question, smoothing)
        for name in ("xyz_mm", "curvature_per_m", "strain", "tension_n_per_m"):
            for one, other in zip(getattr(state, name), getattr(alone, name), strict=True):
                assert_allclose(one, other, rtol=1e-9, atol=1e-12)
        assert state.problems == alone.problems
