"""The calibration report as one JSON document: everything the calibration rests on.

Data of the calibration report's figures: σ over the volume, distortion, local fields, imaging geometry.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.calibration.adjustment.adjustment import Adjustment
from grabberd.core.calibration.identification.frame_identification import ViewIdentification
from grabberd.core.calibration.residuals import Blunder
from grabberd.core.calibration.rig_quantities import base_mm, convergence_deg, distance_mm
from grabberd.core.calibration.validity import Calibrated, validity_document
from grabberd.core.calibration.validity import Volume as ValidityVolume
from grabberd.core.chain.calibration.acceptance.verdict import Acceptance, acceptance_document, judge
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.geometry import PARAMETERS, LocalField, LocalFields, Rig, View, image, rays
from grabberd.core.geometry.document_reader import finite

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


def volume_of(result: CalibrateResult) -> ValidityVolume:
    """The volume of the targets, with one field's pointing σ."""
    places = result.volume.xyz_mm.reshape(-1, 3)
    return ValidityVolume(places.min(axis=0), places.max(axis=0), result.pointing_px)


def validity_of(result: CalibrateResult) -> dict[str, Any]:
    """The calibration's validity, with the local fields that points are measured with."""
    correlation = result.local.both.correlation if result.local else (0.0, 0.0)
    fields = LocalFields(*result.local_fields, correlation)
    calibrated = Calibrated(result.views, result.final.parameter_covariance, fields, result.nominal.lines)
    return validity_document(calibrated, volume_of(result))


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


def numbers(values: Array) -> list[Any]:
    """The rows of a table (N, M)."""
    return [[finite(value) for value in row] for row in values]


def by_axis(before: str, after: str, values: Iterable[float]) -> dict[str, float | None]:
    """Two or three values by the names of their axes, such as dx_px and dy_px."""
    return {f"{before}{axis}{after}": finite(value) for axis, value in zip(AXES, values, strict=False)}


SCHEMA = "grabberd/calibration-report/1"
UNITS = {"mm": "mm", "px": "px", "rad": "rad"}
DISTORTION_UNITS = ("1", "1", "mm⁻²", "mm⁻⁴", "mm⁻⁶", "mm⁻¹", "mm⁻¹", "mm⁻²", "mm⁻²")


def report_document(
    result: CalibrateResult, about: Mapping[str, Any], acceptance: Acceptance | None = None
) -> dict[str, Any]:
    """The document.

    Args:
        result: result of `calibrate`.
        about: origin of the calibration: id, created_utc, version, capture, glass, note,
            certificate, temperature_C and fields (their number); missing keys become null. other_captures:
            ids of the captures of the further poses.
        acceptance: its verdict; None: judged here, without a previous calibration or a check length.
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
        "result": {
            **_result(adjustment),
            "unmodelled_px": result.unmodelled_px,
            "poses": _poses(result, about.get("other_captures", ())),
        },
        "views": [_view(result, index) for index in range(len(adjustment.views))],
        "unknowns": {
            "names": list(adjustment.unknowns.names),
            "correlation": numbers(adjustment.correlation),
        },
        "comparison": [_difference(one) for one in result.differences],
        "tests": [_test(one) for one in result.elimination.tests] if result.elimination else [],
        "dropped": list(result.elimination.dropped) if result.elimination else [],
        "residuals": _residuals(result),
        "blunders": [_blunder(result, one) for one in result.blunders],
        "normality": [_normality(one) for one in result.normality],
        "validation": _validation(result),
        "volume": volume_document(result),
        "validity": validity_of(result),
        "distortion": [distortion_document(view, result.nominal.lines) for view in result.views],
        "local_field": local_field_document(result),
        "geometry": geometry_document(result),
        "acceptance": acceptance_document(acceptance or judge(result)),
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
    def of_each(value: Callable[[ViewIdentification], Any]) -> dict[str, Any]:
        return {
            name: value(side) for name, side in zip(("left", "right"), result.identification, strict=True)
        }

    return {
        "handedness": of_each(lambda side: side.view.handedness),
        "turn_deg": result.identification.orientation.turn_deg,
        "rms_px": of_each(lambda side: finite(side.rms_px)),
        "runner_up_rms_px": of_each(lambda side: finite(side.runner_up_rms_px)),
        "runner_up_found": of_each(lambda side: side.runner_up_targets),
        "margin": of_each(lambda side: finite(side.margin)),
        "found": of_each(lambda side: int((side.target >= 0).sum())),
        "of": len(result.frame),
        "unmatched_blobs": of_each(lambda side: len(side.unmatched)),
        "description": of_each(lambda side: side.description),
    }


def _poses(result: CalibrateResult, captures: Sequence[str]) -> list[dict[str, Any]]:
    return [
        {
            "capture": capture,
            "turn_deg": pose.turn_deg,
            **by_axis("", "_mm", pose.values[3:]),
            **by_axis("sigma_", "_mm", pose.sigma[3:]),
            "image_points": pose.count,
            "tau": pose.tau,
        }
        for pose, capture in zip_longest(result.poses, captures)
    ]


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
    """Parameters of the functional model; those adjusted along with a local field are in the calibration."""
    view, unknowns = result.adjustment.views[index], result.adjustment.unknowns
    sigma = np.sqrt(np.diag(result.adjustment.parameter_covariance)).reshape(len(result.views), -1)[index]
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
        "sigma": finite(one.sigma),
        "statistic": finite(one.z),
        "p": finite(one.p),
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
                **by_axis("", "_px", network.xy_px[index]),
                **by_axis("d", "_px", adjustment.residual_px[index]),
                **by_axis("sigma_", "_px", network.sigma_px[index]),
                **by_axis("redundancy_", "", adjustment.redundancy[index]),
                **by_axis("tau_", "", adjustment.standardised[index]),
            }
        )
    return rows


def _fields_of(result: CalibrateResult) -> dict[tuple[int, int], int]:
    return {
        (view, int(target)): int(count)
        for view, (side, images) in enumerate(zip(result.identification, result.images, strict=True))
        for target, count in zip(side.target, images.fields, strict=True)
    }


def _blunder(result: CalibrateResult, one: Blunder) -> dict[str, Any]:
    """A blunder by its worse coordinate; both coordinates were left out."""
    worse = int(np.argmax(np.abs(one.residual_px) / np.sqrt(one.redundancy)))
    return {
        "view": one.view,
        "target": int(result.frame.target[one.target]),
        **by_axis("", "_px", one.xy_px),
        "axis": AXES[worse],
        "residual_px": one.residual_px[worse],
        "tau": one.tau,
        "critical": one.critical,
    }


def _normality(one: Any) -> dict[str, Any]:
    return {
        "view": "both" if one.of == "all" else one.of,
        "count": one.count,
        "skewness": finite(one.skewness),
        "excess_kurtosis": finite(one.kurtosis),
        "test": "Jarque–Bera, finite sample",
        "statistic": finite(one.statistic),
        "p": finite(one.p),
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
            **by_axis("", "_mm", places[index]),
            **by_axis("d", "_mm", held.error_mm[index]),
            **by_axis("sigma_", "_mm", sigma[index]),
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
