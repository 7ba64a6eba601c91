"""The liner's pressure on the teat as a map.

From a field's points to the pressure on the teat, by the wall's equilibrium, state after state of a
capture.

A linearised model holds for about a millimetre round its state: there it gives the load to a tenth of its σ
in a hundredth of the time. A cycle passes through some dozen such states, again and again, so the capture's
length hardly counts. Loads are best sought in the order of the wall's departure, from state to state nearby.
"""

import re
from collections import Counter
from collections.abc import Sequence
from sys import intern
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.load_fit import (
    MISFIT_ALARM,
    NEAR_MM,
    Posterior,
    Response,
    fit_load,
    posterior,
)
from grabberd_liner.analysis.load.load_profile import LoadProfile, Sections, is_empty, profile_heights
from grabberd_liner.analysis.load.mounting import Mounting
from grabberd_liner.analysis.load.targets import Sights
from grabberd_liner.analysis.load.teat_map import TeatMap, teat_map
from grabberd_liner.analysis.load.wall_model import (
    USUAL,
    WIDE,
    Difference,
    LoadMean,
    LoadPrior,
    TubePrior,
    WallModel,
)
from grabberd_liner.analysis.load.wall_surfaces import FaceLattice, MiddleSurface, MiddleSurfaces, OuterFace
from grabberd_liner.analysis.surface.fitting import LARGEST_SHARE_OUT, OUTLYING
from grabberd_liner.analysis.wall.material import Material, Zone
from grabberd_liner.analysis.wall.splines import Basis

_VALUES = re.compile(r" of \S+ kPa| \([^)]*\)")
"""Parts of a reason that differ from target to target."""


class ChamberVacuum(NamedTuple):
    """The vacuum on both sides of the wall at one field, kPa below atmosphere.

    Attributes:
        pulsation_kpa: vacuum in the pulsation chamber; `liner_kpa`: in the liner.
        pulsation_sigma_kpa: σ of `pulsation_kpa`; `liner_sigma_kpa`: σ of `liner_kpa`.
        pulsation_slope_kpa_per_s: rate of change of `pulsation_kpa`; `liner_slope_kpa_per_s`: of `liner_kpa`.
        time_sigma_s: σ of the offset between the clocks of the camera and of the vacuum.
    """

    pulsation_kpa: float
    liner_kpa: float
    pulsation_sigma_kpa: float
    liner_sigma_kpa: float
    pulsation_slope_kpa_per_s: float = 0.0
    liner_slope_kpa_per_s: float = 0.0
    time_sigma_s: float = 0.0

    @property
    def difference_kpa(self) -> float:
        """p_pulsation − p_liner."""
        return self.liner_kpa - self.pulsation_kpa

    @property
    def difference_sigma_kpa(self) -> float:
        """σ of the difference, from both gauges and from the offset between the clocks."""
        slope = self.liner_slope_kpa_per_s - self.pulsation_slope_kpa_per_s
        return float(
            np.linalg.norm([self.pulsation_sigma_kpa, self.liner_sigma_kpa, slope * self.time_sigma_s])
        )


