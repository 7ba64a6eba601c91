"""What an analysis costs, beside splines whose σ is drawn by lot, and the whole command with report and files
by turns with that of another build, the folder of whose sources `GRABBERD_BEFORE` names.
"""

import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from tests.proofs.bench.analysed import Analysed

from grabberd.config import shipped_configs
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.jets import ORDERS
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms

Array = NDArray[np.float64]

TIMED = 50
DRAWS = 100
ROUNDS = 2


def cost(made: Analysed) -> str:
    """Of a chain of fields, beside bivariate splines whose σ is drawn by lot."""
    ours = min(_taken(lambda: made.analysed(made.fields[:TIMED])) for _ in range(ROUNDS))
    theirs = min(_taken(lambda: _by_lot(made)) for _ in range(ROUNDS))
    return (
        f"{TIMED} fields, everything with σ (surface, curvature, strain, tension, three sections, "
        f"volume, area): {ours:.1f} s of one core, to be 2. The curvature alone of as many, from scipy's "
        f"`RectBivariateSpline` with σ by {DRAWS} draws: {theirs:.1f} s; ratio {ours / theirs:.2f}."
    )


def _taken(work: Callable[[], object]) -> float:
    before = time.process_time()
    work()
    return time.process_time() - before


def _by_lot(made: Analysed) -> Array:
    """σ of both curvatures at the targets: spline, noise, spline again."""
    grid, rng = made.grid, np.random.default_rng(0)
    rows, columns = int(grid.row.max()) + 1, int(grid.column.max()) + 1
    u_mm, v_mm = np.arange(rows) * grid.u_pitch_mm, np.arange(columns) * grid.v_pitch_mm
    spread = []
    for _ in range(TIMED):
        drawn = [grid.nominal_mm + rng.normal(0, 0.02, grid.nominal_mm.shape) for _ in range(DRAWS)]
        spread.append(np.std([_curvature(grid, places, u_mm, v_mm) for places in drawn], axis=0))
    return np.array(spread)


def _curvature(grid: Grid, places: Array, u_mm: Array, v_mm: Array) -> Array:
    jets = np.zeros((len(grid), len(ORDERS), 3))
    for axis in range(3):
        heights = places[:, axis].reshape(len(u_mm), len(v_mm))
        spline = RectBivariateSpline(u_mm, v_mm, heights, kx=5, ky=5)
        for place, (i, j) in enumerate(ORDERS[:6]):
            jets[:, place, axis] = spline.ev(grid.u_mm, grid.v_mm, i, j)
    return curvature_per_m(outer_forms(jets, grid.outward))


COUNTS, RAMP_S = (200, 2000), 60
TURNS = 2
_COMMAND = "from grabberd.cli import main; main()"
_KIB_PER_MIB = 1024
_CHANNELS = {"pulsation": "channel", "liner": "channel"}


def table_of_commands() -> str:
    """The command `grabberd analyse` on captures of the simulated liner, and on a ramp with the empty one."""
    sources = {"this build": str(Path(__file__).parents[3] / "src")}
    if before := os.environ.get("GRABBERD_BEFORE"):
        sources["the one before"] = before
    with tempfile.TemporaryDirectory() as name:
        rows = list(_rows_of_commands(Path(name), sources))
    heads = [f"{title}, {unit}" for title in sources for unit in ("s", "MiB")]
    return "\n".join(
        [
            "`grabberd analyse` at 8 bits with all inputs, CSV tables and report. Processor time of the",
            f"process and its children, least of {TURNS}, by turns; the peak of its memory.",
            "",
            f"| capture | {' | '.join(heads)} |",
            "|---" * (1 + len(heads)) + "|",
            *rows,
        ]
    )


def _rows_of_commands(folder: Path, sources: Mapping[str, str]) -> Iterator[str]:
    material = _shipped("analysis/liner.yaml")["material"]
    given = {"material": material, "vacuum": _CHANNELS, "plane": "symmetry", "sought_kpa": 1.0}
    for count in COUNTS:
        capture = folder / f"{count}.grab"
        _run(folder, "capture", "--config", _config(folder, "fake.yaml"), f"--fields={count}", "--bits=8")
        (folder / "captured.grab").rename(capture)
        yield _row(f"{count} fields", folder, capture, {**given, "reference": {"phase": 0.3}}, sources)
    stage = [sys.executable, "-m", "grabberd_fake", "stage", str(folder / "stage.yaml")]
    subprocess.run([*stage, "--wall=reference-empty", "--ramp"], check=True, capture_output=True)
    _run(
        folder,
        "capture",
        "--config",
        _config(folder, "liner-test.yaml"),
        f"--duration-s={RAMP_S}",
        "--bits=8",
    )
    ramp = {**given, "teat": "none", "reference": {"field": 0}}
    yield _row(f"a ramp of {RAMP_S} s", folder, folder / "captured.grab", ramp, sources)


def _shipped(name: str) -> dict[str, Any]:
    document = yaml.safe_load((shipped_configs() / name).read_text())
    assert isinstance(document, dict)
    return document


def _config(folder: Path, name: str) -> str:
    """A shipped configuration, with the documents that it names and its stage in the folder."""
    document = _shipped(name)
    for device in document["devices"].values():
        device |= {key: str(shipped_configs() / device[key]) for key in ("calibration", "object")}
    for one in (*document["devices"].values(), *document["loggers"].values()):
        if "stage" in one["options"]:
            one["options"]["stage"] = str(folder / "stage.yaml")
    document["storage"] = {"directory": str(folder / "state")}
    (folder / name).write_text(yaml.safe_dump(document))
    return str(folder / name)


def _row(
    title: str, folder: Path, capture: Path, inputs: Mapping[str, Any], sources: Mapping[str, str]
) -> str:
    (folder / "inputs.yaml").write_text(yaml.safe_dump(dict(inputs)))
    taken: dict[str, list[tuple[float, float]]] = {one: [] for one in sources}
    for turn in range(TURNS):
        for index, (one, source) in enumerate(sources.items()):
            out = folder / f"{capture.stem}-{turn}-{index}"
            arguments = (
                folder,
                source,
                str(capture),
                "--inputs",
                str(folder / "inputs.yaml"),
                "--out",
                str(out),
            )
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                taken[one].append(pool.apply(_cost_of_command, arguments))
    cells = [f"{min(values):.1f}" for costs in taken.values() for values in zip(*costs, strict=True)]
    return f"| {title} | {' | '.join(cells)} |"


def _cost_of_command(folder: Path, source: str, *arguments: str) -> tuple[float, float]:
    """Processor time in s and the peak in MiB, in a process that has no other children."""
    environment = {**os.environ, "PYTHONPATH": source}
    command = [sys.executable, "-c", _COMMAND, "analyse", *arguments]
    subprocess.run(command, check=True, capture_output=True, cwd=folder, env=environment)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime, used.ru_maxrss / _KIB_PER_MIB


def _run(folder: Path, *arguments: str) -> None:
    command = [sys.executable, "-c", _COMMAND, *arguments, "--out", str(folder / "captured.grab")]
    subprocess.run(command, check=True, capture_output=True)
