"""A progressive picture to its points at digital cameras' rates, beside what OpenCV needs to label it.

The pictures are drawn by OpenCV: a calibration frame of 108 targets that swings before two views.
"""

import cv2
import numpy as np
import yaml
from tests.proofs.bench.core import FIELDS, PASSES, THRESHOLD, in_turns

from core.chain.sized_pictures import Picture
from grabberd.config import shipped_configs
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.field import Field, NumberedField, quantise
from grabberd.core.geometry import Calibration
from grabberd.core.kernel import in_use
from grabberd.core.reconstruction import ObjectModel

CAMERAS = (
    ("1280×720", Picture(1280, 720, 0.0046), 60.0),
    ("640×480", Picture(640, 480, 0.0093), 120.0),
)
"""A target of 1.5 mm is 10.9 and 5.4 px wide."""
BITS = (1, 8)
DRAWN = 20
"""Pictures that are drawn; noise is drawn anew for each of `FIELDS`."""
STROKE_MM, NOISE = 1.5, 3.0


def table() -> str:
    """Medians in microseconds, the ratio to cv2's fastest labelling, and the share of a core."""
    cv2.setNumThreads(1)
    by = f"By the {in_use()}; medians of {PASSES} passes, ours and the peer's by turns; 2 × 108 targets.\n"
    head = "| pictures | µs, picture → points | µs, cv2 labelling alone | ratio | points | of a core |"
    rows = [_row(*camera, bits) for camera in CAMERAS for bits in BITS]
    return "\n".join([by, head, "|---|---|---|---|---|---|", *rows])


def _row(name: str, camera: Picture, rate_hz: float, bits: int) -> str:
    model = _frame()
    setup = MeasureSetup(_calibration(camera), model)
    took, peer, points = in_turns(_fields(camera, model, rate_hz, bits), setup)
    share = took * 1e-6 * rate_hz
    what = f"{name} at {rate_hz:g}/s, {bits} bit"
    return f"| {what} | {took:.0f} | {peer:.0f} | {took / peer:.2f} | {points:.1f} | {share:.1%} |"


def _fields(camera: Picture, model: ObjectModel, rate_hz: float, bits: int) -> list[NumberedField]:
    rng = np.random.default_rng(bits)
    along = STROKE_MM * np.sin(2 * np.pi * np.arange(DRAWN) / DRAWN)
    shown = [camera.draw(model.xyz_mm + np.array([one, 0, 0]), model.target_diameter_mm) for one in along]
    fields = []
    for n in range(FIELDS):
        grey = shown[n % DRAWN] + rng.normal(0, NOISE, shown[0].shape)
        luma = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
        packed = quantise(Field.progressive(luma), bits, THRESHOLD)
        fields.append(NumberedField(n, round(n * 1e9 / rate_hz), n, packed))
    return fields


def _frame() -> ObjectModel:
    """The paper's calibration frame at a pitch of 6.5 mm each way, half as deep."""
    file = shipped_configs() / "calibration-frames" / "paper-108.yaml"
    paper = yaml.safe_load(file.read_text("utf-8"))
    targets = [
        target | {"x_mm": 6.5 * (target["row"] - 5.5), "z_mm": target["z_mm"] / 2}
        for target in paper["targets"]
    ]
    return ObjectModel.from_document(paper | {"targets": targets})


def _calibration(camera: Picture) -> Calibration:
    left, right = camera.nominal.views()
    size = camera.columns, camera.lines
    return Calibration("drawn", "2026-01-01T00:00:00Z", "polygons", *size, left, right, np.zeros((36, 36)))
