"""Everything that a calibration rests on as one JSON document, which its report is drawn from."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration import Adjustment, Blunder, ViewIdentification
from grabberd.geometry import PARAMETERS, LocalField, Rig, View, correct_all, directions_all, distortion
from grabberd.processes.calibrate import CalibrateResult

Array = NDArray[np.float64]

SCHEMA = "grabberd/calibration-report/1"
AXES = ("x", "y", "z")
UNITS = {"mm": "mm", "px": "px", "rad": "rad"}
DISTORTION_UNITS = ("1", "1", "mm⁻²", "mm⁻⁴", "mm⁻⁶", "mm⁻¹", "mm⁻¹", "mm⁻²", "mm⁻²")
GRID_PX = 20
"""Distortion and local field are shown at nodes so far apart."""


def report_document(result: CalibrateResult, about: Mapping[str, Any]) -> dict[str, Any]:
    """The document.

    Args:
        result: of `calibrate`.
        about: what the calibration knows of its origin: id, created_utc, version, capture, glass, note,
            certificate, temperature_C and fields (their number); anything that is missing is null.
    """
    adjustment = result.adjustment
    return {
        "schema": SCHEMA,
        "id": about["id"],
        "created_utc": about["created_utc"],
        "version": about.get("version"),
        "note": about.get("note"),
        "capture": about.get("capture"),
        "calibration_frame": _frame(result, about),
        "image": {"columns": result.nominal.columns, "lines": result.nominal.lines},
        "glass": about.get("glass"),
        "settings": _settings(result),
        "identification": _identification(result),
        "result": {**_result(adjustment), "unmodelled_px": result.unmodelled_px},
        "views": [_view(result, index) for index in range(len(adjustment.views))],
        "unknowns": {
            "names": list(adjustment.unknowns.names),
            "correlation": _numbers(adjustment.correlation),
        },
        "comparison": [_difference(one) for one in result.differences],
        "tests": [_test(one) for one in result.elimination.tests] if result.elimination else [],
        "dropped": list(result.elimination.dropped) if result.elimination else [],
        "residuals": _residuals(result),
        "blunders": [_blunder(result, one) for one in result.blunders],
        "normality": [_normality(one) for one in result.normality],
        "validation": _validation(result),
        "volume": _volume(result),
        "distortion": [_distortion(view, result.nominal.lines) for view in result.views],
        "local_field": _local_field(result),
        "geometry": _geometry(result),
        "warnings": list(result.warnings),
    }


def _frame(result: CalibrateResult, about: Mapping[str, Any]) -> dict[str, Any]:
    frame = result.frame
    return {
        "name": frame.name,
        "targets": len(frame),
        "sigma_mm": frame.sigma_mm,
        "target_diameter_mm": frame.target_diameter_mm,
        "certificate": about.get("certificate"),
        "temperature_C": about.get("temperature_C"),
    }


def _settings(result: CalibrateResult) -> dict[str, Any]:
    settings = result.settings
    return {
        "weights": "equal" if settings.equal_weights else "honest",
        "frame": "held" if settings.held else "weighted",
        "free": list(settings.free),
        "shared": list(settings.shared),
        "tied": settings.tied,
        "alpha": settings.alpha,
        "local_field": settings.local_field,
        "handedness": settings.handedness,
        "method": settings.location.method,
    }


def _identification(result: CalibrateResult) -> dict[str, Any]:
    sides = {"left": result.identification.left, "right": result.identification.right}

    def of_each(value: Any) -> dict[str, Any]:
        return {name: value(side) for name, side in sides.items()}

    def found(side: ViewIdentification) -> int:
        return int((side.target >= 0).sum())

    return {
        "handedness": of_each(lambda side: side.view.handedness),
        "rms_px": of_each(lambda side: _number(side.rms_px)),
        "runner_up_rms_px": of_each(lambda side: _number(side.runner_up_rms_px)),
        "found": of_each(found),
        "of": len(result.frame),
        "unmatched_blobs": of_each(lambda side: len(side.unmatched)),
        "description": of_each(lambda side: side.description),
    }


def _result(adjustment: Adjustment) -> dict[str, Any]:
    network = adjustment.network
    rms = {
        view.name: np.sqrt(np.mean(adjustment.residual_px[network.view == index] ** 2, axis=0))
        for index, view in enumerate(adjustment.views)
    }
    return {
        "sigma0": adjustment.sigma0,
        "sigma0_px": adjustment.sigma0_px,
        "freedom": adjustment.freedom,
        "steps": adjustment.steps,
        "image_points": len(network),
        "targets": len(np.unique(network.target)),
        "rms_px": {name: {"x": float(x), "y": float(y)} for name, (x, y) in rms.items()},
    }


def _view(result: CalibrateResult, index: int) -> dict[str, Any]:
    view, unknowns = result.views[index], result.adjustment.unknowns
    sigma = np.sqrt(np.diag(result.final.parameter_covariance)).reshape(len(result.views), -1)[index]
    dropped = set(result.elimination.dropped) if result.elimination else set()
    rows = []
    numbers = zip(PARAMETERS, view.vector(), sigma, unknowns.number[index], strict=True)
    for name, value, deviation, unknown in numbers:
        known = unknown >= 0
        rows.append(
            {
                "name": name,
                "unit": unit_of(name),
                "value": float(value),
                "sigma": float(deviation) if known else None,
                "state": "adjusted" if known else _held_or_dropped(view, name, dropped),
                "unknown": unknowns.names[unknown] if known else None,
            }
        )
    extent = {key: getattr(view, key) for key in ("name", "handedness", "first_column", "end_column")}
    return {**extent, "parameters": rows}


def _held_or_dropped(view: View, name: str, dropped: set[str]) -> str:
    candidates = {f"{view.name}.{name}", f"lens.{name}"}
    if name in {"b8", "b9"}:
        candidates |= {f"{view.name}.b8=b9", "lens.b8=b9"}
    return "dropped" if candidates & dropped else "held"


def unit_of(parameter: str) -> str:
    """The unit of one of `PARAMETERS`, for people."""
    if parameter.startswith("b"):
        return DISTORTION_UNITS[int(parameter[1:]) - 1]
    return UNITS[parameter.rpartition("_")[2]]


def _difference(one: Any) -> dict[str, Any]:
    return {
        "parameter": one.parameter,
        "unit": unit_of(one.parameter),
        "left": one.first,
        "right": one.second,
        "difference": one.difference,
        "sigma": _number(one.sigma),
        "statistic": _number(one.z),
        "p": _number(one.p),
    }


def _test(one: Any) -> dict[str, Any]:
    keys = ("round", "kind", "statistic", "q", "freedom", "p", "effect_px", "dropped")
    return {"parameters": list(one.parameters), **{key: getattr(one, key) for key in keys}}


def _residuals(result: CalibrateResult) -> list[dict[str, Any]]:
    adjustment, network = result.adjustment, result.adjustment.network
    fields = _fields_of(result)
    rows = []
    for index in range(len(network)):
        view, target = int(network.view[index]), int(network.target[index])
        rows.append(
            {
                "view": adjustment.views[view].name,
                "target": int(result.frame.target[target]),
                "fields": fields[view, target],
                **_pair("", "_px", network.xy_px[index]),
                **_pair("d", "_px", adjustment.residual_px[index]),
                **_pair("sigma_", "_px", network.sigma_px[index]),
                **_pair("redundancy_", "", adjustment.redundancy[index]),
                **_pair("tau_", "", adjustment.standardised[index]),
            }
        )
    return rows


def _fields_of(result: CalibrateResult) -> dict[tuple[int, int], int]:
    sides = (result.identification.left, result.identification.right)
    return {
        (view, int(target)): int(count)
        for view, (side, images) in enumerate(zip(sides, result.images, strict=True))
        for target, count in zip(side.target, images.fields, strict=True)
    }


def _blunder(result: CalibrateResult, one: Blunder) -> dict[str, Any]:
    """Its coordinate that stands out more; both were left out."""
    worse = int(np.argmax(np.abs(one.residual_px) / np.sqrt(one.redundancy)))
    return {
        "view": one.view,
        "target": int(result.frame.target[one.target]),
        **_pair("", "_px", one.xy_px),
        "axis": AXES[worse],
        "residual_px": one.residual_px[worse],
        "tau": one.tau,
        "critical": one.critical,
    }


def _normality(one: Any) -> dict[str, Any]:
    return {
        "view": "both" if one.of == "all" else one.of,
        "count": one.count,
        "skewness": _number(one.skewness),
        "excess_kurtosis": _number(one.kurtosis),
        "test": "Jarque–Bera, finite sample",
        "statistic": _number(one.statistic),
        "p": _number(one.p),
    }


def _validation(result: CalibrateResult) -> dict[str, Any] | None:
    held = result.validation
    if held is None:
        return None
    variance = np.einsum("nkk->nk", held.covariance_mm2)
    predicted = np.sqrt(np.append(variance.mean(axis=0), variance.mean(axis=0).sum()))
    places = result.frame.xyz_mm[held.target]
    sigma = np.sqrt(variance)
    points = [
        {
            "target": int(result.frame.target[target]),
            "block": int(block),
            **_triple("", "_mm", places[index]),
            **_triple("d", "_mm", held.error_mm[index]),
            **_triple("sigma_", "_mm", sigma[index]),
        }
        for index, (target, block) in enumerate(zip(held.target, held.block, strict=True))
    ]
    return {
        "blocks": int(held.block.max()) + 1,
        "rmse_mm": dict(zip((*AXES, "xyz"), held.rmse_mm.tolist(), strict=True)),
        "predicted_mm": dict(zip((*AXES, "xyz"), predicted.tolist(), strict=True)),
        "chi2": held.chi2,
        "freedom": held.freedom,
        "p": held.p,
        "points": points,
    }


def _volume(result: CalibrateResult) -> dict[str, Any]:
    volume = result.volume
    grid = volume.xyz_mm
    calibration, total = volume.calibration_sigma_mm, volume.sigma_mm
    planes = [
        {
            "z_mm": float(grid[plane, 0, 0, 2]),
            "calibration": {axis: _numbers(calibration[plane, :, :, k]) for k, axis in enumerate(AXES)},
            "total": {axis: _numbers(total[plane, :, :, k]) for k, axis in enumerate(AXES)},
        }
        for plane in range(len(grid))
    ]
    pointing = result.adjustment.sigma0 * np.sqrt(np.mean(result.adjustment.network.sigma_px**2, axis=0))
    return {
        "x_mm": grid[0, :, 0, 0].tolist(),
        "y_mm": grid[0, 0, :, 1].tolist(),
        "planes": planes,
        "pointing_px": pointing.tolist(),
    }


def _distortion(view: View, lines: int) -> dict[str, Any]:
    columns, rows, xy_px = _nodes(view, lines)
    scale = np.array([view.pixel_x_mm, -view.pixel_y_mm])
    added = distortion(view.b, (xy_px - (view.x0_px, view.y0_px)) * scale) / scale
    return _grid(view.name, columns, rows, added)


def _local_field(result: CalibrateResult) -> dict[str, Any] | None:
    trial = result.local
    if trial is None:
        return None
    views = result.views
    held_out = {
        view.name: {"without": float(one[0]), "with": float(one[1])}
        for view, one in zip(views, trial.held_out_px, strict=True)
    }
    grids = [
        _field_grid(view, field, result.nominal.lines)
        for view, field in zip(views, trial.fields, strict=True)
        if field is not None
    ]
    return {
        "accepted": trial.accepted,
        "held_out_rms_px": held_out,
        "gain": _number(trial.gain),
        "length_px": {view.name: _number(trial.components.length_px) for view in views},
        "signal_px": {view.name: _number(trial.components.signal_px) for view in views},
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
        "dx_px": _numbers(x),
        "dy_px": _numbers(y),
    }


def _geometry(result: CalibrateResult) -> dict[str, Any]:
    views = result.views
    rig = Rig.of_views(views)
    centers, axes = rig.center_mm[:, :, 0], -rig.rotation[:, 2]
    middles = [_rays(rig, index, _middle(view, result.nominal.lines))[0] for index, view in enumerate(views)]
    base = centers[1] - centers[0]
    return {
        "cameras": [
            {
                "name": view.name,
                "center_mm": centers[index].tolist(),
                "axis": axes[index].tolist(),
                "corners": _rays(rig, index, _corners(view, result.nominal.lines)).tolist(),
            }
            for index, view in enumerate(views)
        ],
        "targets_mm": result.adjustment.xyz_mm.tolist(),
        "base_mm": float(np.linalg.norm(base)),
        "distance_mm": float(np.linalg.norm(centers.mean(axis=0) - result.frame.xyz_mm.mean(axis=0))),
        "convergence_deg": math.degrees(math.acos(float(np.clip(middles[0] @ middles[1], -1, 1)))),
        "planar_motion_mm": _planar_motion(rig, base),
    }


def _planar_motion(rig: Rig, base_mm: Array) -> float | None:
    """The base along the axis of the relative rotation: zero where each view has one mirror."""
    relative = rig.rotation[1] @ rig.rotation[0].T
    turned = np.array(
        [relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]]
    )
    length = float(np.linalg.norm(turned))
    return float(abs((rig.rotation[0] @ base_mm) @ turned) / length) if length > 1e-9 else None


def _rays(rig: Rig, index: int, xy_px: Array) -> Array:
    """(N, 3) unit vectors of a view through frame pixels (N, 2)."""
    every = np.repeat(xy_px.T[:, np.newaxis], len(rig.views), axis=1)
    rays: Array = directions_all(rig, correct_all(rig, every))[index].T
    return rays


def _middle(view: View, lines: int) -> Array:
    return np.array([[0.5 * (view.first_column + view.end_column - 1), 0.5 * (lines - 1)]])


def _corners(view: View, lines: int) -> Array:
    left, right = view.first_column - 0.5, view.end_column - 0.5
    top, bottom = -0.5, lines - 0.5
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])


def _pair(before: str, after: str, values: Any) -> dict[str, float | None]:
    return {f"{before}{axis}{after}": _number(value) for axis, value in zip(AXES, values, strict=False)}


def _triple(before: str, after: str, values: Any) -> dict[str, float | None]:
    return _pair(before, after, values)


def _number(value: float) -> float | None:
    """What is not finite is null in JSON."""
    return float(value) if np.isfinite(value) else None


def _numbers(values: Array) -> list[Any]:
    return [[_number(value) for value in row] for row in values]
