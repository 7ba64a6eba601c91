"""Documents for the tests: one of a simulated calibration with every part, and the least there can be."""

from typing import Any

import numpy as np
from scipy import stats

from grabberd.core.calibration.validity import Calibrated, Volume, validity_document
from grabberd.core.geometry import PARAMETERS, LocalFields, project_all
from reports import simulated
from reports.simulated import BLUNDER, DROPPED, SIGMA_PX, Adjustment, Network, ObjectModel

UNITS = (
    *("mm", "px", "px", "rad", "rad", "rad", "mm", "mm", "mm"),
    *("1", "1", "mm⁻²", "mm⁻⁴", "mm⁻⁶", "mm⁻¹", "mm⁻¹", "mm⁻²", "mm⁻²"),
)
OPTIONAL = (
    *("capture", "calibration_frame", "image", "glass", "settings", "identification", "unknowns"),
    *("comparison", "tests", "dropped", "residuals", "blunders", "normality", "validation", "volume"),
    *("distortion", "local_field", "geometry", "acceptance"),
)
BLOCKS = 6
CRITICAL = 3.85


def least() -> dict[str, Any]:
    """What every report has, and nothing else."""
    return {
        "schema": "grabberd/calibration-report/1",
        "id": "least",
        "created_utc": "2026-01-02T03:04:05+00:00",
        "version": "grabberd 0",
        "result": {
            "sigma0": 1.25,
            "sigma0_px": 0.05,
            "freedom": 17,
            "steps": 4,
            "image_points": 30,
            "targets": 15,
            "rms_px": None,
        },
        "views": [_half("left", 0), _half("right", 360)],
        **dict.fromkeys(OPTIONAL),
    }


def full(seed: int = 3) -> dict[str, Any]:
    """A report with every part."""
    model = simulated.calibration_frame()
    network = simulated.network(model, seed)
    adjustment = simulated.adjusted(network)
    residuals = _residuals(adjustment, model)
    return {
        **least(),
        **_origin(model),
        "result": _result(adjustment),
        "views": [_view(adjustment, index) for index in range(2)],
        "unknowns": {
            "names": list(adjustment.unknowns.names),
            "correlation": simulated.correlation(adjustment).tolist(),
        },
        "comparison": _comparison(adjustment),
        "tests": _tests(adjustment),
        "dropped": list(DROPPED),
        "residuals": residuals,
        "blunders": [_blunder(row) for row in residuals if abs(row["tau_x"]) > CRITICAL],
        "normality": [_normality(residuals, view) for view in ("left", "right", "both")],
        "validation": _validation(network, model),
        "volume": _volume(adjustment),
        "validity": _validity(adjustment),
        "distortion": [simulated.distortion_field(view) for view in adjustment.views],
        "local_field": {
            "accepted": False,
            "held_out_rms_px": {
                "left": {"without": 0.061, "with": 0.064},
                "right": {"without": 0.059, "with": 0.0593},
            },
            "length_px": {"left": 95.0, "right": 110.0},
            "signal_px": {"left": 0.021, "right": 0.018},
            "grids": [simulated.ripple_field(view) for view in adjustment.views],
        },
        "geometry": _geometry(adjustment, model),
        "acceptance": _acceptance(),
    }


def _acceptance() -> dict[str, Any]:
    """Failed, by its check length, with a remark."""
    return {
        "verdict": "failed",
        "reasons": [
            {
                "code": "check_length",
                "level": "failed",
                "message": "the check length from target 1 to 108 comes out as 121.763 mm",
                "hint": "check the calibration frame's file",
                "values": {"first": 1, "second": 108, "mm": 2.37, "percent": 1.98},
            },
            {
                "code": "left_out",
                "level": "remark",
                "message": f"1 image point contradicts the others: {BLUNDER[0]} {BLUNDER[1]}",
                "hint": "measure this target's place anew",
                "values": {"n": 1, "ids": f"{BLUNDER[0]} {BLUNDER[1]}"},
            },
        ],
        "rig": [
            _compared("base", "", "mm", 128.0, None, 121.7),
            _compared("focal_length", "left", "mm", 8.0, 8.01, 7.7),
        ],
        "check_length": {
            "first": 1,
            "second": 108,
            "certified_mm": 119.397,
            "measured_mm": 121.763,
            "difference_mm": 2.366,
            "sigma_mm": 0.021,
        },
        "symmetries": ["its mirror image maps 84 of 108 targets onto targets"],
        "patterns": [{"view": "left", "correlation": 0.05, "statistic": 1.1}],
        "movement": {view: {"rms_px": 0.013, "drift_px": 0.004} for view in ("left", "right")},
    }


