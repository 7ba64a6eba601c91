"""One pose of the calibration frame against three, with the same number of fields, by independent scenes.

The frame's targets lie off their certificate by its σ, alike in all poses; mirrors are uneven. What is judged
is an object that neither calibration has seen, averaged over its fields, against the simulator's truth.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.proofs.bench.accuracy import Scene, grabbed
from tests.proofs.bench.calibrated import NOMINAL
from yaml import safe_load

from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.calibration.calibration_result import CalibrateResult
from grabberd.core.field import NumberedField
from grabberd.core.geometry import rotation_matrix
from grabberd.core.reconstruction import ObjectModel
from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import object_document

Array = NDArray[np.float64]

FIELDS = 24
POSES = ((0, 0, 0, 0, 0, 0), (12, -8, 20, 4, -3, 3), (-10, 9, -160, -3, 4, -4))
"""ω, φ, κ in degrees and the shift in mm of each pose."""
RIGS = ((11, 2), (12, 2), (13, 2), (14, 1), (15, 1), (16, 1))
"""Seed of the rig and of the errors of the certificate, and mirrors a view; none was looked at beforehand."""


class Judged(NamedTuple):
    """Errors of a calibration, most of them of its points of the independent object.

    Attributes:
        rmse_mm: √(X² + Y² + Z²).
        chi2: Mean of the squared errors over their predicted variance.
        sigma_mm: Mean σ of the calibration alone over the frame's volume.
        places_mm: RMS error of the adjusted places of the frame's targets.
    """

    rmse_mm: float
    chi2: float
    sigma_mm: float
    places_mm: float


def table(rigs: Sequence[tuple[int, int]] = RIGS) -> str:
    """Errors in mm of averaged points of an object that the calibration has not seen."""
    head = (
        "| rig | mirrors | poses | XYZ | χ² | calibration's σ | frame's targets |\n"
        "|---|---|---|---|---|---|---|"
    )
    rows = []
    for seed, mirrors in rigs:
        for count in (1, len(POSES)):
            one = judged(seed, mirrors, count)
            values = f"{one.rmse_mm:.4f} | {one.chi2:.2f} | {one.sigma_mm:.4f} | {one.places_mm:.4f}"
            rows.append(f"| {seed} | {mirrors} | {count} | {values} |")
    return "\n".join([f"{FIELDS} fields in all, 8 bit, mirrors uneven by .06 px.\n", head, *rows])


def judged(seed: int, mirrors: int, count: int) -> Judged:
    """Calibrate from so many poses and judge."""
    rig = {"seed": seed, "reflections": mirrors}
    model = _model()
    error = np.random.default_rng(seed).normal(0, model.sigma_mm, model.xyz_mm.shape)
    captures = [_capture(rig, seed, model.xyz_mm + error, pose, FIELDS // count) for pose in POSES[:count]]
    made = calibrate(captures, NOMINAL, model)
    found = _object(seed, mirrors, made)
    off = made.final.xyz_mm - model.xyz_mm - error
    sigma_mm = np.sqrt((made.volume.calibration_sigma_mm**2).sum(axis=-1)).mean()
    return Judged(*found, float(sigma_mm), float(np.sqrt((off**2).sum(axis=1).mean())))


def _model() -> ObjectModel:
    return ObjectModel.from_document(
        safe_load(object_document(FakeOptions.read({"scene": "calibration_frame"})))
    )


def _capture(
    rig: dict[str, int], seed: int, places_mm: Array, pose: Sequence[float], count: int
) -> list[NumberedField]:
    turn = rotation_matrix(*np.radians(pose[:3]).tolist())
    normal = dict(zip(("nx", "ny", "nz"), (turn @ [0.0, 0.0, 1.0]).tolist(), strict=True))
    points: list[dict[str, Any]] = [
        {"id": number, "x_mm": x, "y_mm": y, "z_mm": z, **normal}
        for number, (x, y, z) in enumerate((places_mm @ turn.T + pose[3:]).tolist(), start=1)
    ]
    noise = seed + round(1000 * pose[2])
    return list(grabbed({"scene": "points", "points": points, "rig": rig, "seed": abs(noise)}, count))


@cache
def _scene(seed: int, mirrors: int) -> Scene:
    rig = {"seed": seed, "reflections": mirrors}
    return Scene({"scene": "accuracy_object", "rig": rig, "seed": seed + 100})


def _object(seed: int, mirrors: int, made: CalibrateResult) -> tuple[float, float]:
    scene = _scene(seed, mirrors)
    known = made.calibration("bench", "2026-01-01T00:00:00+00:00", "bench", None, {})
    scene.setup = replace(scene.setup, calibration=known)
    smoothed = scene.investigated(8, doubled=False).smoothed
    assert smoothed.accuracy.rmse is not None
    return smoothed.accuracy.rmse.xyz_mm, smoothed.chi2


if __name__ == "__main__":
    for one in RIGS:
        print(table([one]), flush=True)
