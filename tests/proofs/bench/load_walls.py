"""Closed walls on teats, for judging sums of the contact pressure: solved as solids by `tools/liner_wall`,
which shares no equation with the estimator.

Sections in plane strain, whose rows are all alike, are drawn at random and solved when they are first asked
for; each set has its own seed. Walls in three dimensions are the simulator's tables, by liner.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tools.liner_wall.designs import (
    ARC_MM,
    LAYERS,
    LENGTH_MM,
    OVALITY,
    QUARTER,
    Case,
    Design,
    mounting_stretch,
)
from tools.liner_wall.equilibrium import Friction, NoEquilibrium, State, Tube
from tools.liner_wall.mesh import TubeMesh
from tools.liner_wall.path import Rest, follow
from tools.liner_wall.rubber import Rubber
from tools.liner_wall.table import save_table
from tools.liner_wall.teat import Teat

from grabberd_fake.wall_states import WallStates, wall_states

Array = NDArray[np.float64]

TUNING, HELD_OUT = "tuning", "held-out"
SEEDS = {TUNING: 11, HELD_OUT: 3108}
SECTIONS = {TUNING: 10, HELD_OUT: 38}
LINERS = {TUNING: ("reference", "thin"), HELD_OUT: ("stiffening", "wide", "rubbing", "tapered")}
TEATS = ("round", "blunt", "pointed")
FOLDER = Path("build/load_walls")
"""Where solved sections are kept."""
SECTION_MM = 260.0
"""Length of the tube whose middle a section stands for: its ends are far from the targets."""
_STEP_MPA, _MOST_STATES = 0.004, 60
"""Of the way to the closed section; one that needs more states creases, and another one is drawn."""


class Wall(NamedTuple):
    """A closed wall.

    Attributes:
        states: with the open and the closed one.
        outer_kpa: pressure difference of the closed one.
        plane: true for a section in plane strain.
    """

    states: WallStates
    outer_kpa: float
    plane: bool

    @property
    def length_mm(self) -> float:
        """Between the ends that hold the tube."""
        return SECTION_MM if self.plane else LENGTH_MM


def walls(of: str) -> Iterator[Wall]:
    """The walls of a set."""
    random = np.random.default_rng(SEEDS[of])
    count = 0
    for number in range(10 * SECTIONS[of]):
        case, outer_kpa = _drawn(random, f"{of}-{SEEDS[of]}-{number}")
        if count < SECTIONS[of] and (states := _solved(case, outer_kpa)):
            count += 1
            yield Wall(states, outer_kpa, True)
    for liner in LINERS[of]:
        for teat in TEATS:
            yield Wall(wall_states(f"{liner}-{teat}"), random.uniform(26.0, 42.0), False)


def _drawn(random: np.random.Generator, name: str) -> tuple[Case, float]:
    part = random.uniform
    design = Design(
        name,
        radius_mm=part(11.5, 13.0),
        wall_mm=part(2.0, 2.6),
        young_mpa=part(2.4, 3.6),
        stiffening=part(0.2, 0.6) * random.integers(2),
        pretension_n=part(40.0, 80.0),
        friction=part(0.1, 0.3) * (random.random() < 1 / 3),
    )
    teat = Teat(
        "teat",
        radius_mm=min(part(9.0, 10.4), design.radius_mm - design.wall_mm / 2 - 0.5),
        end_x_mm=1e4,
        cap_mm=10.0,
        taper=0.0,
        stiffness_mpa_per_mm=0.005 * part(1.0, 1.9) ** 2,
        firm_mm=part(4.0, 8.0),
    )
    return Case(design, teat), part(26.0, 42.0)


def _solved(case: Case, outer_kpa: float) -> WallStates | None:
    """A section, from `FOLDER` if it is there; None if it creases, or presses too hard for a table."""
    path = FOLDER / f"{case.name}.npz"
    if not path.exists():
        FOLDER.mkdir(parents=True, exist_ok=True)
        try:
            save_table(path, case, *_followed(case, outer_kpa))
        except (NoEquilibrium, OverflowError):
            path.touch()
    return WallStates(case.name, FOLDER) if path.stat().st_size else None


def _followed(case: Case, outer_kpa: float) -> tuple[Tube, list[Rest]]:
    """The open and the closed section.

    Raises:
        NoEquilibrium: it creases.
    """
    design = case.design
    arcs = round(np.pi / 2 * design.radius_mm / ARC_MM)
    mesh = TubeMesh.build(np.linspace(*QUARTER, arcs + 1), LAYERS, 1)
    stretch = mounting_stretch(design)
    theta, depth, along = mesh.block.T
    radius = design.radius_mm * (1 - OVALITY * np.cos(2 * theta)) + (depth - 0.5) * design.wall_mm
    there = np.column_stack([(along - 0.5) * SECTION_MM, radius * np.sin(theta), radius * np.cos(theta)])
    held = np.zeros(there.shape, bool)
    held[:, 0] = True
    held[np.isclose(theta, 0.0), 1] = True
    held[np.isclose(theta, np.pi / 2), 2] = True
    loose = there * np.array([1 / stretch, np.sqrt(stretch), np.sqrt(stretch)])
    rubber = Rubber(design.young_mpa / 3, design.stiffening)
    tube = Tube(mesh, loose, rubber, held, Friction(design.friction, there))
    start = State(there, np.zeros((len(mesh.bricks.nodes), 4)))
    rests = list[Rest]()
    for rest in follow(tube, start, 0.0, outer_kpa / 1000, _STEP_MPA, case.push(mesh.inner_angles())):
        rests.append(rest)
        if len(rests) > _MOST_STATES or rest.snapped:
            raise NoEquilibrium(f"{case.name} creases at {1000 * rest.outer_mpa:.3g} kPa")
    return tube, [rests[0], rests[-1]]
