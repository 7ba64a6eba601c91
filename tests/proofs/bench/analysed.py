"""Captures of the simulated ellipse, rendered, measured and analysed, with what is true of every state."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tests.core.chain.closures import wall_phases_of
from tests.proofs.bench.accuracy import Scene

from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.measure import measure_fields
from grabberd_fake import FakeOptions
from grabberd_fake.ellipse_truth import WallTruth, truth_of_wall
from grabberd_fake.liner import closure, profile
from grabberd_fake.truth import truth_at
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.analyse import Analysis, analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.wall_state import FieldPoints

Array = NDArray[np.float64]

FIELDS = 128
PERIOD_S = 0.97
HEIGHTS_MM = (-30.0, 0.0, 30.0)
PHASES = 12


@dataclass(frozen=True)
class Case:
    """What is captured: the picture's line jitter, the mirrors, the liner's radius, the bits and their lines.

    Strain counts from the nominal shape, or from a phase of the mean cycle.
    """

    name: str
    bits: int = 8
    doubled: bool = False
    jitter_px: float = 0.12
    mirror_error_px: float = 0.0
    radius_mm: float = 12.5
    reference_phase: float | None = None

    @property
    def options(self) -> dict[str, Any]:
        """As the driver takes them."""
        return {
            "scene": "ellipse",
            "seed": 3,
            "picture": {"jitter_px": self.jitter_px},
            "rig": {"mirror_error_px": self.mirror_error_px},
            "ellipse": {"period_s": PERIOD_S, "radius_mm": self.radius_mm},
        }


@lru_cache(maxsize=4)
def _scene(jitter_px: float, mirror_error_px: float, radius_mm: float) -> Scene:
    options = Case("", jitter_px=jitter_px, mirror_error_px=mirror_error_px, radius_mm=radius_mm).options
    return Scene(options, FIELDS)


class Analysed:
    """One case: its fields, its analysis, and the truth at the same moments."""

    def __init__(self, case: Case) -> None:
        self.case = case
        scene = _scene(case.jitter_px, case.mirror_error_px, case.radius_mm)
        setup = replace(scene.setup, line_jitter_px=case.jitter_px)
        fields = requantised(scene.fields, case.bits, doubled=case.doubled)
        measured = list(measure_fields(fields, setup))
        self.start_ns = measured[0].time_ns
        self.fields = [
            FieldPoints(one.n, TimedPoints((one.time_ns - self.start_ns) / 1e9, one.points))
            for one in measured
        ]
        self.grid = Grid.of(setup.object_model)
        self.liner = FakeOptions.read(case.options).ellipse

    @cached_property
    def analysis(self) -> Analysis:
        """Of all fields, with their mean cycle."""
        return self.analysed(self.fields)

    def analysed(self, fields: Sequence[FieldPoints]) -> Analysis:
        """Of some fields."""
        return analyse([fields], self.grid, read_inputs(self._inputs(), self.grid))

    def _inputs(self) -> Mapping[str, Any]:
        """All that the wall and the vacuum truly are."""
        liner, made, phase = self.liner, self.liner.material, self.case.reference_phase
        material = {
            "E_mpa": made.e_mpa,
            "wall_mm": liner.wall_mm,
            "poisson": made.poisson,
            "F0_n": made.pretension_n,
            "radius_mm": liner.radius_mm,
            "target_mm": liner.target_thickness_mm,
            "law": made.law,
        }
        return {
            "reference": "nominal" if phase is None else {"phase": phase},
            "material": material,
            "vacuum": {
                "pulsation": "log",
                "liner": "log",
                "log": self._log(),
                "offset": {"s": 0.0, "sigma_s": 0.0},
            },
            "plane": "symmetry",
            "sought_kpa": 5,
            "heights_mm": list(HEIGHTS_MM),
            "phases": PHASES,
        }

    def _log(self) -> str:
        time_s = np.arange(-1.0, FIELDS / 50 + 1.0, 0.001)
        chamber = pulsation_kpa(self.liner, self.start_ns / 1e9 + time_s)
        rows = (
            f"{t:.4f},{kpa:.5f},{self.liner.vacuum.liner_kpa}" for t, kpa in zip(time_s, chamber, strict=True)
        )
        return "\n".join(["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa", *rows])

    def moments_ns(self, averaged: bool) -> list[int]:
        """Of the analysis' states, on the driver's clock."""
        found = self.analysis
        if not averaged:
            return [self.start_ns + round(field.timed.time_s * 1e9) for field in found.fields]
        assert found.cycle is not None
        pulsation = found.cycle.pulsation
        begin_s = pulsation.runs[0].start_s + pulsation.period_s
        return [self.start_ns + round((begin_s + p * pulsation.period_s) * 1e9) for p in found.phase]

    def wall(self, moment_ns: int) -> WallTruth:
        """Of the middle surface."""
        return truth_of_wall(self.case.options, moment_ns)

    @property
    def wall_open(self) -> WallTruth:
        """Of the open liner, at the end of its opening."""
        return self.wall(round(self.liner.opening * self.liner.period_s * 1e9) + 1)

    @property
    def wall_phases_s(self) -> Array:
        """(4,) a, b, c, d by the exact movement of the targets that are seen, 10 to 90 % of its stroke."""
        time_s = np.linspace(0, self.liner.period_s, 4001)
        often = self._often_seen
        return wall_phases_of(time_s, np.stack([self.targets_mm(round(1e9 * t))[often] for t in time_s]))

    @property
    def _often_seen(self) -> NDArray[np.bool_]:
        ids = truth_at(self.case.options, 0).ids
        seen: Array = np.mean([np.isin(ids, one.timed.points.target) for one in self.fields], axis=0)
        return seen >= 0.5

    def targets_mm(self, moment_ns: int) -> Array:
        """(N, 3) the targets."""
        return truth_at(self.case.options, moment_ns).xyz_mm

    def distance_mm(self, moment_ns: int) -> Array:
        """Of the outer face from the axis, where it faces the cameras, at the sections' heights."""
        liner = self.liner
        x_mm = np.linspace(-liner.length_mm / 2, liner.length_mm / 2, 4001)
        shape, slope = profile(x_mm, liner.length_mm)
        depth = liner.deflection_mm * closure(liner, moment_ns)
        steep = np.hypot(1.0, depth * slope)
        off = liner.targets_over_middle_mm
        return np.interp(
            HEIGHTS_MM, x_mm + off * depth * slope / steep, liner.radius_mm - depth * shape + off / steep
        )
