"""Strain straight from the targets, per triangle and per edge, with σ."""

import numpy as np
import pytest

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.wall.strain import (
    edge_strain,
    nominal_places,
    outer_places,
    triangle_strain,
)
from liner.analysis.collapsing import grid
from liner.analysis.shapes import cylinder, sheet

SIGMA_MM = 0.02


def points(xyz, sigma=SIGMA_MM, target=None):
    n = len(xyz)
    target = grid().target if target is None else target
    covariance = np.tile(np.eye(3) * sigma**2, (n, 1, 1))
    return Points(target, xyz, covariance, np.zeros((n, 3, 3)), np.zeros((n, 2, 2)), np.zeros(n))


def measured(xyz, **other):
    return outer_places(grid(), points(xyz, **other))


def test_what_only_moved_has_no_strain():
    turned = grid().nominal_mm @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]).T + [5, 6, 7]
    result = triangle_strain(grid(), measured(turned), nominal_places(grid()))
    assert result.stretch.value == pytest.approx(np.ones((len(grid().triangles), 2)))
    assert edge_strain(grid(), measured(turned), nominal_places(grid())).stretch.value == pytest.approx(1.0)


def test_a_stretch_along_the_rows_has_its_size():
    result = triangle_strain(grid(), measured(grid().nominal_mm * [1.1, 1, 1]), nominal_places(grid()))
    assert result.stretch.value == pytest.approx(np.tile([1.1, 1.0], (len(result.triangle), 1)))


def test_bending_counts_as_the_outer_face_shows_it():
    """The open liner against the same wall laid flat: its face is a tenth longer than its middle."""
    flat, tube = (
        nominal_places(grid())._replace(xyz_mm=jets[:, 0])
        for jets in (
            sheet(grid().u_mm, 12.5 / 13.75 * grid().v_mm),
            cylinder(13.75, grid().u_mm, grid().v_mm),
        )
    )
    chord = np.sin(6.5 / 25) / (6.5 / 25)
    assert edge_strain(grid(), tube, flat).stretch.value.max() == pytest.approx(1.1 * chord, rel=1e-2)


def test_triangles_and_edges_of_a_missing_target_are_left_out():
    kept = np.arange(108) != 50
    places = measured(grid().nominal_mm[kept], target=grid().target[kept])
    result = triangle_strain(grid(), places, nominal_places(grid()))
    assert len(grid().triangles) - len(result.triangle) == (grid().triangles == 50).any(axis=1).sum() == 6
    assert not (edge_strain(grid(), places, nominal_places(grid())).edge == 50).any()


def test_a_reference_that_shares_no_neighbours_is_refused():
    kept = np.arange(108) < 2
    before = measured(grid().nominal_mm[~kept], target=grid().target[~kept])
    with pytest.raises(AnalysisError, match="share 0 targets"):
        edge_strain(grid(), measured(grid().nominal_mm[kept], target=grid().target[kept]), before)


def test_sigmas_are_those_that_repetition_shows():
    rng = np.random.default_rng(4)
    stretched = grid().nominal_mm * [1.05, 1.0, 1.0]
    before = measured(grid().nominal_mm, sigma=0.01)
    values, edges = [], []
    for _ in range(100):
        now = measured(stretched + rng.normal(size=(108, 3)) * SIGMA_MM)
        then = before._replace(xyz_mm=grid().nominal_mm + rng.normal(size=(108, 3)) * 0.01)
        values.append(triangle_strain(grid(), now, then))
        edges.append(edge_strain(grid(), now, then).stretch.value)
    expected = triangle_strain(grid(), measured(stretched), before)
    seen = np.std([result.stretch.value for result in values], axis=0)
    assert np.median(seen / expected.stretch.sigma) == pytest.approx(1.0, abs=0.05)
    edge = edge_strain(grid(), measured(stretched), before)
    assert np.median(np.std(edges, axis=0) / edge.stretch.sigma) == pytest.approx(1.0, abs=0.05)
