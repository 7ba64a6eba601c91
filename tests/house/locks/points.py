"""Numbers that are computed from the committed captures: points, accuracy, a calibration, an analysis."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import grabberd

from .computer import computer
from .exits import FORMAT_1
from .kept import canonical, digest

EVERY = 97
"""Of so many rows, one is kept as numbers."""
LONGEST = 24
"""Parts of a list that is kept whole."""
RELATIVE = 1e-8
"""Share by which numbers of another computer may differ."""
OF_THE_MOMENT = ("id", "created_utc")
"""Keys of a calibration that the clock decides on."""


def points() -> dict[str, Any]:
    """Points of captures that are measured again with their own calibrations."""
    files = [grabberd.example("object.grab"), grabberd.example("liner.grab"), FORMAT_1 / "simulated.grab"]
    return {"computer": computer(), **{file.name: _measured(file) for file in files}}


def computed() -> dict[str, Any]:
    """A comparison with the truth, and the analysis of the shapes of a capture."""
    with grabberd.open(grabberd.example("object.grab")) as capture:
        found = capture.accuracy(grabberd.example("object-truth.csv"))
    with grabberd.open(FORMAT_1 / "simulated.grab") as capture:
        analysis = capture.analyse()
        tables = {name: table_of(analysis[name].array) for name in analysis.tables}
    axes = {
        name: getattr(found, name).accuracy.rmse._asdict() | {"chi2": getattr(found, name).chi2}
        for name in ("single", "smoothed")
    }
    return {"computer": computer(), "accuracy": axes, "analysis": tables, "lacks": list(analysis.lacks)}


def calibration() -> dict[str, Any]:
    """A calibration from the committed capture of the calibration frame; its time and id are masked."""
    made = grabberd.calibrate(grabberd.example("frame.grab"), grabberd.example("calibration-frame.yaml"))
    document = {key: value for key, value in made.document.items() if key not in OF_THE_MOMENT}
    report = None if made.report is None else made.report.model_dump(mode="json", by_alias=True)
    return {
        "computer": computer(),
        "exact": digest(canonical(document)),
        "document": shortened(document),
        "verdict": made.verdict,
        "sigma0": made.sigma0,
        "report": sorted(report or {}),
    }


def table_of(array: NDArray[Any]) -> dict[str, Any]:
    """A structured array: its columns' exact bytes, and some of its numbers."""
    columns = {name: array[name] for name in array.dtype.names or ()}
    return {
        "rows": len(array),
        "exact": {name: _exact(column) for name, column in columns.items()},
        "some": {name: _some(column) for name, column in columns.items()},
    }


def shortened(value: Any) -> Any:
    """A document whose long lists are told by some of their numbers."""
    if isinstance(value, dict):
        return {key: shortened(one) for key, one in value.items()}
    if isinstance(value, list) and len(value) > LONGEST:
        return {"parts": len(value), "some": [shortened(one) for one in value[:: len(value) // 4]]}
    return [shortened(one) for one in value] if isinstance(value, list) else value


def without_bits(document: Any) -> Any:
    """The document of a computer of another kind, without what only the same kind has in common."""
    if isinstance(document, dict):
        return {key: without_bits(one) for key, one in document.items() if key not in {"exact", "computer"}}
    return document


def _measured(file: Path) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(shutil.copy(file, folder))
        with grabberd.open(path) as capture:
            assert capture.calibration is not None
            made = capture.measure(capture.calibration)
            table = table_of(capture.points(made.run).array)
    told = {"run": made.run, "fields": made.fields, "points": made.points, "verdict": made.verdict}
    return {**told, "in_words": made.in_words, "warnings": list(made.warnings), **table}


def _exact(column: NDArray[Any]) -> str:
    if column.dtype.kind in "OUT":
        return f"text {digest(canonical([str(one) for one in column.tolist()]))}"
    return f"{column.dtype.str} {digest(np.ascontiguousarray(column).tobytes())}"


def _some(column: NDArray[Any]) -> list[Any]:
    some = column[::EVERY][:8]
    if column.dtype.kind == "f":
        return [float(one) if np.isfinite(one) else None for one in some]
    return [str(one) for one in some]
