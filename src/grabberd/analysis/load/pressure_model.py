"""From a field's surface to the pressure on the teat, by the wall's equilibrium."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate
from grabberd.analysis.load.pressure import ChamberVacuum, PressureMap, Shares
from grabberd.analysis.surface.jets import Jets
from grabberd.analysis.surface.surface import Surface
from grabberd.analysis.wall.equilibrium import Equilibrium, Slope, WallShape
from grabberd.analysis.wall.material import VARIED, Zone, varied

Array = NDArray[np.float64]

_FAR = "no targets near enough"
_FOLDED = "the face is folded, or curved more sharply than the wall is thick"


@dataclass(frozen=True, slots=True, eq=False)
class PressureModel:
    """Common part of a capture's pressure maps: positions, material and reference state.

    Attributes:
        u_mm: (N,) material coordinates; `v_mm`: (N,).
        equilibrium: equilibrium of the wall there.
        varied: for each of `VARIED` the equilibrium with that input raised by its σ; None if it has no σ.
        reference: the reference state if it was measured and so has a σ of its own.
        sought_kpa: smallest pressure that the map has to resolve; if σ exceeds both this and the pressure,
            the target has no pressure.
    """

    u_mm: Array
    v_mm: Array
    equilibrium: Equilibrium
    varied: tuple[Equilibrium | None, ...]
    reference: Surface | None
    sought_kpa: float

    @classmethod
    def of(
        cls,
        zones: Sequence[Zone],
        places: tuple[Array, Array],
        reference: Surface | Jets,
        outward: float,
        sought_kpa: float,
    ) -> "PressureModel":
        """The model at some positions.

        Args:
            zones: material of the wall.
            places: u_mm and v_mm, (N,) each.
            reference: the unbent wall, as mounted: a measured surface, or jets (N, 15, 3) taken as exact.
            outward: `Grid.outward`.
            sought_kpa: as in the class.

        Raises:
            AnalysisError: a position lies in no zone or in two.
        """
        measured = isinstance(reference, Surface)
        jets = reference.jets(*places) if isinstance(reference, Surface) else reference

        def equilibrium(these: Sequence[Zone]) -> Equilibrium:
            return Equilibrium.of(these, places[0], jets, outward, exact=not measured)

        others = [varied(zones, name) for name in VARIED]
        changed = tuple(equilibrium(these) if these else None for these in others)
        known = reference if isinstance(reference, Surface) else None
        return cls(*places, equilibrium(zones), changed, known, sought_kpa)

    def map(self, surface: Surface, vacuum: ChamberVacuum) -> PressureMap:
        """The pressure at one field.

        Raises:
            AnalysisError: no target has a pressure.
        """
        return self.maps([surface], [vacuum])[0].determined()

    def maps(self, surfaces: Sequence[Surface], vacuum: Sequence[ChamberVacuum]) -> list[PressureMap]:
        """The pressure at F fields; some maps may have no pressure anywhere (`PressureMap.determined`)."""
        jets = np.stack([surface.jets(self.u_mm, self.v_mm) for surface in surfaces])
        difference = np.array([[one.difference_kpa] for one in vacuum])
        with np.errstate(all="ignore"):
            shape = self.equilibrium.shape(jets)
            slope = self.equilibrium.slope(shape, difference)
            area = self.equilibrium.inner_area(shape)
            material = self._material_shares(jets, shape, slope, difference)
            wall = self.equilibrium.wall_kpa(shape)
            turned = ~((shape.middle.root.values[0] > 0) & (area > 0))
        made = zip(
            surfaces, vacuum, _of_fields(slope), area, np.moveaxis(material, 1, 0), wall, turned, strict=True
        )
        return [self._map(*one) for one in made]

    def _map(
        self,
        surface: Surface,
        vacuum: ChamberVacuum,
        slope: Slope,
        area: Array,
        material: Array,
        wall: Array,
        turned: NDArray[np.bool_],
    ) -> PressureMap:
        points = self._points_share(surface, slope.by_jets, slope.by_reference)
        shares = _shares(vacuum, area, points, material)
        above = _shares(vacuum, area, points, material, above_atmosphere=True)
        contact = _estimate(slope.contact_kpa, shares)
        reasons = self._reasons(surface, turned, contact)
        over = _estimate(slope.contact_kpa - vacuum.liner_kpa, above)
        return PressureMap(self.u_mm, self.v_mm, contact, over, wall, shares, reasons)

    def _reasons(self, surface: Surface, turned: NDArray[np.bool_], contact: Estimate) -> tuple[str, ...]:
        """The first applicable reason why each target has no pressure; empty if it has one.

        `turned`: True where a parallel surface inside is turned over, so that its area is not positive.
        """
        within = surface.within(self.u_mm, self.v_mm)
        folded = ~np.isfinite(contact.sigma) | turned
        least = np.maximum(np.abs(contact.value), self.sought_kpa)
        vague = np.array(
            [
                f"σ of {sigma:.2g} kPa exceeds the pressure sought ({wanted:.2g} kPa)"
                for sigma, wanted in zip(contact.sigma, least, strict=True)
            ]
        )
        reasons = np.select([~within, folded, contact.sigma > least], [_FAR, _FOLDED, vague], "")
        return tuple(map(str, reasons))

    def _points_share(self, surface: Surface, by_jets: Array, by_reference: Array) -> Array:
        share = surface.sigma(_known(by_jets), self.u_mm, self.v_mm)
        if self.reference is None:
            return share
        return np.hypot(share, self.reference.sigma(_known(by_reference), self.u_mm, self.v_mm))

    def _material_shares(self, jets: Jets, shape: WallShape, slope: Slope, difference_kpa: Array) -> Array:
        """(3, F, N) change of the pressure with one σ of each input."""
        depth_mm = self.equilibrium.wall.depth_mm
        shares = np.zeros((len(VARIED), *slope.contact_kpa.shape))
        for share, other in zip(shares, self.varied, strict=True):
            if other is not None:
                same = np.array_equal(other.wall.depth_mm, depth_mm)
                contact = other.contact_kpa(shape if same else other.shape(jets), difference_kpa)
                share[:] = contact - slope.contact_kpa
        return shares


def _of_fields(slope: Slope) -> list[Slope]:
    """Slopes field by field; an exact reference state has a single one, without derivatives."""
    by_reference = np.broadcast_to(slope.by_reference, slope.by_jets.shape)
    return [Slope(*one) for one in zip(slope.contact_kpa, slope.by_jets, by_reference, strict=True)]


def _known(slopes: Array) -> Array:
    """Slopes without non-finite numbers: such targets are refused by their value."""
    return np.nan_to_num(slopes, nan=0.0, posinf=0.0, neginf=0.0)


def _shares(
    vacuum: ChamberVacuum, area: Array, points: Array, material: Array, above_atmosphere: bool = False
) -> Shares:
    """Contributions to σ; above atmosphere the liner's vacuum matters less: teat and wall share it."""
    by_pulsation, by_liner = -1 / area, 1 / area - (1.0 if above_atmosphere else 0.0)
    slope = by_pulsation * vacuum.pulsation_slope_kpa_per_s + by_liner * vacuum.liner_slope_kpa_per_s
    return Shares(
        points_kpa=points,
        pulsation_kpa=by_pulsation * vacuum.pulsation_sigma_kpa,
        liner_kpa=by_liner * vacuum.liner_sigma_kpa,
        time_kpa=slope * vacuum.time_sigma_s,
        material_kpa=material,
    )


def _estimate(value: Array, shares: Shares) -> Estimate:
    return Estimate(value, np.where(np.isfinite(value), shares.sigma_kpa, np.nan))
