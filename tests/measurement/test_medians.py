import numpy as np
import pytest

from grabberd.measurement.medians import median


@pytest.mark.parametrize("count", [1, 2, 3, 4, 101, 180])
def test_it_is_numpy_s_median(count):
    values = np.random.default_rng(count).normal(size=count)
    assert median(values) == np.median(values)
