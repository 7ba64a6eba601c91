"""Pictures that are known far better than the calibration frame: 8 bits at 1920 x 1080, .002 px.

Drawn by OpenCV's camera model and polygons. The frame is only half as deep as the paper's, so that it
separates lens and position of the cameras badly.
"""

from collections.abc import Iterator

import numpy as np
import pytest

from core.chain.test_target_sizes import FRAME, HD
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, quantise

NOISE, PERIOD_NS = 0.7, 16_666_667


def pictures(shown: np.ndarray, count: int) -> Iterator[NumberedField]:
    rng = np.random.default_rng(3)
    for n in range(count):
        grey = np.clip(np.rint(shown + rng.normal(0, NOISE, shown.shape)), 0, 255).astype(np.uint8)
        yield NumberedField(n, n * PERIOD_NS, n, quantise(Field.progressive(grey), 8, 70))


@pytest.mark.parametrize("off_mm", [0.0, 0.003, 0.01], ids=["exact", "better than stated", "as stated"])
def test_a_frame_of_any_quality_up_to_its_certificate_is_calibrated_from(off_mm: float) -> None:
    places = FRAME.xyz_mm + np.random.default_rng(1).normal(0, 1, FRAME.xyz_mm.shape) * off_mm
    made = calibrate([pictures(HD.draw(places, 1.5), 6)], HD.nominal, FRAME)
    assert max(made.pointing_px) < 0.003
    assert len(made.blunders) <= 2
    # The centre of a disc's picture is some thousandths of a pixel off the picture of its centre.
    assert made.unmodelled_px < 0.01
    assert made.adjustment.sigma0_images == pytest.approx(1.0, abs=0.3)

    object_mm = FRAME.xyz_mm + np.random.default_rng(2).normal(0, 0.1, FRAME.xyz_mm.shape)
    known = made.calibration("drawn", "2026-01-01T00:00:00Z", "polygons", None, {})
    (found,) = measure_fields(pictures(HD.draw(object_mm, 1.5), 1), MeasureSetup(known, FRAME))
    assert len(found.points) > 100
    error_mm = found.points.xyz_mm - object_mm[np.searchsorted(FRAME.target, found.points.target)]
    # The frame's own errors turn and stretch its coordinates by what is left of them on average.
    assert np.sqrt((error_mm**2).sum(axis=1).mean()) < 0.003 + 0.3 * off_mm