class PressureMap(NamedTuple):
    """The pressure at N targets at one field.

    Attributes:
        contact_kpa: (N,) p_contact on the inner face, above the pressure in the liner.
        mean_kpa: mean of `contact_kpa` over the supported targets, its σ from their full covariance. Targets
            whose own pressure is too uncertain count as well: without them, it would be that of the pressed
            ones. NaN if no target has a pressure.
        above_atmosphere_kpa: (N,) the same above atmosphere: minus the vacuum in the liner.
        misfit: of points and prior by the wall in equilibrium, per measured coordinate; .3 to 1.2 is usual.
        unseen_kpa: (N,) `contact_kpa` less what it would be if the unseen half were free; None where it is.
        supported: (N,) True for targets that are supported by data.
        reason: (N,) reason why a target has no pressure of its own; empty if it has one.
        profile: the load over height, x in the object's frame; None if the wall's equilibrium says nothing
            of it. Of an empty liner it is what opposite walls press each other with.
        middle: the wall's middle surface in this state; None if points and wall contradict each other.
    """

    contact_kpa: Estimate
    mean_kpa: Estimate
    above_atmosphere_kpa: Estimate
    misfit: float
    unseen_kpa: Array | None
    supported: Mask
    reason: tuple[str, ...]
    profile: LoadProfile | None = None
    middle: MiddleSurface | None = None

    @property
    def usable(self) -> Mask:
        """(N,) True for targets with a pressure."""
        return np.array([not reason for reason in self.reason], np.bool_)

    def determined(self) -> "PressureMap":
        """The map itself.

        Raises:
            AnalysisError: no target has a pressure.
        """
        if not all(self.reason):
            return self
        kinds = Counter(_VALUES.sub("", reason) for reason in self.reason)
        most = ", or ".join(kind for kind, _ in kinds.most_common()) or "none was asked for"
        sigma = self.contact_kpa.sigma
        known = sigma[np.isfinite(sigma)]
        median = f"median σ {np.median(known):.2g} kPa" if len(known) else "no σ is a number"
        raise AnalysisError(
            f"none of {len(self.reason)} places has its pressure determined: {most} ({median})",
            "capture with more bits or a finer target grid, or average over phases",
        )


REACH_MM = 0.8
"""Movement of the wall within which a linearised model holds: at 1 mm contact pressures err by up to .2 σ."""
EXACT_MM = 0.1
"""The same for sums of pressures: the errors of all heights are alike there, and their σ is small."""
_MOST = 2
"""Linearised models kept, of 35 MB each with their followers: enough for states in the order of the wall's
departure."""


class LoadSeries:
    """The loads of one wall.

    Attributes:
        model: the wall's.
    """

    def __init__(self, model: WallModel) -> None:
        """Begins without any state."""
        self.model = model
        self._known: list[Response] = []

    def load(
        self,
        sights: Sights,
        difference: Difference,
        mean: LoadMean = USUAL,
        reach_mm: float = REACH_MM,
    ) -> Posterior:
        """The load in one state.

        Args:
            sights: what was seen.
            difference: pressure difference.
            mean: prior mean of the load.
            reach_mm: movement of the wall within which a linearised model is good enough.

        Raises:
            AnalysisError: the wall does not settle.
        """
        found = self._near_known(sights, difference, mean, reach_mm)
        if found is None or found.j > MISFIT_ALARM:
            begun = self._begun(sights, difference, mean)
            if found is None or begun.j < found.j:
                found = begun
        if not any(found.response is known for known in self._known):
            self._known = [*self._known[1 - _MOST :], found.response]
        return found

    def _near_known(
        self, sights: Sights, difference: Difference, mean: LoadMean, reach_mm: float
    ) -> Posterior | None:
        """The load, sought from the nearest state that is known; None if it is not found from there."""
        if not self._known:
            return None
        try:
            found = posterior(self._nearest(sights), sights, difference, mean)
            if found.longest_mm < reach_mm:
                return found
            start = found.moved(min(1.0, REACH_MM / found.longest_mm))
            return fit_load(self.model, sights, difference, start, mean, min(NEAR_MM, reach_mm))[0]
        except AnalysisError:
            return None  # the open wall is a safer start, and decides whether there is a load at all

    def _begun(self, sights: Sights, difference: Difference, mean: LoadMean) -> Posterior:
        """The load, sought from the open wall; first by the targets that both views see.

        From afar, a ray that a target may slide along leads into a wrong fold.
        """
        of_points = sights.of_both_views()
        found, _ = fit_load(self.model, of_points, difference, mean=mean)
        if len(of_points) == len(sights):
            return found
        return fit_load(self.model, sights, difference, found.moved(), mean)[0]

    def _nearest(self, sights: Sights) -> Response:
        places_mm = np.stack([one.linear.places_mm.ravel() for one in self._known])
        away = np.abs(sights.value - sights.of_places(places_mm)).max(axis=1)
        return self._known[int(np.argmin(away))]


