"""What both sides are given: fields of the simulator, what is true in them, and the rig that sees them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.proofs.bench.accuracy import Scene
from tests.proofs.bench.core_numbers import discs

from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.field import NumberedField, PackedField, unpack
from grabberd.core.geometry import project
from grabberd_fake import truth_at

Array = NDArray[np.float64]

SCENE: Mapping[str, Any] = {
    "scene": "calibration_frame",
    "rig": {"mirror_error_px": 0.0},
    "picture": {"stamp": False, "noise": 0.02, "jitter_px": 0.12},
}
"""108 targets in either view, and nothing else that is bright; mirrors that all models can express."""
SETTLED = 10
"""Our first fields identify the targets, which no peer does; nobody's times of them are taken."""
LINES = ("288", "doubled")
NUMBERS = ((54, 1), (216, 1), (1000, 1), (5000, 1), (216, 4), (216, 16))
"""How many discs, in how many pictures' area."""
DEPTH_MM = 10.0
"""How far the targets may lie from the object's plane z = 0: the calibration frame's 8 mm and a little."""


class Given(NamedTuple):
    """Fields and their truth.

    Attributes:
        setup: of our measurement.
        packed: by "1 bit, 288", "1 bit, doubled" and "8 bit, 288".
        masks: by "288" and "doubled", (N, rows, columns) uint8, 1 where a pixel is brighter than the
            threshold; what `packed` of 1 bit holds.
        luma: (N, 288, columns) uint8; `level` separates target from background in it.
        truth_px: (2, M, 2) frame pixels of the targets in both views; `truth_mm`: (M, 3); `ids`: (M,).
        numbers: for each of `NUMBERS`, a field of so many discs.
    """

    setup: MeasureSetup
    packed: Mapping[str, list[NumberedField]]
    masks: Mapping[str, NDArray[np.uint8]]
    luma: NDArray[np.uint8]
    level: int
    truth_px: Array
    truth_mm: Array
    ids: NDArray[np.int32]
    numbers: Mapping[tuple[int, int], PackedField]

    @property
    def parities(self) -> list[int]:
        """Of the fields."""
        return [one.packed.parity for one in self.packed["8 bit, 288"]]

    def save(self, file: Path) -> None:
        """What the peers need of it; they are told no truth but the rig's."""
        calibration = self.setup.calibration
        projected = np.array([project(view, self.truth_mm) for view in calibration.views])
        arrays = {f"mask_{lines}": masks for lines, masks in self.masks.items()}
        arrays |= {f"discs_{count}_{area}": mask_of(field) for (count, area), field in self.numbers.items()}
        np.savez(
            file,
            settled=SETTLED,
            luma=self.luma,
            level=self.level,
            parity=self.parities,
            views=[[getattr(view, name) for name in OF_VIEW] + list(view.b) for view in calibration.views],
            end_column=[view.end_column for view in calibration.views],
            object_mm=self.truth_mm,
            projected_px=projected,
            depth_mm=DEPTH_MM,
            **arrays,
        )


OF_VIEW = ("X0_mm", "Y0_mm", "Z0_mm", "omega_rad", "phi_rad", "kappa_rad", "f_mm")
OF_VIEW += ("x0_px", "y0_px", "pixel_x_mm", "pixel_y_mm")


def given(fields: int) -> Given:
    """So many fields after those that settle."""
    scene = Scene(dict(SCENE), fields + SETTLED)
    truth = truth_at(SCENE, scene.fields[0].time_ns)
    assert truth.visible_left.all()
    assert truth.visible_right.all()
    packed = {
        "1 bit, 288": list(requantised(scene.fields, 1, doubled=False)),
        "1 bit, doubled": list(requantised(scene.fields, 1, doubled=True)),
        "8 bit, 288": list(requantised(scene.fields, 8, doubled=False)),
    }
    return Given(
        scene.setup,
        packed,
        {lines: np.stack([mask_of(one.packed) for one in packed[f"1 bit, {lines}"]]) for lines in LINES},
        np.stack([unpack(one.packed).luma for one in packed["8 bit, 288"]]),
        packed["8 bit, 288"][0].packed.threshold,
        np.stack([truth.left_px, truth.right_px]),
        truth.xyz_mm,
        truth.ids,
        {which: discs(*which) for which in NUMBERS},
    )


def mask_of(packed: PackedField) -> NDArray[np.uint8]:
    """(rows, columns) 0 and 1, of a field of 1 bit."""
    return (unpack(packed).luma > packed.threshold).astype(np.uint8)
