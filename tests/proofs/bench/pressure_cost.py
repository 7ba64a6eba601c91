"""What an analysis with everything costs, by the number of fields: processor time and memory."""

import multiprocessing
import resource
import time

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.ramps import solved_kpa
from tests.liner.analysis.walls import solved

from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.chain.analysis.wall_state import FieldPoints

Array = NDArray[np.float64]

LINER = "reference-round"
COUNTS = (100, 500)
FIELD_S, PERIOD_S, LINER_KPA = 0.02, 1.0, 42.0
_KIB_PER_MIB = 1024
_OF_MATERIAL = (
    *("E_mpa", "E_sigma_mpa", "wall_mm", "wall_sigma_mm", "F0_n", "F0_sigma_n"),
    *("poisson", "radius_mm", "target_mm", "law", "first_end_mm", "last_end_mm"),
)


def table() -> str:
    """Cost of a short capture and of a long one, and of each further field."""
    found = [_alone(count) for count in COUNTS]
    rows = [
        f"| {count} | {cost_s:.0f} | {mib:.0f} |" for count, (cost_s, mib) in zip(COUNTS, found, strict=True)
    ]
    each_s, each_mib = np.diff(np.array(found), axis=0)[0] / np.diff(COUNTS)
    return "\n".join(
        [
            "Surface, curvature, strain, tension, pressure, load over height, three sections and tables of a",
            "cycle of the solved liner on a round teat, of its fields and its mean cycle; without report and",
            "files. Processor time of one core; the peak of a process that does nothing else.",
            "",
            "| fields | s | MiB |",
            "|---|---|---|",
            *rows,
            f"| each further one | {each_s:.3f} | {each_mib:.2f} |",
        ]
    )


def _alone(count: int) -> tuple[float, float]:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_cost, (count,))


def _cost(count: int) -> tuple[float, float]:
    """Processor time in s, and the process's peak in MiB."""
    liner, known_kpa = solved(LINER), solved_kpa(solved(LINER))
    phase = np.arange(count) * FIELD_S / PERIOD_S
    wave_kpa = np.clip(0.5 - 0.8 * np.cos(2 * np.pi * phase), 0.0, 1.0) * LINER_KPA
    differences_kpa = known_kpa[np.abs(known_kpa - wave_kpa[:, np.newaxis]).argmin(axis=1)]
    fields = [
        FieldPoints(n, TimedPoints(n * FIELD_S, liner.points(float(kpa), n)))
        for n, kpa in enumerate(differences_kpa)
    ]
    (zone,) = liner.zones()
    inputs = {
        "reference": {"field": 0},
        "material": {name: getattr(zone.material, name) for name in _OF_MATERIAL},
        "vacuum": {
            "pulsation": "log",
            "liner": "log",
            "log": _log(differences_kpa),
            "offset": {"s": 0, "sigma_s": 0.0005},
        },
        "plane": {"point_mm": [0, 0, 0], "normal": [0, 0, 1]},
        "sought_kpa": 1.0,
    }
    read = read_inputs(inputs, liner.grid)
    before = time.process_time()
    made = tables(analyse([fields], liner.grid, read))
    cost_s = time.process_time() - before
    assert np.isfinite(made["targets"].column("contact_kpa")).any()
    return cost_s, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / _KIB_PER_MIB


def _log(differences_kpa: Array) -> str:
    """A log whose vacuum is constant for as long as a field lasts, and changes between two."""
    lines = ["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa"]
    for n, difference_kpa in enumerate(differences_kpa):
        at_s = ((n + share) * FIELD_S for share in (-0.4, -0.2, 0.0, 0.2, 0.4))
        lines += [f"{one:.3f},{LINER_KPA - difference_kpa:.4f},{LINER_KPA}" for one in at_s]
    return "\n".join(lines)
