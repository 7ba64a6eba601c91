"""Symmetric 3×3 matrices by their six elements."""

import numpy as np

from grabberd.geometry.symmetric import DIAGONAL, FIRST, SECOND, inverse_symmetric


def test_inverses_are_those_of_the_full_matrices():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(20, 3, 4))
    full = root @ root.transpose(0, 2, 1)
    six = full[:, FIRST, SECOND].T
    np.testing.assert_allclose(inverse_symmetric(six).transpose(2, 0, 1), np.linalg.inv(full), rtol=1e-9)


def test_the_diagonal_is_where_it_is_said_to_be():
    assert [(FIRST[index], SECOND[index]) for index in DIAGONAL] == [(0, 0), (1, 1), (2, 2)]
