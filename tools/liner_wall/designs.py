"""Liners and teats whose states the simulator knows."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from tools.liner_wall.equilibrium import Friction, Push, State, Tube
from tools.liner_wall.mesh import Array, TubeMesh
from tools.liner_wall.rubber import Rubber
from tools.liner_wall.teat import Teat, opposite_wall

LENGTH_MM = 130.0
"""Of the mounted barrel, between the ends that hold it."""
OVALITY = 0.004
"""Of the radius. It decides that the wall flattens towards the camera: a perfect tube has no such side."""
LAYERS, ARC_MM, SLAB_MM = 2, 2.0, 6.5
"""Bricks through the wall, and their size round it and along it. With half as many again, positions move by
18 µm RMS and the load by under 1 %; a target is located to 60 µm.
"""


@dataclass(frozen=True, slots=True)
class Design:
    """A liner as mounted.

    Attributes:
        name: Name in the tables.
        radius_mm: Radius of the wall's middle in the middle of its length, open and mounted.
        wall_mm: Thickness of the mounted wall.
        young_mpa: Young's modulus at small strain; `stiffening`: see `Rubber`.
        pretension_n: Axial force of the mounted liner.
        taper: Growth of the radius per length towards the mouthpiece, at low x.
        friction: Coefficient on the teat.
    """

    name: str
    radius_mm: float = 12.5
    wall_mm: float = 2.5
    young_mpa: float = 3.0
    stiffening: float = 0.0
    pretension_n: float = 60.0
    taper: float = 0.0
    friction: float = 0.0


DESIGNS = (
    Design("reference"),
    Design("thin", radius_mm=11.5, wall_mm=2.0, young_mpa=2.4, pretension_n=40.0),
    Design("stiffening", radius_mm=12.0, wall_mm=2.4, young_mpa=3.4, stiffening=0.5, pretension_n=80.0),
    Design("wide", radius_mm=13.0, wall_mm=2.4, young_mpa=2.6, pretension_n=50.0),
    Design("rubbing", radius_mm=12.0, wall_mm=2.5, young_mpa=2.8, friction=0.3),
    Design("tapered", radius_mm=12.3, wall_mm=2.3, young_mpa=3.0, pretension_n=70.0, taper=0.01),
)

TEATS = (
    None,
    Teat("round", radius_mm=9.8, end_x_mm=15.0, cap_mm=9.8, stiffness_mpa_per_mm=0.010),
    Teat("blunt", radius_mm=10.0, end_x_mm=8.0, cap_mm=8.0, squareness=3.0, stiffness_mpa_per_mm=0.007),
    Teat("pointed", radius_mm=9.4, end_x_mm=20.0, cap_mm=22.0, stiffness_mpa_per_mm=0.016),
)

OFF_CENTRE = (
    replace(TEATS[1], name="round-across", y_mm=1.0),
    replace(TEATS[1], name="round-towards", z_mm=1.0),
)
"""On the reference liner alone: what a teat beside the axis does to an estimate that takes it for centred."""

Sector = tuple[float, float]
QUARTER: Sector = (0.0, np.pi / 2)
UPPER_HALF: Sector = (-np.pi / 2, np.pi / 2)
RIGHT_HALF: Sector = (0.0, np.pi)


@dataclass(frozen=True, slots=True)
class Case:
    """A liner on a teat.

    Attributes:
        design: the liner.
        teat: the teat; None for the empty liner.
        fineness: number of bricks over the usual one, round the wall and along it.
    """

    design: Design
    teat: Teat | None
    fineness: float = 1.0

    @property
    def name(self) -> str:
        """Name of its table."""
        return f"{self.design.name}-{self.teat.name if self.teat else 'empty'}"

    @property
    def sector(self) -> Sector:
        """The angles of the tube that have to be solved; the rest mirrors them.

        Raises:
            ValueError: the teat is moved both ways, which leaves no symmetry.
        """
        if self.teat is None or not (self.teat.y_mm or self.teat.z_mm):
            return QUARTER
        if self.teat.y_mm and self.teat.z_mm:
            raise ValueError(f"{self.name}: the teat is moved both ways; move it along y or along z")
        return UPPER_HALF if self.teat.y_mm else RIGHT_HALF

    def push(self, theta: Array) -> Push:
        """Pressure on the inner face: of the teat, and of the wall's other half.

        Args:
            theta: (…) angles of the mounted tube at the points (…, 3) that it is asked for.
        """
        teat, side = self.teat, np.where(np.abs(theta) <= np.pi / 2, 1.0, -1.0)

        def push(points_mm: Array) -> tuple[Array, Array]:
            pressure, slope = opposite_wall(points_mm, side)
            if teat is not None:
                of_teat = teat.pressure(points_mm)
                pressure, slope = pressure + of_teat[0], slope + of_teat[1]
            return pressure, slope

        return push


def cases() -> Iterator[Case]:
    """Every design on every teat, and the reference liner on teats beside its axis."""
    for design in DESIGNS:
        for teat in TEATS:
            yield Case(design, teat)
    for teat in OFF_CENTRE:
        # Half a tube is eight times the work of a quarter; a fifth fewer bricks each way make it three times.
        yield Case(DESIGNS[0], teat, fineness=0.8)


def mounted(design: Design, fineness: float = 1.0, sector: Sector = QUARTER) -> tuple[Tube, State]:
    """The liner, and its mounted state in which it is all but in equilibrium.

    Args:
        design: the liner.
        fineness: number of bricks over the usual one, round the wall and along it.
        sector: angles of the part that is meshed; it ends in planes of symmetry.
    """
    arcs = round(fineness * np.pi / 2 * design.radius_mm / ARC_MM) * round(np.ptp(sector) / (np.pi / 2))
    mesh = TubeMesh.build(np.linspace(*sector, arcs + 1), LAYERS, round(fineness * LENGTH_MM / SLAB_MM))
    stretch = mounting_stretch(design)
    # Incompressible: stretched by λ, the tube was √λ wider and thicker before.
    loose, there = _positions(mesh, design, np.sqrt(stretch)), _positions(mesh, design, 1.0)
    loose[:, 0] /= stretch
    theta, _, x = mesh.block.T
    held = np.zeros(loose.shape, bool)
    for end in sector:
        held[np.isclose(theta, end), 1 if np.isclose(np.sin(end), 0.0) else 2] = True
    held[np.isclose(x, 0.0) | np.isclose(x, 1.0)] = True
    rubber = Rubber(design.young_mpa / 3, design.stiffening)
    tube = Tube(mesh, loose, rubber, held, Friction(design.friction, there))
    return tube, State(there, np.zeros((len(mesh.bricks.nodes), 4)))


def mounting_stretch(design: Design) -> float:
    """Stretch λ of the mounted tube: F = µ (λ − 1/λ²) (1 + 2 c2/c1 (I1 − 3)) A0 with I1 = λ² + 2/λ."""
    area_mm2 = 2 * np.pi * design.radius_mm * design.wall_mm

    def excess(stretch: float) -> float:
        first = stretch**2 + 2 / stretch - 3
        stress = design.young_mpa / 3 * (stretch - stretch**-2) * (1 + 2 * design.stiffening * first)
        return stress * stretch * area_mm2 - design.pretension_n

    return float(brentq(excess, 1.0, 3.0))


def _positions(mesh: TubeMesh, design: Design, scale: float) -> Array:
    theta, depth, along = mesh.block.T
    x = (along - 0.5) * LENGTH_MM
    middle = design.radius_mm * (1 - OVALITY * np.cos(2 * theta)) - design.taper * x
    radius = scale * (middle + (depth - 0.5) * design.wall_mm)
    return np.column_stack([x, radius * np.sin(theta), radius * np.cos(theta)])
