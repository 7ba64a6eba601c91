"""Tables of the strain of triangles and edges between targets, field by field."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis import Estimate
from grabberd_liner.chain.analysis.analyse import Analysis

Keys = Mapping[str, NDArray[Any]]
Array = NDArray[np.float64]


def strain_tables(analysis: Analysis, keys: Keys) -> dict[str, dict[str, Any]]:
    """Values of the tables `triangles` and `edges`.

    They have no rows without a reference state, nor for fields that share no targets with it.

    Args:
        analysis: Analysis of the capture.
        keys: (F,) key columns of the fields.
    """
    strains = {at: state.strains for at, state in enumerate(analysis.states) if state.strains}
    grid = analysis.grid
    corners = grid.target[_joined([grid.triangles[one.triangle] for one in strains.values()], (0, 3))]
    ends = grid.target[_joined([one.edge for one in strains.values()], (0, 2))]
    stretch = _estimate([one.triangle_stretch for one in strains.values()], (0, 2))
    along = _estimate([one.edge_stretch for one in strains.values()], (0,))
    return {
        "triangles": {
            **_keys(keys, {at: len(one.triangle) for at, one in strains.items()}),
            **{f"target{k + 1}": corners[:, k] for k in range(3)},
            "stretch1": Estimate(stretch.value[:, 0], stretch.sigma[:, 0]),
            "stretch2": Estimate(stretch.value[:, 1], stretch.sigma[:, 1]),
        },
        "edges": {
            **_keys(keys, {at: len(one.edge) for at, one in strains.items()}),
            **{f"target{k + 1}": ends[:, k] for k in range(2)},
            "stretch": along,
        },
    }


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
