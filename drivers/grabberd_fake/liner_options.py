"""Options of the simulated liners, the solved wall and the prescribed ellipse, and of their vacuum."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from grabberd_fake.reading import Choice, Group, by, choice, integer, number, ruled
from grabberd_fake.vacuum import Wave
from grabberd_fake.wall_states import wall_names, wall_states


@dataclass(frozen=True, slots=True)
class WaveOptions:
    """The vacuum in the pulsation chamber, a trapezoid that starts with each period, and in the liner.

    The straight slopes are the phases a and c, but for the 4 kPa at their ends that ISO 5707 counts to b and
    d. With `rising` .5, `open` 0, `falling` .5 and a long period it is a slow ramp, as an empty liner's
    touch point is measured with.

    Attributes:
        system_kpa: the chamber's vacuum in phase b; it is at atmosphere in phase d.
        liner_kpa: vacuum inside the liner, constant.
        rising: proportion of the period in which the chamber's vacuum rises from 0; `open`: stays;
            `falling`: falls to 0; the rest it is at atmosphere.
    """

    system_kpa: float = number(42.0, 0, 53)
    liner_kpa: float = number(42.0, 0, 50)
    rising: float = number(0.12, 0.001, 0.9)
    open: float = number(0.49, 0, 0.9)
    falling: float = number(0.10, 0.001, 0.9)

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.rising + self.open + self.falling > 1 + 1e-12:
            yield "rising + open + falling: more than the whole period"
        if self.system_kpa > self.liner_kpa + 3:
            yield (
                f"system_kpa: {self.system_kpa:g} is more than 3 kPa over liner_kpa {self.liner_kpa:g}: "
                "no wall is solved for that"
            )


@dataclass(frozen=True, slots=True)
class LinerOptions:
    """The pulsating liner: a wall in equilibrium on its teat, solved beforehand (`tools/liner_wall`).

    Attributes:
        wall: liner and teat, DESIGN-TEAT.
        rows: number of targets along X; `columns`: round the wall; `pitch_mm`: on the outer face of the
            mounted liner, half way along it.
        patch_x_mm: place of the middle of the targets along the mounted liner, from half way, away from the
            mouthpiece; the object's X counts from there.
        axis_z_mm: height of the liner's axis in the object's frame.
        target_thickness_mm: height of the targets' centres over the outer face.
        period_s: length of one pulsation; `start_s`: time of the clock at which one of them begins.
        fastest_mm_per_s: the wall moves no faster, and comes behind the vacuum where it would: inertia and
            losses let a liner close in 23 ms at least.
        vacuum: see `WaveOptions`.
    """

    wall: str = ruled(Choice(tuple(wall_names())), "reference-round")
    rows: int = integer(18, 1, 60)
    columns: int = integer(6, 1, 30)
    pitch_mm: float = number(6.5, 1, 50)
    patch_x_mm: float = number(0.0, -60, 60)
    axis_z_mm: float = number(-9.0, -100, 100)
    target_thickness_mm: float = number(0.0, 0, 1)
    period_s: float = number(1.0, 0.1, 120)
    start_s: float = number(0.0, 0, 120)
    fastest_mm_per_s: float = number(400.0, 10, 10000)
    vacuum: WaveOptions = field(default_factory=WaveOptions, metadata=by(Group(WaveOptions)))

    @property
    def wave(self) -> Wave:
        """The vacuum."""
        vacuum, start = self.vacuum, self.start_s / self.period_s
        return Wave(
            self.period_s,
            vacuum.system_kpa,
            start,
            vacuum.rising,
            start + vacuum.rising + vacuum.open,
            vacuum.falling,
            vacuum.liner_kpa,
        )

    @property
    def outer_radius_mm(self) -> float:
        """Radius of the mounted wall's outer face, half way along it."""
        design = wall_states(self.wall).about["design"]
        return float(design["radius_mm"] + design["wall_mm"] / 2)

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.columns * self.pitch_mm > 2 * math.pi * self.outer_radius_mm:
            yield f"columns: {self.columns} columns of {self.pitch_mm:g} mm do not fit round the wall"
        end_mm = wall_states(self.wall).x_mm[-1]
        if abs(self.patch_x_mm) + (self.rows - 1) / 2 * self.pitch_mm > end_mm:
            yield (
                f"rows: {self.rows} rows of {self.pitch_mm:g} mm about {self.patch_x_mm:g} mm reach over the "
                f"wall's end at ±{end_mm:g} mm"
            )