UNSEEN = ("free", "mirrored")
"""What is taken for the half of the wall that no camera sees: nothing, or the seen half's mirror image."""
FASTEST_MM_PER_S = 300.0
"""Speed beyond which a wall is not in equilibrium. Its inertia is .15 kPa there, with 7 mm of milk behind it
.6 kPa, and both grow with the square of the speed."""
_EXACT = 1e-4
"""σ in kPa of a pressure difference that is given as exact."""
_ARC_MM = 10.0
"""How far round the wall from its middle a compression is averaged, if targets reach as far: on its teat, a
wall is hardly flat for longer."""
_MEAN_SHARE = 0.03
"""Share by which a mean errs beyond its covariance, on walls solved as solids."""
_ODDS = 2.0
"""Of the usual prior mean over `WIDE`, before the liner's values are looked at."""
_CLOSING_KPA = (12.0, 20.0)
"""Pressure difference from which on a wall may press far round its teat; from the second one on that counts
in full, for a load must not leap from field to field."""
_BULGE_MM = 0.5
"""A closed wall whose middle has moved outward by more than that has folded across the view."""
_FAR = "no targets near enough"
_ACROSS = (
    "the wall bulges towards the cameras: it presses the teat from the sides, which no camera sees; turn the"
    " liner by a quarter"
)
_EMPTY = "opposite walls meet wherever the liner presses: it presses itself, there is no teat in it"


class SettledWall(NamedTuple):
    """The wall in equilibrium at one field.

    Attributes:
        found: the wall; `free`: with a free hidden half, where `found` takes it for a mirror image.
        left_out: indices of targets that the others contradict.
        alone: (N,) True for targets that one view alone sees, and the others do not contradict.
        other: the wall by the less probable prior of the load; None if it need not be looked at.
        share: probability of that.
    """

    found: Posterior
    free: Posterior | None
    left_out: tuple[int, ...]
    alone: Mask
    other: Posterior | None = None
    share: float = 0.0

    @property
    def contradicted(self) -> bool:
        """True if points and wall contradict each other."""
        return self.found.j > MISFIT_ALARM

    def contact_kpa(self, basis: Basis) -> Joint:
        """(N,) contact pressure at points of the mounted wall, by both priors."""
        joint = Joint(*self.found.contact_kpa(basis))
        return joint if self.other is None else joint.mixed(Joint(*self.other.contact_kpa(basis)), self.share)


