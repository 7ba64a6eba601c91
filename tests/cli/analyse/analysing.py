"""`grabberd analyse` as its tests call it: with which inputs, what it wrote, said or refused."""

import csv
from pathlib import Path
from typing import Any

import yaml
from typer.testing import CliRunner, Result

from core.chain.milking import CONSTANT
from core.chain.milking import MATERIAL as EXAMPLE
from grabberd.cli.app import app
from grabberd.errors import (
    GrabberdError,
)
from grabberd_liner.chain.analysis.columns import TABLES

MATERIAL = {name: value for name, value in EXAMPLE.items() if not name.endswith("_end_mm")}
"""Without the ends that hold the liner: pressures take long, and are the same as those of the processes."""
LOGGED = {"pulsation": "log", "liner": "log", "offset": {"s": -0.3, "sigma_s": 0.001}}
INPUTS: dict[str, Any] = {
    "reference": "nominal",
    "material": MATERIAL,
    "vacuum": CONSTANT,
    "plane": "symmetry",
    "heights_mm": [-10, 0, 10],
    "phases": 4,
    "sought_kpa": 20.0,
}
CSV = {f"{name}.csv" for name in TABLES}


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["analyse", *(str(word) for word in words)])


def refusal(kind: type[GrabberdError], *words: object) -> GrabberdError:
    error = run(*words).exception
    assert isinstance(error, kind), error
    assert error.hint
    return error


def said(result: Result) -> str:
    """All of it, without the line ends that the width of the terminal makes."""
    assert result.exit_code == 0, (result.output, result.exception)
    return " ".join(result.output.split())


def written(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def inputs_file(folder: Path, document: object) -> Path:
    path = folder / "inputs.yaml"
    path.write_text(yaml.safe_dump(document))
    return path


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as file:
        return list(csv.DictReader(file))


def refused(
    kind: type[GrabberdError], capture: Path, folder: Path, *more: object, **changes: Any
) -> GrabberdError:
    """Of these changes to the inputs; nothing is left behind."""
    inputs = inputs_file(folder, {**INPUTS, **changes})
    error = refusal(kind, capture, "--inputs", inputs, *more, "--out", folder / "out")
    assert not (folder / "out").exists() or not written(folder / "out")
    return error
