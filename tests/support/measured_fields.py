"""Fields of a liner as a worker measures them, made by hand."""

from collections.abc import Iterable
from types import SimpleNamespace
from typing import cast

import numpy as np

from core.reconstruction.liners import model
from grabberd.core.chain.measure import MeasuredField, MeasureSetup
from grabberd.core.reconstruction import Points

LINER = model()
VIEWS = (
    SimpleNamespace(name="left", first_column=0, end_column=360),
    SimpleNamespace(name="right", first_column=360, end_column=720),
)
SETUP = cast("MeasureSetup", SimpleNamespace(object_model=LINER, calibration=SimpleNamespace(views=VIEWS)))
RESIDUAL_PX = 0.25


def measured_field(time_ns: int, wider: float = 1.0, without: Iterable[int] = ()) -> MeasuredField:
    """A field with all targets of the liner but some, two blobs in the left view and one in the right."""
    kept = ~np.isin(LINER.target, list(without))
    count = int(kept.sum())
    covariance = np.tile(np.eye(3) * 1e-4, (count, 1, 1))
    image_px = np.zeros((count, 2, 2))
    residual_px = np.full(count, RESIDUAL_PX)
    points = Points(
        LINER.target[kept], LINER.xyz_mm[kept] * wider, covariance, covariance, image_px, residual_px
    )
    return cast("MeasuredField", SimpleNamespace(time_ns=time_ns, points=points, blobs=_blobs()))


def _blobs() -> SimpleNamespace:
    x_px = np.array([100.0, 200.0, 500.0])
    return SimpleNamespace(
        xy_px=np.column_stack([x_px, x_px]), width_px=np.full(3, 6.0), at_border=np.zeros(3, bool)
    )