class PressureModel:
    """Common part of a capture's pressure maps: the mounted wall, and the states it has been in."""

    def __init__(
        self,
        grid: Grid,
        zones: Sequence[Zone],
        reference: Points | None,
        sought_kpa: float,
        unseen: str = "free",
        rig: Rig | None = None,
    ) -> None:
        """Mounts the liner.

        Args:
            grid: targets of the object model.
            zones: material of the wall; one for all of it.
            reference: targets of the open liner; None for the object model's.
            sought_kpa: smallest pressure that the map has to resolve; if σ exceeds both this and the
                pressure, the target has no pressure.
            unseen: one of `UNSEEN`. A mirror image has a smaller σ, which is too small where the teat stands
                off the middle; so every map is then compared with that of a free half.
            rig: whose views saw the points; None if targets that one view alone sees are of no use.

        Raises:
            AnalysisError: the inputs make no wall whose equilibrium can be computed.
        """
        material = _material(zones)
        self._grid, self._sought_kpa = grid, sought_kpa
        self._mounting = Mounting.of(grid, material, reference, rig)
        self._series = self._of(material, unseen == "mirrored")
        # Each prior mean has states of its own: about a wall that does not press, no load is ever found.
        self._wide = LoadSeries(self._series.model)
        self._compared = self._of(material, False) if unseen == "mirrored" else None
        self._middle = MiddleSurfaces(self._series.model, material)
        self._lattice = FaceLattice(grid, self._mounting)
        self._sections: Sections | None = None

    def _of(self, material: Material, mirrored: bool) -> LoadSeries:
        half, targets = self._mounting.half, self._mounting.targets
        return LoadSeries(WallModel(half, targets, LoadPrior(), TubePrior.of(material), mirrored))

    def settled(self, points: Points, vacuum: ChamberVacuum, *, exact: bool = False) -> SettledWall:
        """The wall in equilibrium at one field, without points that the others contradict.

        Args:
            points: of the field.
            vacuum: at the field.
            exact: true if its pressures are to be summed.

        Raises:
            AnalysisError: the wall has no equilibrium with these points.
        """
        difference = Difference(vacuum.difference_kpa, max(vacuum.difference_sigma_kpa, _EXACT))
        sights = self._mounting.sights(points, self._grid)
        # Where nothing presses, there is nothing to be exact about.
        reach_mm = EXACT_MM if exact and difference.kpa > _CLOSING_KPA[0] else REACH_MM
        found, other, share = self._weighed(sights, difference, reach_mm)
        found, left_out = _without_outliers(found)
        free = self._compared.load(found.sights, difference) if self._compared else None
        alone = self._mounting.seen_alone(points, self._grid)
        alone[list(left_out)] = False
        return SettledWall(found, free, left_out, alone, other, share)

    def _weighed(
        self, sights: Sights, difference: Difference, reach_mm: float
    ) -> tuple[Posterior, Posterior | None, float]:
        """The more probable of the walls by both prior means of the load, the other one, and its probability.

        By the liner's values, which all rows share: how well each explains the points cannot be compared, for
        where a wall does not press, nothing that the load might be moves it.

        Raises:
            AnalysisError: the wall has no equilibrium by either.
        """
        counts = float(np.interp(difference.kpa, _CLOSING_KPA, (0.0, 1.0)))
        try:
            found = self._series.load(sights, difference, reach_mm=reach_mm)
        except AnalysisError:
            return self._wide.load(sights, difference, WIDE, reach_mm), None, 0.0
        if not counts:
            return found, None, 0.0
        try:
            wide = self._wide.load(sights, difference, WIDE, reach_mm)
        except AnalysisError:
            return found, None, 0.0
        share = counts / (1 + _ODDS * float(np.exp((wide.liner_misfit - found.liner_misfit) / 2)))
        return (found, wide, share) if share < 1 / 2 else (wide, found, 1 - share)

    def of_settled(
        self,
        settled: SettledWall,
        within: Mask,
        vacuum: ChamberVacuum,
        speed_mm_per_s: float = 0.0,
        *,
        split: bool = False,
    ) -> PressureMap:
        """The pressure of a wall in equilibrium.

        Args:
            settled: the wall.
            within: (N,) True for targets that are supported by points; those that one view alone sees are,
                too, if there is a rig.
            vacuum: at the field.
            speed_mm_per_s: of the target that moves fastest.
            split: true to tell the noise of what was seen apart in the load over height.
        """
        found, within = settled.found, within | settled.alone
        value, covariance = settled.contact_kpa(found.model.targets)
        contact = Estimate(value, np.sqrt(np.diagonal(covariance)))
        # The liner's vacuum is in the difference as well, where its error partly cancels: never too small.
        above = Estimate(value - vacuum.liner_kpa, np.hypot(contact.sigma, vacuum.liner_sigma_kpa))
        free = settled.free
        unseen_kpa = value - free.contact_kpa(free.model.targets)[0] if free else None
        refusal = _refusal(found, speed_mm_per_s)
        profile = None if refusal else self._profile(found, split)
        if profile is not None and settled.other is not None:
            profile = profile.mixed(self._profile(settled.other, split), settled.share)
        if profile is not None and is_empty(profile):
            refusal = _EMPTY
        reasons = self._reasons(contact, within) if not refusal else (refusal,) * len(within)
        mean = _mean(value, covariance, within, reasons)
        # Inertia is a load like any other, so the shape of a fast wall is no worse for it.
        middle = None if settled.contradicted else self._middle.of(found)
        return PressureMap(contact, mean, above, found.j, unseen_kpa, within, reasons, profile, middle)

    def face(self, settled: SettledWall, supported: Mask, problems: tuple[str, ...]) -> OuterFace:
        """The outer face of a wall in equilibrium.

        Args:
            settled: the wall.
            supported: (rows, columns) True for targets that are supported by data.
            problems: of its points, as sentences.
        """
        return self._lattice.face(settled.found, supported, problems)

    def over_teat(self, settled: SettledWall, one: PressureMap) -> TeatMap:
        """The pressure over the teat's surface, with what the estimator errs by in its covariance.

        Args:
            settled: the wall.
            one: its map at the targets.

        Raises:
            AnalysisError: that map has no pressure.
        """
        profile = one.determined().profile
        assert profile is not None

        def contact_kpa(basis: Basis) -> Joint:
            value, covariance = settled.contact_kpa(basis)
            return Joint(value, covariance + _MEAN_SHARE**2 * np.outer(value, value))

        return teat_map(settled.found, contact_kpa, self._mounting, one.supported, profile)

    def _profile(self, found: Posterior, split: bool) -> LoadProfile:
        if self._sections is None:
            targets = self._mounting.targets
            reach_mm = min(float(np.abs(targets.s_mm).max()), _ARC_MM)
            heights = profile_heights(targets.x_mm)
            self._sections = Sections(found.model, heights, (-reach_mm, reach_mm))
        frame, reference_mm2 = self._mounting.frame, self._mounting.shared_mm2 if split else None
        profile = self._sections.profile(found, reference_mm2)
        return profile._replace(x_mm=frame.origin_mm[0] + frame.axes[0, 0] * profile.x_mm)

    def _reasons(self, contact: Estimate, within: Mask) -> tuple[str, ...]:
        """The first applicable reason why each target has no pressure; empty if it has one."""
        least = np.maximum(contact.value, self._sought_kpa)
        vague = [
            f"σ of {sigma:.2g} kPa exceeds the pressure sought ({wanted:.2g} kPa)"
            for sigma, wanted in zip(contact.sigma, least, strict=True)
        ]
        reasons = np.select([~within, contact.sigma > least], [_FAR, np.array(vague, object)], "")
        # Few different ones for as many targets as a capture has: each is kept once.
        return tuple(map(intern, reasons))


