"""Tables of the strain of triangles and edges between targets, field by field."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis import (
    EdgeStrain,
    Estimate,
    Grid,
    Places,
    Surface,
    TriangleStrain,
    edge_strain,
    middle_places,
    nominal_middle_places,
    triangle_strain,
    wall_at,
)
from grabberd.errors import AnalysisError
from grabberd.processes.analysis.analyse import Analysis

Keys = Mapping[str, NDArray[Any]]
Array = NDArray[np.float64]


def strain_tables(analysis: Analysis, keys: Keys) -> dict[str, dict[str, Any]]:
    """Values of the tables `triangles` and `edges`.

    They have no rows without a reference state, nor for fields that share no targets with it.

    Args:
        analysis: Analysis of the capture.
        keys: (F,) key columns of the fields.
    """
    triangles, edges = _strains(analysis)
    grid = analysis.grid
    corners = grid.target[_joined([grid.triangles[one.triangle] for one in triangles.values()], (0, 3))]
    ends = grid.target[_joined([one.edge for one in edges.values()], (0, 2))]
    stretch = _estimate([one.stretch for one in triangles.values()], (0, 2))
    along = _estimate([one.stretch for one in edges.values()], (0,))
    return {
        "triangles": {
            **_keys(keys, {at: len(one.triangle) for at, one in triangles.items()}),
            **{f"target{k + 1}": corners[:, k] for k in range(3)},
            "stretch1": Estimate(stretch.value[:, 0], stretch.sigma[:, 0]),
            "stretch2": Estimate(stretch.value[:, 1], stretch.sigma[:, 1]),
            "face": np.repeat(_face(analysis), len(corners)),
        },
        "edges": {
            **_keys(keys, {at: len(one.edge) for at, one in edges.items()}),
            **{f"target{k + 1}": ends[:, k] for k in range(2)},
            "stretch": along,
            "face": np.repeat(_face(analysis), len(ends)),
        },
    }


def _strains(analysis: Analysis) -> tuple[dict[int, TriangleStrain], dict[int, EdgeStrain]]:
    """Strains of triangles and edges, by the index of the field among those analysed."""
    triangles: dict[int, TriangleStrain] = {}
    edges: dict[int, EdgeStrain] = {}
    if analysis.reference is None:
        return triangles, edges
    depth_mm, grid = _depth_mm(analysis), analysis.grid
    reference = _reference(grid, analysis.reference, depth_mm)
    for at, state in enumerate(analysis.states):
        places = middle_places(grid, state.surface, depth_mm)
        try:
            triangles[at] = triangle_strain(grid, places, reference)
            edges[at] = edge_strain(grid, places, reference)
        except AnalysisError:  # this field shares no targets with the reference state
            continue
    return triangles, edges


def _depth_mm(analysis: Analysis) -> Array:
    """(N,) depth below the targets' face at which strain is evaluated: half the wall if it is known."""
    grid, zones = analysis.grid, analysis.inputs.zones
    return wall_at(zones, grid.u_mm).depth_mm if zones else np.zeros(len(grid))


def _face(analysis: Analysis) -> str:
    return "middle" if analysis.inputs.zones else "outer"


def _reference(grid: Grid, reference: Surface | Array, depth_mm: Array) -> Places:
    if isinstance(reference, Surface):
        return middle_places(grid, reference, depth_mm)
    return nominal_middle_places(grid, reference, depth_mm)


def _keys(keys: Keys, counts: Mapping[int, int]) -> dict[str, NDArray[Any]]:
    at = np.repeat(np.array(list(counts), np.intp), list(counts.values()))
    return {name: values[at] for name, values in keys.items()}


def _joined(parts: list[NDArray[Any]], empty: tuple[int, ...]) -> NDArray[Any]:
    return np.concatenate(parts) if parts else np.empty(empty, np.intp)


def _estimate(parts: list[Estimate], empty: tuple[int, ...]) -> Estimate:
    if not parts:
        return Estimate(np.empty(empty), np.empty(empty))
    return Estimate(
        np.concatenate([one.value for one in parts]), np.concatenate([one.sigma for one in parts])
    )
