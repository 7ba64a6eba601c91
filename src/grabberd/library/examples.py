"""Captures to try the library with, made by the simulated grabber, and documents that belong to them."""

from pathlib import Path

from grabberd.config import shipped_configs
from grabberd.errors import NotFound

_FOLDER = Path(__file__).parents[1] / "examples"
_SHIPPED = {
    "calibration-frame.yaml": "calibration-frames/paper-108.yaml",
    "liner-inputs.yaml": "analysis/liner.yaml",
}
_HERE = ("frame.grab", "liner.grab", "object.grab", "object-truth.csv")


def example(name: str) -> Path:
    """The path of an example, which is only to be read: copy a capture before measuring it again.

    Args:
        name: "liner.grab" (a pulsating liner on a teat, with its vacuum), "frame.grab" (the calibration
            frame), "object.grab" (an object with known coordinates), "object-truth.csv" (those), or the
            documents "calibration-frame.yaml" and "liner-inputs.yaml".

    Raises:
        NotFound: There is no such example.
    """
    if name in _SHIPPED:
        return shipped_configs() / _SHIPPED[name]
    if name in _HERE:
        return _FOLDER / name
    raise NotFound(
        f"there is no example {name!r}", f"the examples are {', '.join(sorted([*_HERE, *_SHIPPED]))}"
    )
