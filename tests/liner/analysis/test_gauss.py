"""Gauss's rule: exact for polynomials, and safe to share."""

import numpy as np
import pytest

from grabberd_liner.analysis.wall.splines import gauss_rule


@pytest.mark.parametrize("count", [1, 2, 5, 8])
def test_it_is_exact_up_to_twice_its_nodes(count):
    nodes, weights = gauss_rule(count)
    for power in range(2 * count):
        exact = 2 / (power + 1) if power % 2 == 0 else 0.0
        assert weights @ nodes**power == pytest.approx(exact, abs=1e-14)


def test_nobody_can_spoil_it_for_the_others():
    nodes, _ = gauss_rule(3)
    with pytest.raises(ValueError, match="read-only"):
        nodes[0] = 0.0
    assert np.array_equal(gauss_rule(3)[0], nodes)
