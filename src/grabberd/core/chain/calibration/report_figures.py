"""Data of the calibration report's figures: σ over the volume, distortion, local fields, imaging geometry."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.calibration import base_mm, convergence_deg, distance_mm
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.geometry import LocalField, Rig, View, image, rays
from grabberd.core.geometry.document_reader import finite

Array = NDArray[np.float64]

AXES = ("x", "y", "z")
GRID_PX = 20
"""Spacing of the nodes at which distortion and local fields are shown."""


def volume_document(result: CalibrateResult) -> dict[str, Any]:
    """The σ of X, Y, Z over the volume, plane by plane."""
    volume = result.volume
    grid = volume.xyz_mm
    calibration, total = volume.calibration_sigma_mm, volume.sigma_mm
    planes = [
        {
            "z_mm": float(grid[plane, 0, 0, 2]),
            "calibration": {axis: numbers(calibration[plane, :, :, k]) for k, axis in enumerate(AXES)},
            "total": {axis: numbers(total[plane, :, :, k]) for k, axis in enumerate(AXES)},
        }
        for plane in range(len(grid))
    ]
    return {
        "x_mm": grid[0, :, 0, 0].tolist(),
        "y_mm": grid[0, 0, :, 1].tolist(),
        "planes": planes,
        "pointing_px": list(result.pointing_px),
    }


def distortion_document(view: View, lines: int) -> dict[str, Any]:
    """Distortion of ideal points, in px, on a grid over a view's half of the picture."""
    columns, rows, xy_px = _nodes(view, lines)
    scale = np.array([view.pixel_x_mm, -view.pixel_y_mm])
    ideal = (xy_px - (view.x0_px, view.y0_px)) * scale
    added = image(Rig.of_views([view]), ideal.T[:, np.newaxis]).pixels[:, 0].T - xy_px
    return _grid(view.name, columns, rows, added)


def local_field_document(result: CalibrateResult) -> dict[str, Any] | None:
    """The trial of local fields with the accepted ones on the same grid; None if none was requested.

    Of several poses of the calibration frame, the views are those of the first.
    """
    trial = result.local
    if trial is None:
        return None
    views = result.views
    held_out = {
        view.name: {"without": float(one[0]), "with": float(one[1])}
        for view, one in zip(views, trial.held_out_px[: len(views)], strict=True)
    }
    grids = [
        _field_grid(view, field, result.nominal.lines)
        for view, field in zip(views, trial.fields[: len(views)], strict=True)
        if field is not None
    ]
    return {
        "accepted": trial.accepted,
        "held_out_rms_px": held_out,
        "gain": finite(trial.gain),
        "evidence": finite(trial.evidence),
        "length_px": {view.name: finite(trial.components.length_px) for view in views},
        "signal_px": {view.name: finite(trial.components.signal_px) for view in views},
        "grids": grids,
    }


def _field_grid(view: View, field: LocalField, lines: int) -> dict[str, Any]:
    columns, rows, xy_px = _nodes(view, lines)
    return _grid(view.name, columns, rows, field.at(xy_px))


def _nodes(view: View, lines: int) -> tuple[Array, Array, Array]:
    columns = np.linspace(view.first_column, view.end_column - 1, _count(view.end_column - view.first_column))
    rows = np.linspace(0, lines - 1, _count(lines))
    return columns, rows, np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)


def _count(pixels: int) -> int:
    return max(2, round(pixels / GRID_PX) + 1)


def _grid(name: str, columns: Array, rows: Array, shift_px: Array) -> dict[str, Any]:
    x, y = shift_px.reshape(len(rows), len(columns), 2).transpose(2, 0, 1)
    return {
        "view": name,
        "columns": columns.tolist(),
        "lines": rows.tolist(),
        "dx_px": numbers(x),
        "dy_px": numbers(y),
    }


def geometry_document(result: CalibrateResult) -> dict[str, Any]:
    """The virtual cameras with the rays of their halves' corners, and the targets (paper figure 7)."""
    views = result.views
    rig = Rig.of_views(views)
    centers, axes = rig.center_mm[:, :, 0], -rig.rotation[:, 2]
    base = centers[1] - centers[0]
    return {
        "cameras": [
            {
                "name": view.name,
                "center_mm": centers[index].tolist(),
                "axis": axes[index].tolist(),
                "corners": rays(view, _corners(view, result.nominal.lines))[1].tolist(),
            }
            for index, view in enumerate(views)
        ],
        "targets_mm": result.adjustment.xyz_mm.tolist(),
        "base_mm": base_mm(views),
        "distance_mm": distance_mm(views, result.frame.xyz_mm.mean(axis=0)),
        "convergence_deg": convergence_deg(views, result.nominal.lines),
        "planar_motion_mm": _planar_motion(rig, base),
    }


def _planar_motion(rig: Rig, base_mm: Array) -> float | None:
    """The base along the axis of the relative rotation: zero where each view has one mirror."""
    # With one mirror a view, the second camera is the first one rotated about the mirrors' common line, which
    # is a planar motion: any shift along the axis of that rotation is misalignment or calibration error.
    relative = rig.rotation[1] @ rig.rotation[0].T
    turned = np.array(
        [relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]]
    )
    length = float(np.linalg.norm(turned))
    return float(abs((rig.rotation[0] @ base_mm) @ turned) / length) if length > 1e-9 else None


def _corners(view: View, lines: int) -> Array:
    left, right = view.first_column - 0.5, view.end_column - 0.5
    top, bottom = -0.5, lines - 0.5
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def numbers(values: NDArray[np.float64]) -> list[Any]:
    """The rows of a table (N, M)."""
    return [[finite(value) for value in row] for row in values]


def by_axis(before: str, after: str, values: Iterable[float]) -> dict[str, float | None]:
    """Two or three values by the names of their axes, such as dx_px and dy_px."""
    return {f"{before}{axis}{after}": finite(value) for axis, value in zip(AXES, values, strict=False)}
