"""Networks for the tests: pictures of the calibration frame's targets with errors of known size."""

from dataclasses import replace

import numpy as np

from core.geometry.rigs import aimed
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import View, project, rotation_angles, rotation_matrix

SIGMA_PX = 0.05
LENS = (0.003, -0.002, -1.5e-3, 4e-5, -1e-6, 4e-4, -3e-4, 5e-4, 5e-4)
TRUE = (aimed("left", b=LENS), aimed("right", b=LENS))


def frame(rows: int = 12, columns: int = 9, depth_mm: float = 7.0) -> np.ndarray:
    """(rows · columns, 3) places of a calibration frame like the paper's, its depths like a saw."""
    x, y = np.meshgrid(np.linspace(-53, 53, rows), np.linspace(-26, 26, columns), indexing="ij")
    z = depth_mm * np.sin(2.1 * np.arange(x.size) + 0.4 * x.ravel() / 10)
    return np.column_stack([x.ravel(), y.ravel(), z])


def network(
    views=TRUE,
    places=None,
    sigma_px=SIGMA_PX,
    target_sigma_mm=0.0,
    seed: int | None = 1,
    start=None,
) -> Network:
    """What the true `views` see of `places`, all of them, with errors; the targets' stated places err too."""
    places = frame() if places is None else places
    rng = np.random.default_rng(seed)
    amount = 0.0 if seed is None else 1.0
    view = np.repeat(np.arange(len(views)), len(places))
    xy = np.concatenate([project(one, places) for one in views])
    known = np.broadcast_to(np.asarray(target_sigma_mm, float), places.shape).copy()
    off = rng.normal(size=places.shape) * np.where(np.isfinite(known), known, 1.0)
    return Network(
        views=tuple(start or views),
        view=view,
        target=np.tile(np.arange(len(places)), len(views)),
        xy_px=xy + amount * sigma_px * rng.normal(size=xy.shape),
        sigma_px=np.full(xy.shape, sigma_px),
        target_mm=places + amount * off,
        target_sigma_mm=known,
    )


def rough(views=TRUE, share: float = 0.1, seed: int = 0) -> tuple[View, ...]:
    """Nominal views: distances, focal length and angles wrong by up to `share`, no distortion known."""
    rng = np.random.default_rng(seed)
    spread = np.array([0.8, 20.0, 20.0, 0.05, 0.05, 0.05, 8.0, 8.0, 24.0]) * share / 0.1
    return tuple(
        replace(
            view.with_vector(view.vector() + np.append(rng.uniform(-spread, spread), np.zeros(9))),
            b=(0.0,) * 9,
        )
        for view in views
    )


def tied(views=TRUE) -> Unknowns:
    """The paper's own 17 parameters a view."""
    return Unknowns.of(views, tied=True)


def turned(view: View, name: str, turn_rad: float) -> View:
    """The same camera, carried round the object's Z axis: it sees the origin where it did."""
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    about = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    turned_back = rotation_matrix(view.omega_rad, view.phi_rad, view.kappa_rad) @ about.T
    omega, phi, kappa = rotation_angles(turned_back)
    x, y, z = about @ view.center_mm
    return replace(view, name=name, omega_rad=omega, phi_rad=phi, kappa_rad=kappa, X0_mm=x, Y0_mm=y, Z0_mm=z)


THREE = (*TRUE, turned(TRUE[0], "upper", -np.pi / 2))


def seen_less(given: Network, unseen: float, seed: int = 0) -> Network:
    """The network without a share of its image points."""
    return given.select(np.random.default_rng(seed).random(len(given)) >= unseen)


def deviation(adjusted, views=TRUE) -> np.ndarray:
    """(U,) of the unknowns from the truth."""
    return adjusted.values - adjusted.unknowns.values(views)
