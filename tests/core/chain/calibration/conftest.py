"""Pictures of calibration frames that several tests calibrate from are identified once."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
import pytest

from grabberd.core.calibration.identification.frame_identification import Identification, identify_frame
from grabberd.core.chain.calibration import calibration_check, frame_capture

KEPT = 8


@pytest.fixture(scope="module", autouse=True)
def identified_once() -> Iterator[None]:
    """It takes most of a calibration's time, and rests on the same blobs whatever is done with them."""

    @lru_cache(maxsize=KEPT)
    def identified(nominal, frame, left, right, settings) -> Identification:
        places = (np.frombuffer(side).reshape(-1, 2) for side in (left, right))
        return identify_frame(nominal, frame, *places, settings)

    def identify(nominal, frame, left_px, right_px, settings):
        return identified(nominal, frame, left_px.tobytes(), right_px.tobytes(), settings)

    with pytest.MonkeyPatch.context() as patch:
        for user in (calibration_check, frame_capture):
            patch.setattr(user, "identify_frame", identify)
        yield