def _compared(
    quantity: str, view: str, unit: str, nominal: float, previous: float | None, found: float
) -> dict[str, Any]:
    return {
        "quantity": quantity,
        "view": view,
        "unit": unit,
        "nominal": nominal,
        "previous": previous,
        "found": found,
        "sigma": 0.01,
        "nominal_z": (found - nominal) / (0.05 * nominal),
        "previous_z": None if previous is None else (found - previous) / 0.014,
    }


def _half(name: str, first_column: int) -> dict[str, Any]:
    extent = {"first_column": first_column, "end_column": first_column + 360}
    return {"name": name, "handedness": 1, **extent, "parameters": []}


def _origin(model: ObjectModel) -> dict[str, Any]:
    return {
        "id": "20260102T030405Z-simulated",
        "version": "grabberd 0.1.0",
        "capture": {
            "id": "20260102T025900Z-simulated",
            "name": "morning",
            "device": "simulated",
            "started_utc": "2026-01-02T02:59:00+00:00",
            "fields": 64,
            "bits": 8,
            "lines": "field",
        },
        "calibration_frame": {
            "name": model.name,
            "targets": len(model),
            "sigma_mm": model.sigma_mm,
            "target_diameter_mm": model.target_diameter_mm,
            "temperature_C": 20.5,
            "certificate": {"number": "K-108/7", "issued": "2025-11-03", "laboratory": "a test"},
        },
        "image": {"columns": 720, "lines": 576},
        "settings": {
            "weights": "honest",
            "frame": "weighted",
            "shared": [],
            "tied": False,
            "alpha": 0.05,
            "method": "moments",
        },
        "identification": {
            "by": "lattice",
            "of": 108,
            "handedness": {"left": 1, "right": 1},
            "rms_px": {"left": 0.31, "right": 0.29},
            "runner_up_rms_px": {"left": 4.7, "right": 5.2},
            "found": {"left": 108, "right": 108},
            "unmatched_blobs": {"left": 0, "right": 2},
        },
    }


def _result(adjustment: Adjustment) -> dict[str, Any]:
    network = adjustment.network
    rms = {
        view.name: _axes("xy", np.sqrt((adjustment.residual_px[network.view == index] ** 2).mean(0)))
        for index, view in enumerate(network.views)
    }
    fit = {"sigma0": adjustment.sigma0, "sigma0_px": adjustment.sigma0_px, "freedom": adjustment.freedom}
    size = {"image_points": len(network), "targets": len(network.target_mm)}
    return {**fit, **size, "steps": adjustment.steps, "rms_px": rms}


def _view(adjustment: Adjustment, index: int) -> dict[str, Any]:
    view, number = adjustment.views[index], adjustment.unknowns.number[index]
    sigmas = np.sqrt(np.diag(adjustment.parameter_covariance)).reshape(2, -1)[index]
    parameters = [
        {
            "name": name,
            "unit": UNITS[place],
            "value": float(view.vector()[place]),
            "sigma": float(sigmas[place]) if number[place] >= 0 else None,
            "state": "adjusted" if number[place] >= 0 else "dropped",
            "unknown": f"{view.name}.{name}" if number[place] >= 0 else None,
        }
        for place, name in enumerate(PARAMETERS)
    ]
    return {**_half(view.name, view.first_column), "parameters": parameters}


