"""The kind of computer and the libraries that bits depend on."""

import os
import platform
from importlib.metadata import version
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

KIND, PACKAGES = "computer", "packages"
"""Keys of documents that depend on them."""
PACKERS = ("numpy", "opencv-python-headless", "pyarrow", "h5py", "zstandard", "matplotlib")
"""Packages that write bytes of files, or round numbers, in their own way."""


def computer() -> dict[str, Any]:
    """What decides the last bits of a computed number: processor, linear algebra, packages."""
    simd: Any = np.show_config(mode="dicts")
    blas = sorted({str(one["architecture"]) for one in threadpool_info() if "architecture" in one})
    return {
        "machine": platform.machine(),
        "simd": sorted(simd["SIMD Extensions"].get("found", [])),
        "blas": blas,
        "openblas_coretype": os.environ.get("OPENBLAS_CORETYPE", ""),
        **packages("numpy", "scipy", "opencv-python-headless", "pyarrow", "matplotlib"),
    }


def packages(*names: str) -> dict[str, str]:
    """Versions of packages."""
    return {name: version(name) for name in names or PACKERS}
