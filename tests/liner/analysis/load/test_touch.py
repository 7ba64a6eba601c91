"""The first touch: where and when the pressure begins to last."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.pressure import PressureMap
from grabberd_liner.analysis.load.touch import first_touch


def pressure(value, sigma=0.5, reason=None):
    value = np.array(value, float)
    contact = Estimate(value, np.full(len(value), sigma))
    count, all_of_them = len(value), np.ones(len(value), bool)
    mean = Estimate(value.mean(), np.asarray(sigma))
    return PressureMap(contact, mean, contact, 0.7, None, all_of_them, reason or ("",) * count)


def test_the_first_touch_is_the_first_pressure_that_lasts():
    series = [pressure(v) for v in ([0, 0.1, 0], [9, 0, 0], [0, 0, 5], [0, 4, 6])]
    assert first_touch(series) == (2, 2)


def test_a_place_that_says_nothing_touches_nothing():
    silent = [pressure([9.0, 0.0], reason=("no targets near enough", "")) for _ in range(3)]
    with pytest.raises(AnalysisError, match="in none of 3 fields"):
        first_touch(silent)


def test_no_fields_have_no_touch():
    with pytest.raises(AnalysisError, match="in none of 0 fields"):
        first_touch([])