def _without_outliers(found: Posterior) -> tuple[Posterior, tuple[int, ...]]:
    """Leaves out the worst target, until none is worse than chance allows; all are kept if they are many."""
    kept, left_out = found, list[int]()
    while len(left_out) <= LARGEST_SHARE_OUT * len(kept.linear.places_mm):
        outlying = kept.outlying
        worst = int(np.argmax(outlying))
        if outlying[worst] < OUTLYING:
            return kept, tuple(left_out)
        left_out.append(worst)
        kept = posterior(kept.response, kept.sights.without(worst), kept.difference, kept.mean)
    return found, ()


def _refusal(found: Posterior, speed_mm_per_s: float) -> str:
    """The reason why a field has no pressure anywhere; empty if it may have one."""
    if found.j > MISFIT_ALARM:
        return f"the wall in equilibrium contradicts the points (misfit {found.j:.1f}, usual .3 to 1.2)"
    if speed_mm_per_s > FASTEST_MM_PER_S:
        return f"the wall moves at more than {FASTEST_MM_PER_S:g} mm/s: too fast for an equilibrium"
    return _ACROSS if found.difference.kpa > 0 and found.outward_mm > _BULGE_MM else ""


def _mean(value: Array, covariance: Array, use: Mask, reasons: Sequence[str]) -> Estimate:
    if all(reasons):
        return Estimate.of(np.nan, np.nan)
    mean = value[use].mean()
    return Estimate(mean, np.hypot(np.sqrt(covariance[np.ix_(use, use)].mean()), _MEAN_SHARE * mean))


def _material(zones: Sequence[Zone]) -> Material:
    if len(zones) != 1:
        raise AnalysisError(
            f"the wall's equilibrium needs one material for the whole liner, not {len(zones)} zones",
            "give one material for a map of the pressure",
        )
    return zones[0].material
