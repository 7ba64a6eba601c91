"""The simulated rig and scenes as calibration documents and object models of the program."""

import math
from typing import Any

from grabberd_fake.optics import COLUMNS, HALF, LINES, Array, View, build_views
from grabberd_fake.options import FakeOptions
from grabberd_fake.world import build_scene

CREATED_UTC = "2026-01-01T00:00:00Z"
# The nominal shape of a liner is known far less well than a certified object.
_SIGMA_MM = {"liner": 0.3, "ellipse": 0.3}
_CERTIFIED_SIGMA_MM = 0.01


def calibration_document(options: FakeOptions) -> dict[str, Any]:
    """The exact calibration of the simulated rig, without the mirrors' local errors.

    A virtual camera is the real one reflected in its half's mirrors, from the camera outwards.
    """
    left, right = build_views(options)
    return {
        "schema": "grabberd/calibration/1",
        "id": f"fake-{options.rig.seed}-{options.rig.reflections}",
        "created_utc": CREATED_UTC,
        "source": "exact optics of the simulated grabber",
        "image": {"columns": COLUMNS, "lines": LINES},
        "views": {view.name: _view_document(view) for view in (left, right)},
        "covariance": None,
        "sigma0_px": None,
        "glass": None,
        "details": {"mirror_error_px": options.rig.mirror_error_px},
    }


def _view_document(view: View) -> dict[str, Any]:
    camera, axes = view.camera.options, view.axes()
    handedness = 1 if len(view.mirrors) % 2 == 0 else -1
    axes[0] *= handedness  # axes = diag(handedness, 1, 1) · R
    omega, phi, kappa = _angles(axes)
    center = view.center_mm()
    return {
        "first_column": view.first_column,
        "end_column": view.first_column + HALF,
        "pixel_x_mm": camera.pixel_x_mm,
        "pixel_y_mm": camera.pixel_y_mm,
        "handedness": handedness,
        "f_mm": camera.f_mm,
        "x0_px": camera.x0_px,
        "y0_px": camera.y0_px + view.line_offset,
        "omega_rad": omega,
        "phi_rad": phi,
        "kappa_rad": kappa,
        "X0_mm": float(center[0]),
        "Y0_mm": float(center[1]),
        "Z0_mm": float(center[2]),
        "b": [0.0, 0.0, *camera.radial, *camera.decentering, 0.0, 0.0],
    }


def _angles(rotation: Array) -> tuple[float, float, float]:
    """ω, φ, κ of R = Rκ·Rφ·Rω, whose matrices turn the axes counterclockwise; φ stays far from ±π/2."""
    phi = math.asin(rotation[2, 0])
    return math.atan2(-rotation[2, 1], rotation[2, 2]), phi, math.atan2(-rotation[1, 0], rotation[0, 0])


def object_document(options: FakeOptions) -> str:
    """The scene's object model as YAML; for the liner, its mounted state without a pressure difference."""
    scene = build_scene(options)
    # Adding zero turns −0.0 into 0.0, which would otherwise be written with its sign.
    nominal = scene.nominal().xyz_mm.round(4) + 0.0
    targets = zip(scene.ids, nominal, scene.row, scene.column, strict=True)
    head = [
        f"name: {options.scene}",
        f"target_diameter_mm: {options.target_diameter_mm:g}",
        f"sigma_mm: {_SIGMA_MM.get(options.scene, _CERTIFIED_SIGMA_MM):g}",
        "targets:",
    ]
    lines = [
        f"  - {{id: {number}, x_mm: {x:.4f}, y_mm: {y:.4f}, z_mm: {z:.4f}, row: {row}, column: {column}}}"
        for number, (x, y, z), row, column in targets
    ]
    return "\n".join(head + lines) + "\n"