def _comparison(adjustment: Adjustment) -> list[dict[str, Any]]:
    covariance, apart = adjustment.parameter_covariance, np.array([1.0, -1.0])
    left, right = (view.vector() for view in adjustment.views)
    rows = []
    for place in (0, 1, 2, *range(9, 18)):
        pair = [place, place + 18]
        if (variance := float(apart @ covariance[np.ix_(pair, pair)] @ apart)) > 0:
            sides = {"left": float(left[place]), "right": float(right[place])}
            difference, sigma = sides["left"] - sides["right"], variance**0.5
            p = float(2 * stats.t.sf(abs(difference / sigma), adjustment.freedom))
            tested = {"difference": difference, "sigma": sigma, "statistic": difference / sigma, "p": p}
            rows.append({"parameter": PARAMETERS[place], "unit": UNITS[place], **sides, **tested})
    return rows


def _tests(adjustment: Adjustment) -> list[dict[str, Any]]:
    """Two rounds that never were, then the single tests of what is left."""
    sigma, names = np.sqrt(np.diag(adjustment.covariance)), adjustment.unknowns.names
    rows = [_test(turn, name, 0.4 * turn, adjustment.freedom) for turn, name in enumerate(DROPPED, start=1)]
    for view in adjustment.views:
        for place, value in enumerate(view.b, start=1):
            if (name := f"{view.name}.b{place}") in names:
                statistic = float((value / sigma[names.index(name)]) ** 2)
                rows.append(_test(3, name, statistic, adjustment.freedom))
    return rows


def _test(turn: int, name: str, statistic: float, freedom: int) -> dict[str, Any]:
    p = float(stats.f.sf(statistic, 1, freedom))
    tested = {"statistic": statistic, "q": 1, "freedom": freedom, "p": p, "effect_px": 0.012 * statistic**0.5}
    return {"round": turn, "kind": "single", "parameters": [name], **tested, "dropped": name in DROPPED}


def _residuals(adjustment: Adjustment, model: ObjectModel) -> list[dict[str, Any]]:
    network, tau = adjustment.network, simulated.tau(adjustment)
    return [
        {
            "view": network.views[network.view[row]].name,
            "target": int(model.target[network.target[row]]),
            **_axes("xy", network.xy_px[row], "{}_px"),
            **_axes("xy", adjustment.residual_px[row], "d{}_px"),
            **_axes("xy", network.sigma_px[row], "sigma_{}_px"),
            **_axes("xy", adjustment.redundancy[row], "redundancy_{}"),
            **_axes("xy", tau[row], "tau_{}"),
            "fields": 64,
        }
        for row in range(len(network))
    ]


def _blunder(row: dict[str, Any]) -> dict[str, Any]:
    found = {"residual_px": row["dx_px"], "tau": row["tau_x"], "critical": CRITICAL}
    return {"view": row["view"], "target": row["target"], "axis": "x", **found}


def _normality(residuals: list[dict[str, Any]], view: str) -> dict[str, Any]:
    taus = [row[axis] for row in residuals if view in {row["view"], "both"} for axis in ("tau_x", "tau_y")]
    tested = stats.jarque_bera(taus)
    shape = {"skewness": float(stats.skew(taus)), "excess_kurtosis": float(stats.kurtosis(taus))}
    outcome = {"test": "Jarque–Bera", "statistic": float(tested.statistic), "p": float(tested.pvalue)}
    return {"view": view, "count": len(taus), **shape, **outcome}


