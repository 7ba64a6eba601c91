"""A calibration is read from its own document, and used once, before anybody is told that it was made."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import frame
from core.geometry.rigs import calibration
from grabberd.core.chain.calibration.calibration_result import read_back
from grabberd.errors import MeasurementError

PLACES = frame(6, 5)


def test_a_good_one_comes_back_as_it_was_written():
    written = calibration(covariance=np.eye(36) * 1e-8)
    assert read_back(written, PLACES).to_document() == written.to_document()


def test_one_that_no_reader_would_take_is_not_made():
    lopsided = np.eye(36)
    lopsided[0, 1] = 0.5
    with pytest.raises(MeasurementError, match=r"cannot be read back: .*not symmetric") as caught:
        read_back(calibration(covariance=lopsided), PLACES)
    assert caught.value.hint


def test_one_whose_images_lead_elsewhere_is_not_made():
    """A distortion that folds the picture: images have no ray."""
    written = calibration()
    folded = replace(written, left=replace(written.left, b=(0.0, 0.0, -0.09, *(0.0,) * 6)))
    with pytest.raises(MeasurementError, match=r"lead .* past its targets"):
        read_back(folded, PLACES)
