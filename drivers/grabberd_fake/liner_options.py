"""Options of the liner: its solved wall, the patch of targets on it, and the vacuum that moves it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from grabberd_fake.reading import Choice, Group, by, integer, number, ruled
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
