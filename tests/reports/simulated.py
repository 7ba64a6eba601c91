"""A simulated calibration: 108 targets of the paper's calibration frame, two views, one blunder."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from core.geometry.rigs import aimed
from grabberd.core.calibration.adjustment.adjustment import Adjustment, adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import Rig, View, distortion, project_all, rotation_matrix
from grabberd.core.reconstruction import ImageNoise, ObjectModel, Points, ViewBlobs, intersect

FRAME = Path(__file__).parents[2] / "configs" / "calibration-frames" / "paper-108.yaml"
SIGMA_PX = np.array([0.045, 0.035])
DROPPED = ("left.b5", "right.b5")
BLUNDER = ("right", 40)


def calibration_frame() -> ObjectModel:
    return ObjectModel.from_document(yaml.safe_load(FRAME.read_text()))


def network(model: ObjectModel, seed: int) -> Network:
    rng = np.random.default_rng(seed)
    truth = [replace(aimed(name), f_mm=8.0 + 0.03 * rng.normal()) for name in ("left", "right")]
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


def adjusted(given: Network) -> Adjustment:
    return adjust(given, Unknowns.of(given.views).without(DROPPED))


def correlation(adjustment: Adjustment) -> np.ndarray:
    sigma = np.sqrt(np.diag(adjustment.covariance))
    return adjustment.covariance / np.outer(sigma, sigma)


def tau(adjustment: Adjustment) -> np.ndarray:
    spread = adjustment.sigma0 * adjustment.network.sigma_px * np.sqrt(adjustment.redundancy)
    return adjustment.residual_px / spread


def rig(adjustment: Adjustment) -> Rig:
    """The views with the factor of their covariance."""
    values, vectors = np.linalg.eigh(correlation(adjustment))
    scale = np.sqrt(np.diag(adjustment.covariance))[:, np.newaxis]
    factor = adjustment.unknowns.selection @ (scale * vectors * np.sqrt(np.maximum(values, 0)))
    return Rig.of_views(adjustment.views, factor.reshape(2, 18, -1))


def measured(with_rig: Rig, seen: np.ndarray) -> Points:
    count = len(seen[0])
    blobs = [ViewBlobs(places, np.broadcast_to(SIGMA_PX, (count, 2)).copy()) for places in seen]
    return intersect(with_rig, np.arange(count, dtype=np.int32), *blobs, ImageNoise(0.0, 2.0, 3.0))


def lattice(view: View) -> tuple[np.ndarray, np.ndarray]:
    """Columns and frame lines over a view's half."""
    return np.linspace(view.first_column + 12, view.end_column - 13, 13), np.linspace(12, 563, 21)


def field(view: View, dx: np.ndarray, dy: np.ndarray) -> dict[str, Any]:
    columns, lines = lattice(view)
    place = {"view": view.name, "columns": columns.tolist(), "lines": lines.tolist()}
    return {**place, "dx_px": dx.tolist(), "dy_px": dy.tolist()}


def distortion_field(view: View) -> dict[str, Any]:
    grid = np.array(np.meshgrid(*lattice(view)))
    pixel = np.array([view.pixel_x_mm, -view.pixel_y_mm])[:, np.newaxis]
    ideal = (grid.reshape(2, -1) - np.array([[view.x0_px], [view.y0_px]])) * pixel
    return field(view, *(distortion(view.b, ideal.T).T / pixel).reshape(grid.shape))


def ripple_field(view: View) -> dict[str, Any]:
    x, y = np.meshgrid(*lattice(view))
    return field(view, 0.03 * np.sin(x / 60) * np.cos(y / 80), 0.02 * np.cos((x + y) / 90))


def camera(view: View) -> dict[str, Any]:
    turn = rotation_matrix(view.omega_rad, view.phi_rad, view.kappa_rad)
    corners = [
        ((column - view.x0_px) * view.pixel_x_mm, -(line - view.y0_px) * view.pixel_y_mm, -view.f_mm)
        for column in (view.first_column, view.end_column - 1)
        for line in (0, 575)
    ]
    rays = np.array(corners) @ turn
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    center = view.center_mm.tolist()
    return {"name": view.name, "center_mm": center, "axis": (-turn[2]).tolist(), "corners": rays.tolist()}
