"""The first words of a daemon started at a terminal: where everything is, and what is lacking."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

from grabberd import __version__
from grabberd.core.kernel import in_use

PARTS = {
    "report": ("matplotlib", "figures in reports"),
    "parquet": ("pyarrow", "tables as Parquet"),
    "hdf5": ("h5py", "points as HDF5"),
    "mqtt": ("aiomqtt", "publishing to a broker"),
}
"""What is optional, by the extra that brings it: a module that tells, and what it is for."""


def is_installed(module: str) -> bool:
    """Tell whether a module can be imported, without importing it."""
    return importlib.util.find_spec(module) is not None


def first_words(
    address: str,
    config: Path,
    is_default: bool,
    captures: Path,
    has: Callable[[str], bool] = is_installed,
) -> str:
    """A few lines: documentation, configuration, captures, what is not installed, the address to open."""
    lines = [f"grabberd {__version__} ({in_use()})", f"  documentation  {address}/docs"]
    of_default = " (the simulated grabber; for a real one, copy v4l2.yaml beside it and give --config)"
    lines.append(f"  configuration  {config}{of_default if is_default else ''}")
    lines.append(f"  captures       {captures}")
    missing = [extra for extra, (module, _) in PARTS.items() if not has(module)]
    if missing:
        lacking = ", ".join(PARTS[extra][1] for extra in missing)
        lines.append(f"  not installed  {lacking}: pip install 'grabberd[{','.join(missing)}]'")
    return "\n".join([*lines, "Ctrl-C ends it.", f"Open {address}"])