def _validation(network: Network, model: ObjectModel) -> dict[str, Any]:
    blocks = np.minimum(model.row * BLOCKS // (int(model.row.max()) + 1), BLOCKS - 1)
    points = [point for block in range(BLOCKS) for point in _held_out(network, model, blocks, block)]
    rmse, predicted = _rms(points, "d{}_mm"), _rms(points, "sigma_{}_mm")
    chi2 = sum((point[f"d{axis}_mm"] / point[f"sigma_{axis}_mm"]) ** 2 for point in points for axis in "xyz")
    outcome = {"chi2": chi2, "freedom": 3 * len(points), "p": float(stats.chi2.sf(chi2, 3 * len(points)))}
    return {"blocks": BLOCKS, "rmse_mm": rmse, "predicted_mm": predicted, **outcome, "points": points}


def _held_out(network: Network, model: ObjectModel, blocks: np.ndarray, block: int) -> list[dict[str, Any]]:
    out = blocks == block
    rig = simulated.rig(simulated.adjusted(network.select(~out[network.target])))
    found = simulated.measured(rig, network.xy_px.reshape(2, -1, 2)[:, out])
    covariance = found.covariance_mm2 + found.calibration_covariance_mm2
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) + model.sigma_mm**2)
    rows = zip(model.target[out], model.xyz_mm[out], found.xyz_mm, sigma, strict=True)
    return [
        {
            "target": int(target),
            "block": block,
            **_axes("xyz", nominal, "{}_mm"),
            **_axes("xyz", place - nominal, "d{}_mm"),
            **_axes("xyz", spread, "sigma_{}_mm"),
        }
        for target, nominal, place, spread in rows
    ]


def _rms(points: list[dict[str, Any]], key: str) -> dict[str, float]:
    squares = [np.mean([point[key.format(axis)] ** 2 for point in points]) for axis in "xyz"]
    return _axes(("x", "y", "z", "xyz"), np.sqrt([*squares, sum(squares)]))


def _volume(adjustment: Adjustment) -> dict[str, Any]:
    x_mm, y_mm = np.linspace(-58, 58, 15), np.linspace(-30, 30, 9)
    rig, planes = simulated.rig(adjustment), []
    for z_mm in (-8.0, 0.0, 8.0):
        places = np.stack(np.meshgrid(x_mm, y_mm, [z_mm], indexing="ij"), axis=-1).reshape(-1, 3)
        seen = project_all(rig, places).transpose(1, 2, 0)
        inside = np.all([view.holds(seen[index]) for index, view in enumerate(adjustment.views)], axis=0)
        found = simulated.measured(rig, seen)
        alone, total = (
            found.calibration_covariance_mm2,
            found.calibration_covariance_mm2 + found.covariance_mm2,
        )
        shares = {"calibration": _sigma_grids(alone, inside), "total": _sigma_grids(total, inside)}
        planes.append({"z_mm": z_mm, **shares})
    pointing = {"pointing_px": SIGMA_PX.tolist()}
    return {"x_mm": x_mm.tolist(), "y_mm": y_mm.tolist(), "planes": planes, **pointing}


def _validity(adjustment: Adjustment) -> dict[str, Any]:
    known = Calibrated(adjustment.views, adjustment.parameter_covariance, LocalFields(None, None), 576)
    low, high = adjustment.xyz_mm.min(axis=0), adjustment.xyz_mm.max(axis=0)
    return validity_document(known, Volume(low, high, (float(SIGMA_PX[0]), float(SIGMA_PX[1]))))


def _sigma_grids(covariance: np.ndarray, inside: np.ndarray) -> dict[str, Any]:
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    known = np.where(inside[:, np.newaxis], sigma, None).reshape(15, 9, 3)
    return {axis: known[:, :, index].tolist() for index, axis in enumerate("xyz")}


def _geometry(adjustment: Adjustment, model: ObjectModel) -> dict[str, Any]:
    left, right = (view.center_mm for view in adjustment.views)
    middle = adjustment.xyz_mm.mean(0)
    rays = [(center - middle) / np.linalg.norm(center - middle) for center in (left, right)]
    return {
        "cameras": [simulated.camera(view) for view in adjustment.views],
        "targets_mm": model.xyz_mm.tolist(),
        "base_mm": float(np.linalg.norm(right - left)),
        "distance_mm": float(np.linalg.norm((left + right) / 2 - middle)),
        "convergence_deg": float(np.degrees(np.arccos(rays[0] @ rays[1]))),
        "planar_motion_mm": 0.042,
    }


def _axes(axes: Any, values: Any, key: str = "{}") -> dict[str, float]:
    return {key.format(axis): float(value) for axis, value in zip(axes, values, strict=True)}