@dataclass(frozen=True, slots=True)
class MaterialOptions:
    """The wall's material. It determines the true tension and pressure, not the movement.

    Attributes:
        law: `neo_hookean` (incompressible, shear modulus E/3) or `linear` (Hooke in plane stress, in
            the stretches less one).
        e_mpa: Young's modulus; `poisson`: Poisson's ratio, for stretching and bending.
        pretension_n: axial mounting force: tension F/(2πR) in the open wall, without hoop tension.
    """

    law: str = choice("neo_hookean", "linear")
    e_mpa: float = number(3.0, 0.01, 100)
    poisson: float = number(0.5, 0, 0.5)
    pretension_n: float = number(60.0, 0, 500)

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.law == "neo_hookean" and self.poisson != 0.5:
            yield f"poisson: {self.poisson:g}, but neo_hookean rubber is incompressible: 0.5"


@dataclass(frozen=True, slots=True)
class VacuumOptions:
    """The vacuum in the pulsation chamber, a trapezoid, and in the liner. The wall lags behind the chamber's.

    Attributes:
        system_kpa: the chamber's vacuum while the liner is open; it is at atmosphere while it is closed.
        liner_kpa: vacuum inside the liner, constant.
        rising: proportion of the period in which the chamber's vacuum rises from 0; `falling`: falls to 0.
        opening_lag: proportion of the period from the start of the rise to the start of the wall's opening;
            `closing_lag`: from the start of the fall to the start of the wall's closing.
    """

    system_kpa: float = number(42.0, 9, 80)
    liner_kpa: float = number(42.0, 0, 80)
    rising: float = number(0.12, 0.01, 0.9)
    falling: float = number(0.10, 0.01, 0.9)
    opening_lag: float = number(0.04, 0, 0.5)
    closing_lag: float = number(0.03, 0, 0.5)


@dataclass(frozen=True, slots=True)
class EllipseOptions:
    """A tube that flattens along prescribed ellipses: for geometry only, see `EllipseLiner`.

    Attributes:
        radius_mm: radius of the open wall's middle surface; `wall_mm`: thickness; `length_mm`: length.
        axis_z_mm: height of its axis in the object's frame.
        deflection_mm: deflection towards the axis in the middle of its length when closed.
        period_s: length of one pulsation.
        opening: proportion of the period that wall phase a takes; `open`: b; `closing`: c; d the rest.
        rows: number of targets along X; `columns`: round the wall; `pitch_mm`: along the middle surface.
        target_thickness_mm: height of the targets' centres over the outer face.
        material: see `MaterialOptions`; `vacuum`: see `VacuumOptions`.
    """

    radius_mm: float = number(12.5, 5, 30)
    wall_mm: float = number(2.5, 0.5, 5)
    length_mm: float = number(130.0, 20, 300)
    axis_z_mm: float = number(-9.0, -100, 100)
    deflection_mm: float = number(5.0, 0, 20)
    period_s: float = number(1.0, 0.1, 60)
    opening: float = number(0.15, 0.02, 0.9)
    open: float = number(0.45, 0, 0.9)
    closing: float = number(0.15, 0.02, 0.9)
    rows: int = integer(18, 1, 60)
    columns: int = integer(6, 1, 30)
    pitch_mm: float = number(6.5, 1, 50)
    target_thickness_mm: float = number(0.0, 0, 1)
    material: MaterialOptions = field(default_factory=MaterialOptions, metadata=by(Group(MaterialOptions)))
    vacuum: VacuumOptions = field(default_factory=VacuumOptions, metadata=by(Group(VacuumOptions)))

    @property
    def targets_over_middle_mm(self) -> float:
        """Distance of the targets from the middle surface."""
        return self.wall_mm / 2 + self.target_thickness_mm

    @property
    def wave(self) -> Wave:
        """The vacuum, which leads the wall's movement."""
        vacuum = self.vacuum
        return Wave(
            self.period_s,
            vacuum.system_kpa,
            -vacuum.opening_lag,
            vacuum.rising,
            self.opening + self.open - vacuum.closing_lag,
            vacuum.falling,
            vacuum.liner_kpa,
        )

    def check(self) -> Iterator[str]:
        """Problems that involve several keys."""
        if self.opening + self.open + self.closing > 1 + 1e-12:
            yield "opening + open + closing: more than the whole period"
        if self.deflection_mm > 0.7 * self.radius_mm:
            yield f"deflection_mm: {self.deflection_mm:g} is more than .7 of the radius {self.radius_mm:g}"
        if self.columns * self.pitch_mm > 2 * math.pi * self.radius_mm:
            yield f"columns: {self.columns} columns of {self.pitch_mm:g} mm do not fit round the wall"
        if (self.rows - 1) * self.pitch_mm > self.length_mm:
            yield f"rows: {self.rows} rows of {self.pitch_mm:g} mm are longer than {self.length_mm:g} mm"
        yield from self._check_vacuum()

    def _check_vacuum(self) -> Iterator[str]:
        between = self.opening + self.open + self.vacuum.opening_lag - self.vacuum.closing_lag
        if self.vacuum.rising > between + 1e-12:
            yield "vacuum.rising: the vacuum falls before it has risen"
        if self.vacuum.falling > 1 - between + 1e-12:
            yield "vacuum.falling: the vacuum rises before it has fallen"
