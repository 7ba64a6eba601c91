"""The whole way: calibrated from the calibration frame, then measured, against the simulator's truth."""

from dataclasses import replace
from typing import Any

import numpy as np
from tests.proofs.bench.accuracy import FIELDS, PICTURE, VARIANTS, Scene
from yaml import safe_load

from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.geometry import NominalRig
from grabberd.core.reconstruction import ObjectModel
from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import object_document

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
RIGS = ((1, 2), (2, 2), (3, 2), (1, 1), (2, 1), (3, 1))
"""Seed of the rig, and mirrors a view: one makes the virtual cameras left-handed."""


def table() -> str:
    """XYZ RMSE in mm of single fields and smoothed over time, with mirrors uneven by .06 px rms."""
    names = [name for name, *_ in VARIANTS]
    head = "| rig | handedness | unmodelled, px | " + " | ".join(f"{name}; smoothed" for name in names) + " |"
    rows = [_row(seed, mirrors) for seed, mirrors in RIGS]
    picture = PICTURE.split(";")[0]
    return "\n".join([f"{FIELDS} fields each, {picture}.\n", head, "|---" * (3 + len(names)) + "|", *rows])


def _row(seed: int, mirrors: int) -> str:
    rig = {"seed": seed, "reflections": mirrors}
    frame_options: dict[str, Any] = {"scene": "calibration_frame", "rig": rig, "seed": seed}
    frame = ObjectModel.from_document(safe_load(object_document(FakeOptions.read(frame_options))))
    made = calibrate([Scene(frame_options).fields], NOMINAL, frame)
    known = made.calibration("bench", "2026-01-01T00:00:00+00:00", "bench", None, {})
    scene = Scene({"scene": "accuracy_object", "rig": rig, "seed": seed + 100})
    scene.setup = replace(scene.setup, calibration=known)
    cells = []
    for _, *how in VARIANTS:
        result = scene.investigated(*how)
        single, smoothed = result.single, result.smoothed
        cells.append(
            f"{_xyz(single)} ({np.sqrt(single.chi2):.2f}); {_xyz(smoothed)} ({np.sqrt(smoothed.chi2):.2f})"
        )
    handedness = made.identification.handedness[0]
    return f"| {seed} | {handedness:+d} | {made.unmodelled_px:.3f} | " + " | ".join(cells) + " |"


def _xyz(compared: Any) -> str:
    return f"{compared.accuracy.rmse.xyz_mm:.4f}"
