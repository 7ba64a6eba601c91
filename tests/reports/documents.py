"""Documents for the tests: one of a simulated adjustment with every part, and the least there can be."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy import stats

from geometry.rigs import aimed
from grabberd.calibration import Adjustment, Network, Unknowns, adjust
from grabberd.geometry import PARAMETERS, Rig, View, distortion, project_all, rotation_matrix
from grabberd.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect

FRAME = Path(__file__).parents[2] / "configs" / "calibration-frames" / "paper-108.yaml"
SIGMA_PX = np.array([0.045, 0.035])
UNITS = ("mm", "px", "px", "rad", "rad", "rad", "mm", "mm", "mm", "1", "1", "mm⁻²", "mm⁻⁴", "mm⁻⁶",
         "mm⁻¹", "mm⁻¹", "mm⁻²", "mm⁻²")  # fmt: skip
DROPPED = ("left.b5", "right.b5")
BLUNDER = ("right", 40)
BLOCKS = 6


def least() -> dict[str, Any]:
    """What every report has, and nothing else."""
    views = [{"name": "left", "handedness": 1, "first_column": 0, "end_column": 360, "parameters": []},
             {"name": "right", "handedness": 1, "first_column": 360, "end_column": 720, "parameters": []}]  # fmt: skip
    null = ("capture", "calibration_frame", "image", "glass", "settings", "identification", "unknowns", "comparison",
            "tests", "dropped", "residuals", "blunders", "normality", "validation", "volume", "distortion",
            "local_field", "geometry", "warnings")  # fmt: skip
    result = {
        "sigma0": 1.25,
        "sigma0_px": 0.05,
        "freedom": 17,
        "steps": 4,
        "image_points": 30,
        "targets": 15,
        "rms_px": None,
    }
    head = {
        "schema": "grabberd/calibration-report/1",
        "id": "least",
        "created_utc": "2026-01-02T03:04:05+00:00",
        "version": "grabberd 0",
    }
    return {**head, "result": result, "views": views, **dict.fromkeys(null)}


def full(seed: int = 3) -> dict[str, Any]:
    """A report with every part, of an adjustment of 108 simulated targets with one blunder."""
    model = ObjectModel.from_document(yaml.safe_load(FRAME.read_text()))
    rng = np.random.default_rng(seed)
    truth = tuple(replace(aimed(name), f_mm=8.0 + 0.03 * rng.normal()) for name in ("left", "right"))
    network = _network(model, truth, rng)
    adjustment = adjust(network, Unknowns.of(network.views).without(DROPPED))
    return {
        **least(),
        "id": "20260102T030405Z-simulated",
        "version": "grabberd 0.1.0",
        "capture": {"id": "20260102T025900Z-simulated", "name": "calibration frame, morning", "device": "simulated",
                    "started_utc": "2026-01-02T02:59:00+00:00", "fields": 64, "bits": 8, "lines": "field"},
        "calibration_frame": {"name": model.name, "targets": len(model), "sigma_mm": model.sigma_mm,
                              "target_diameter_mm": model.target_diameter_mm, "temperature_C": 20.5,
                              "certificate": {"number": "K-108/7", "issued": "2025-11-03", "laboratory": "a test"}},
        "image": {"columns": 720, "lines": 576},
        "settings": {"weights": "honest", "frame": "weighted", "shared": [], "tied": False, "alpha": 0.05,
                     "method": "moments"},
        "identification": {"by": "lattice", "handedness": {"left": 1, "right": 1}, "rms_px": {"left": 0.31, "right": 0.29},
                           "runner_up_rms_px": {"left": 4.7, "right": 5.2}, "found": {"left": 108, "right": 108},
                           "of": 108, "unmatched_blobs": {"left": 0, "right": 2}},
        "result": _result(adjustment),
        "views": [_view(adjustment, index) for index in range(2)],
        "unknowns": {"names": list(adjustment.unknowns.names), "correlation": _correlation(adjustment).tolist()},
        "comparison": _comparison(adjustment),
        "tests": _tests(adjustment),
        "dropped": list(DROPPED),
        "residuals": _residuals(adjustment, model),
        "blunders": _blunders(adjustment, model),
        "normality": _normality(adjustment, model),
        "validation": _validation(network, model),
        "volume": _volume(adjustment),
        "distortion": [_distortion(view) for view in adjustment.views],
        "local_field": {"accepted": False, "held_out_rms_px": {"left": {"without": 0.061, "with": 0.064}, "right": {"without": 0.059, "with": 0.0593}},
                        "length_px": {"left": 95.0, "right": 110.0}, "signal_px": {"left": 0.021, "right": 0.018},
                        "grids": [_ripple(view) for view in adjustment.views]},
        "geometry": _geometry(adjustment, model),
        "warnings": ["right: target 40 is a blunder in x and was left out", "the calibration frame is 14 months old"],
    }  # fmt: skip


def _network(model: ObjectModel, truth: tuple[View, ...], rng: np.random.Generator) -> Network:
    places = model.xyz_mm + rng.normal(0, model.sigma_mm, model.xyz_mm.shape)
    seen = project_all(Rig.of_views(truth), places).transpose(1, 2, 0)
    seen = seen + rng.normal(0, 1, seen.shape) * SIGMA_PX
    seen[1, np.flatnonzero(model.target == BLUNDER[1])[0], 0] += 0.35
    count = len(model)
    return Network(
        views=tuple(replace(aimed(view.name), b=(0.0,) * 9) for view in truth),
        view=np.repeat(np.arange(2), count),
        target=np.tile(np.arange(count), 2),
        xy_px=seen.reshape(-1, 2),
        sigma_px=np.broadcast_to(SIGMA_PX, (2 * count, 2)).copy(),
        target_mm=model.xyz_mm,
        target_sigma_mm=np.full((count, 3), model.sigma_mm),
    )


def _result(adjustment: Adjustment) -> dict[str, Any]:
    network = adjustment.network
    rms = {
        view.name: dict(
            zip(
                "xy",
                np.sqrt((adjustment.residual_px[network.view == index] ** 2).mean(0)).tolist(),
                strict=True,
            )
        )
        for index, view in enumerate(network.views)
    }
    return {"sigma0": adjustment.sigma0, "sigma0_px": float(adjustment.sigma0_px), "freedom": adjustment.freedom,
            "steps": adjustment.steps, "image_points": len(network), "targets": len(network.target_mm), "rms_px": rms}  # fmt: skip


def _sigmas(adjustment: Adjustment) -> np.ndarray:
    return np.sqrt(np.diag(adjustment.parameter_covariance)).reshape(2, -1)


def _view(adjustment: Adjustment, index: int) -> dict[str, Any]:
    view, sigmas, number = (
        adjustment.views[index],
        _sigmas(adjustment)[index],
        adjustment.unknowns.number[index],
    )
    parameters = []
    for place, (name, unit) in enumerate(zip(PARAMETERS, UNITS, strict=True)):
        unknown = f"{view.name}.{name}"
        free = number[place] >= 0
        state = "adjusted" if free else "dropped" if unknown in DROPPED else "held"
        parameters.append({"name": name, "unit": unit, "value": float(view.vector()[place]),
                           "sigma": float(sigmas[place]) if free else None, "state": state,
                           "unknown": unknown if free else None})  # fmt: skip
    return {"name": view.name, "handedness": view.handedness, "first_column": view.first_column,
            "end_column": view.end_column, "parameters": parameters}  # fmt: skip


def _correlation(adjustment: Adjustment) -> np.ndarray:
    sigma = np.sqrt(np.diag(adjustment.covariance))
    return adjustment.covariance / np.outer(sigma, sigma)


def _comparison(adjustment: Adjustment) -> list[dict[str, Any]]:
    covariance = adjustment.parameter_covariance
    left, right = (view.vector() for view in adjustment.views)
    rows = []
    for place in (0, 1, 2, *range(9, 18)):
        pair = np.ix_([place, place + 18], [place, place + 18])
        variance = float(np.array([1, -1]) @ covariance[pair] @ np.array([1, -1]))
        if variance > 0:
            difference, sigma = float(left[place] - right[place]), variance**0.5
            statistic = difference / sigma
            rows.append({"parameter": PARAMETERS[place], "unit": UNITS[place], "left": float(left[place]),
                         "right": float(right[place]), "difference": difference, "sigma": sigma, "statistic": statistic,
                         "p": float(2 * stats.t.sf(abs(statistic), adjustment.freedom))})  # fmt: skip
    return rows


def _tests(adjustment: Adjustment) -> list[dict[str, Any]]:
    """Two rounds that never were, then the single tests of what is left."""
    rows = [{"round": turn, "kind": "nested", "parameters": [name], "statistic": 0.4 * turn, "q": 1,
             "freedom": adjustment.freedom - 3 + turn, "p": 0.53 / turn, "effect_px": 0.004, "dropped": True}
            for turn, name in enumerate(DROPPED, start=1)]  # fmt: skip
    sigma = np.sqrt(np.diag(adjustment.covariance))
    for name in ("b1", "b2", "b3", "b4", "b6", "b7", "b8", "b9"):
        for view in adjustment.views:
            index = adjustment.unknowns.names.index(f"{view.name}.{name}")
            statistic = float((view.b[int(name[1]) - 1] / sigma[index]) ** 2)
            rows.append({"round": 3, "kind": "single", "parameters": [f"{view.name}.{name}"], "statistic": statistic,
                         "q": 1, "freedom": adjustment.freedom, "p": float(stats.f.sf(statistic, 1, adjustment.freedom)),
                         "effect_px": 0.012 * statistic**0.5, "dropped": False})  # fmt: skip
    return rows


def _tau(adjustment: Adjustment) -> np.ndarray:
    spread = adjustment.sigma0 * adjustment.network.sigma_px * np.sqrt(adjustment.redundancy)
    return adjustment.residual_px / spread


def _residuals(adjustment: Adjustment, model: ObjectModel) -> list[dict[str, Any]]:
    network, tau = adjustment.network, _tau(adjustment)
    return [
        {"view": network.views[network.view[row]].name, "target": int(model.target[network.target[row]]),
         "x_px": float(network.xy_px[row, 0]), "y_px": float(network.xy_px[row, 1]),
         "dx_px": float(adjustment.residual_px[row, 0]), "dy_px": float(adjustment.residual_px[row, 1]),
         "sigma_x_px": float(network.sigma_px[row, 0]), "sigma_y_px": float(network.sigma_px[row, 1]),
         "redundancy_x": float(adjustment.redundancy[row, 0]), "redundancy_y": float(adjustment.redundancy[row, 1]),
         "tau_x": float(tau[row, 0]), "tau_y": float(tau[row, 1]), "fields": 64}
        for row in range(len(network))
    ]  # fmt: skip


def _blunders(adjustment: Adjustment, model: ObjectModel) -> list[dict[str, Any]]:
    return [{"view": row["view"], "target": row["target"], "axis": "x", "residual_px": row["dx_px"],
             "tau": row["tau_x"], "critical": 3.85}
            for row in _residuals(adjustment, model) if abs(row["tau_x"]) > 3.85]  # fmt: skip


def _normality(adjustment: Adjustment, model: ObjectModel) -> list[dict[str, Any]]:
    rows = _residuals(adjustment, model)
    tested = []
    for view in ("left", "right", "both"):
        taus = [row[axis] for row in rows if view in {row["view"], "both"} for axis in ("tau_x", "tau_y")]
        found = stats.jarque_bera(taus)
        tested.append({"view": view, "count": len(taus), "skewness": float(stats.skew(taus)),
                       "excess_kurtosis": float(stats.kurtosis(taus)), "test": "Jarque–Bera",
                       "statistic": float(found.statistic), "p": float(found.pvalue)})  # fmt: skip
    return tested


def _rig(adjustment: Adjustment) -> Rig:
    values, vectors = np.linalg.eigh(_correlation(adjustment))
    scale = np.sqrt(np.diag(adjustment.covariance))[:, np.newaxis]
    factor = adjustment.unknowns.selection @ (scale * vectors * np.sqrt(np.maximum(values, 0)))
    return Rig.of_views(adjustment.views, factor.reshape(2, 18, -1))


def _measured(rig: Rig, seen: np.ndarray) -> Any:
    count = len(seen[0])
    blobs = [ViewBlobs(places, np.broadcast_to(SIGMA_PX, (count, 2)).copy()) for places in seen]
    return intersect(rig, np.arange(count, dtype=np.int32), *blobs, ImageNoise(0.0, 2.0, 3.0))


def _validation(network: Network, model: ObjectModel) -> dict[str, Any]:
    blocks = np.minimum(model.row * BLOCKS // (int(model.row.max()) + 1), BLOCKS - 1)
    points = []
    for block in range(BLOCKS):
        out = blocks == block
        rig = _rig(adjust(network.select(~out[network.target]), Unknowns.of(network.views).without(DROPPED)))
        found = _measured(rig, network.xy_px.reshape(2, -1, 2)[:, out])
        sigma = np.sqrt(
            np.diagonal(found.covariance_mm2 + found.calibration_covariance_mm2, axis1=1, axis2=2)
            + model.sigma_mm**2
        )
        for target, place, error, spread in zip(
            model.target[out], model.xyz_mm[out], found.xyz_mm - model.xyz_mm[out], sigma, strict=True
        ):
            points.append({"target": int(target), "block": block,
                           **{f"{axis}_mm": float(value) for axis, value in zip("xyz", place, strict=True)},
                           **{f"d{axis}_mm": float(value) for axis, value in zip("xyz", error, strict=True)},
                           **{f"sigma_{axis}_mm": float(value) for axis, value in zip("xyz", spread, strict=True)}})  # fmt: skip
    rmse = {axis: float(np.sqrt(np.mean([p[f"d{axis}_mm"] ** 2 for p in points]))) for axis in "xyz"}
    predicted = {
        axis: float(np.sqrt(np.mean([p[f"sigma_{axis}_mm"] ** 2 for p in points]))) for axis in "xyz"
    }
    chi2 = sum((p[f"d{axis}_mm"] / p[f"sigma_{axis}_mm"]) ** 2 for p in points for axis in "xyz")
    for sums in (rmse, predicted):
        sums["xyz"] = float(np.sqrt(sum(value**2 for value in sums.values())))
    return {"blocks": BLOCKS, "rmse_mm": rmse, "predicted_mm": predicted, "chi2": chi2, "freedom": 3 * len(points),
            "p": float(stats.chi2.sf(chi2, 3 * len(points))), "points": points}  # fmt: skip


def _volume(adjustment: Adjustment) -> dict[str, Any]:
    x_mm, y_mm = np.linspace(-58, 58, 15), np.linspace(-30, 30, 9)
    rig, planes = _rig(adjustment), []
    for z_mm in (-8.0, 0.0, 8.0):
        places = np.stack(
            [*(grid.ravel() for grid in np.meshgrid(x_mm, y_mm, indexing="ij")), np.full(135, z_mm)], 1
        )
        seen = project_all(rig, places).transpose(1, 2, 0)
        inside = np.all([view.holds(seen[index]) for index, view in enumerate(adjustment.views)], axis=0)
        found = _measured(rig, seen)
        shares = {
            "calibration": found.calibration_covariance_mm2,
            "total": found.covariance_mm2 + found.calibration_covariance_mm2,
        }
        planes.append(
            {
                "z_mm": z_mm,
                **{share: _grids(covariance, inside, (15, 9)) for share, covariance in shares.items()},
            }
        )
    return {"x_mm": x_mm.tolist(), "y_mm": y_mm.tolist(), "planes": planes, "pointing_px": SIGMA_PX.tolist()}


def _grids(covariance: np.ndarray, inside: np.ndarray, shape: tuple[int, int]) -> dict[str, Any]:
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return {
        axis: [[float(value) if known else None for value, known in zip(row, seen, strict=True)]
               for row, seen in zip(sigma[:, index].reshape(shape), inside.reshape(shape), strict=True)]
        for index, axis in enumerate("xyz")
    }  # fmt: skip


def _places(view: View) -> tuple[np.ndarray, np.ndarray]:
    return np.linspace(view.first_column + 12, view.end_column - 13, 13), np.linspace(12, 563, 21)


def _distortion(view: View) -> dict[str, Any]:
    columns, lines = _places(view)
    grid = np.array(np.meshgrid(columns, lines))
    pixel = np.array([view.pixel_x_mm, -view.pixel_y_mm])[:, np.newaxis]
    ideal = (grid.reshape(2, -1) - np.array([[view.x0_px], [view.y0_px]])) * pixel
    moved = distortion(view.b, ideal.T).T / pixel
    dx, dy = moved.reshape(2, len(lines), len(columns))
    return {
        "view": view.name,
        "columns": columns.tolist(),
        "lines": lines.tolist(),
        "dx_px": dx.tolist(),
        "dy_px": dy.tolist(),
    }


def _ripple(view: View) -> dict[str, Any]:
    columns, lines = _places(view)
    x, y = np.meshgrid(columns, lines)
    return {"view": view.name, "columns": columns.tolist(), "lines": lines.tolist(),
            "dx_px": (0.03 * np.sin(x / 60) * np.cos(y / 80)).tolist(), "dy_px": (0.02 * np.cos((x + y) / 90)).tolist()}  # fmt: skip


def _geometry(adjustment: Adjustment, model: ObjectModel) -> dict[str, Any]:
    cameras = []
    for view in adjustment.views:
        turn = np.diag([view.handedness, 1, 1]) @ rotation_matrix(
            view.omega_rad, view.phi_rad, view.kappa_rad
        )
        corners = [((column - view.x0_px) * view.pixel_x_mm, -(line - view.y0_px) * view.pixel_y_mm, -view.f_mm)
                   for column in (view.first_column, view.end_column - 1) for line in (0, 575)]  # fmt: skip
        rays = np.array(corners) @ turn
        cameras.append({"name": view.name, "center_mm": view.center_mm.tolist(), "axis": (-turn[2]).tolist(),
                        "corners": (rays / np.linalg.norm(rays, axis=1, keepdims=True)).tolist()})  # fmt: skip
    left, right = (view.center_mm for view in adjustment.views)
    middle = adjustment.xyz_mm.mean(0)
    rays = [(center - middle) / np.linalg.norm(center - middle) for center in (left, right)]
    return {"cameras": cameras, "targets_mm": model.xyz_mm.tolist(), "base_mm": float(np.linalg.norm(right - left)),
            "distance_mm": float(np.linalg.norm((left + right) / 2 - middle)),
            "convergence_deg": float(np.degrees(np.arccos(rays[0] @ rays[1]))), "planar_motion_mm": 0.042}  # fmt: skip


if __name__ == "__main__":
    from grabberd.reports import calibration_html

    print(calibration_html(full()))
