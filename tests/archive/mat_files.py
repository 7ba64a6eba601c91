"""MAT-files as the MATIO library reads them, a C library that knows nothing of scipy."""

import numpy as np
import pytest


def by_matio(path):
    """Variables of a file: structs as dicts, cell arrays as lists, everything else as arrays and texts."""
    matio = pytest.importorskip("pymatio")
    return _plain(matio.loadmat(str(path)))


def _plain(value):
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, np.ndarray) and value.dtype == object:
        rows = [[_plain(one) for one in row] for row in value]
        return [row[0] for row in rows] if value.shape[1] == 1 else rows
    return value
