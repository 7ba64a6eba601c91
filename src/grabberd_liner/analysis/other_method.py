"""Pressures that another method measured on the teat, such as a film, a mat or a mandrel, laid over the map.

    along_mm;round_deg;pressure_kpa;sigma_kpa;cell_mm;above
    -12.5;30;22.4;1.5;5;liner

Along the teat's axis places grow as x of the object's frame does, from an origin of the table's own; round it
they count from the middle of the targets, which faces the cameras, towards +y. Offsets that are not given are
those at which map and table differ by the same at all places, as nearly as the σ of both allow.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import sparse

from grabberd.core.arrays import Array, Mask
from grabberd.errors import AnalysisError, InputError
from grabberd.tables import Cells, TableError, keyed_cells
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.load.teat_map import TeatMap

COLUMNS = ("along_mm", "round_deg", "pressure_kpa", "sigma_kpa")
ABOVE = ("liner", "atmosphere")
"""What pressures may be counted from: the gas in the liner, as the map's contact pressure, or atmosphere."""
LEAST_PLACES, MOST_PLACES = 10, 1000
"""Places, below which limits of agreement say nothing, and beyond which their covariance takes too long."""
_CELL, _ABOVE = "cell_mm", "above"
_GREATEST = {"along_mm": 300.0, "round_deg": 180.0, "pressure_kpa": 150.0, "sigma_kpa": 150.0, _CELL: 30.0}
"""Sizes that no place or pressure on a teat exceeds: beyond them, the numbers are in another unit."""
_HINT = (
    f"give {', '.join(COLUMNS)} and, if known, {_CELL}, the width of a sensor's cell, and {_ABOVE}, "
    f"{' or '.join(ABOVE)}; a row for each place"
)


class Record(NamedTuple):
    """Pressures at M places, by another method.

    Attributes:
        along_mm: (M,) along the teat's axis; `round_deg`: (M,) round it.
        pressure_kpa: (M,) with `sigma_kpa`: (M,).
        cell_mm: (M,) width of the square cell that each is a mean over; 0 for a point.
        above: what they are counted from, one of `ABOVE`; empty if the table does not say.
    """

    along_mm: Array
    round_deg: Array
    pressure_kpa: Array
    sigma_kpa: Array
    cell_mm: Array
    above: str


def read_record(text: str) -> Record:
    """The record from the text of a table.

    Raises:
        InputError: columns are missing, numbers are in another unit or no numbers, or there are too few or
            too many places.
    """
    try:
        cells = keyed_cells(text, COLUMNS, (_CELL, _ABOVE), hint=_HINT)
        numbers = cells.numbers([name for name in cells.columns if name != _ABOVE])
    except TableError as error:
        raise InputError(f"the other method's table cannot be read: {error}", error.hint) from error
    values = {name: np.array(column) for name, column in numbers.items()}
    values.setdefault(_CELL, np.zeros(len(cells.lines)))
    if problem := next(_problems(values), ""):
        raise InputError(f"the other method's table cannot be used: {problem}", _HINT)
    return Record(**values, above=_stated(cells))


def _problems(values: dict[str, Array]) -> Iterator[str]:
    count = len(values["sigma_kpa"])
    if not LEAST_PLACES <= count <= MOST_PLACES:
        yield f"it has {count} places, expected {LEAST_PLACES} to {MOST_PLACES}"
    for name, greatest in _GREATEST.items():
        if np.abs(values[name]).max() > greatest:
            worst = np.abs(values[name]).max()
            yield f"{name} is up to {worst:g}, at most {greatest:g} is possible: is it in another unit?"
    if values["sigma_kpa"].min() <= 0:
        yield "sigma_kpa has to be above 0 at every place"
    if values[_CELL].min() < 0:
        yield f"{_CELL} cannot be negative"


def _stated(cells: Cells) -> str:
    words = set(cells.columns.get(_ABOVE, ()))
    if len(words) > 1 or not words <= {*ABOVE}:
        shown = ", ".join(map(repr, sorted(words)))
        raise InputError(
            f"the column {_ABOVE} of the other method's table has {shown}",
            f"write {' or '.join(ABOVE)} in every row: what the pressures are counted from",
        )
    return words.pop() if words else ""


class Offsets(NamedTuple):
    """Place of the table's origin: x in the object's frame, and angle from the middle of the targets.

    Attributes:
        x_mm: None where it is to be estimated; `round_deg`: likewise.
    """

    x_mm: Estimate | None
    round_deg: Estimate | None

    @property
    def estimated(self) -> list[int]:
        """Numbers of those that are to be estimated."""
        return [number for number, one in enumerate(self) if one is None]


class Overlay(NamedTuple):
    """Map and record at the same N places.

    Attributes:
        offsets: of the record, given or estimated.
        estimated: numbers of those that were estimated.
        inside: (M,) True for places of the record that lie in the supported part of the map.
        x_mm: (N,) in the object's frame; `round_deg`: (N,).
        map_kpa: the map, averaged over the record's cells; `other_kpa`: the record.
        difference_kpa: map less record; the σ of both and of the offsets is in its covariance.
        chi2: of the differences about their weighted mean; about `dof` if the σ of both explain them.
        dof: degrees of freedom.
    """

    offsets: tuple[Estimate, Estimate]
    estimated: list[int]
    inside: Mask
    x_mm: Array
    round_deg: Array
    map_kpa: Joint
    other_kpa: Estimate
    difference_kpa: Joint
    chi2: float
    dof: int


_STEPS, _SETTLED = 40, (0.01, 0.05)
"""Of Gauss and Newton, and the steps in mm and ° after which the offsets are found."""
_LONGEST = np.array([2.0, 10.0])
"""Of a step."""
_BESIDE = (1.0, 6.0)
"""Distances to both sides by which the map's slope is told: half of its own lattice."""
_LARGEST_SIGMA = (3.0, 10.0)
"""σ of an offset beyond which it is not determined: half a pitch of targets."""
_OF_MAP = (0.5, 0.0)
"""σ of the map's own places: it finds the teat's end to half a millimetre."""
_FARTHEST_DEG = 60.0
_SCANNED = (1.0, 5.0)
"""Offsets that are tried: how far round, and in what steps."""
_OVERLAP = 0.6
"""Share of the largest overlap that offsets have to have which are looked at: few places always agree."""
_WAYS, _UNITS = ("along", "round"), ("mm", "°")
_KEYS = ("along: {x_mm: …, sigma_mm: …}", "round: {deg: …, sigma_deg: …}")
_POWERS, _ALIKE = 4, 0.7
"""Polynomial across a way that is taken out of map and record, and the correlation that is left at least."""
_REVERSED, _UNEXPLAINED = 0.5, 3.0
"""Scatter of reversed places, as a share of that of the others, from which on they are taken to be reversed,
and the least scatter, in σ², for which that is looked at."""


def overlay(teat: TeatMap, record: Record, offsets: Offsets) -> Overlay:
    """Lay a record over the map.

    Raises:
        AnalysisError: too few places are in the supported part of the map, or the data do not determine the
            offsets.
    """
    at = _start(teat, record, offsets)
    estimated = offsets.estimated
    among = np.ones(len(record.along_mm), np.bool_)
    for count in range(_STEPS):
        local = _Local.at(teat, record, at, offsets, among)
        # Places at the border of the map, which are in and out by turns, would keep the offsets moving.
        among = local.inside if count >= _STEPS // 4 else among
        step = np.zeros(2)
        if estimated:
            step[estimated] = np.clip(local.step, -_LONGEST[estimated], _LONGEST[estimated])
        if (np.abs(step) < _SETTLED).all():
            found = local.overlay(record, at, offsets)
            _check_determined(found)
            return found
        at = at + step
    raise AnalysisError(
        f"the offsets of the other method's places do not settle within {_STEPS} steps", _give(estimated)
    )


class _Local(NamedTuple):
    """Map and record near some offsets, at N places.

    Attributes:
        inside: as in `Overlay`.
        map_kpa: the map there.
        difference: (N,) map less record; `covariance`: (N, N) by both σ and those of given offsets.
        design: (N, K + 1) slopes by the estimated offsets, and 1.
        inverse: (N, N) of the covariance; `normal`: (K + 1, K + 1) covariance of what the design's columns
            are multiplied by.
    """

    inside: Mask
    map_kpa: Joint
    difference: Array
    covariance: Array
    design: Array
    inverse: Array
    normal: Array

    @classmethod
    def at(cls, teat: TeatMap, record: Record, at: Array, offsets: Offsets, among: Mask) -> "_Local":
        """Linearises, with no other places than those of a choice (M,).

        Raises:
            AnalysisError: the places are too few, or do not determine the offsets.
        """
        weights, inside = _weights(teat, record, at)
        sides = [
            [_weights(teat, record, at + side * np.eye(2)[k] * _BESIDE[k]) for side in (-1, 1)]
            for k in (0, 1)
        ]
        inside = inside & among
        for k in offsets.estimated:
            inside = inside & sides[k][0][1] & sides[k][1][1]
        _check_overlap(teat, record, at, inside)
        value, covariance = teat.contact_kpa
        use = weights[inside]
        by = [(high[0][inside] - low[0][inside]) / (2 * _BESIDE[k]) for k, (low, high) in enumerate(sides)]
        slope = np.column_stack([one @ value for one in by])
        map_kpa = Joint(use @ value, use @ (use @ covariance).T)
        total = map_kpa.covariance + np.diag(record.sigma_kpa[inside] ** 2)
        for k, given in enumerate(offsets):
            if given is not None:
                variance = float(given.sigma) ** 2 + _OF_MAP[k] ** 2
                total = total + variance * np.outer(slope[:, k], slope[:, k])
        inverse = np.asarray(np.linalg.inv(total), np.float64)
        design = np.column_stack([slope[:, offsets.estimated], np.ones(len(slope))])
        normal = _inverted(design.T @ inverse @ design, offsets.estimated)
        difference = map_kpa.value - record.pressure_kpa[inside]
        return cls(inside, map_kpa, difference, total, design, inverse, normal)

    @property
    def step(self) -> Array:
        """(K,) by which the estimated offsets have to change."""
        return -(self.normal @ self.design.T @ self.inverse @ self.difference)[:-1]

    def overlay(self, record: Record, at: Array, offsets: Offsets) -> Overlay:
        """The overlay at offsets that have settled."""
        fitted = self.normal @ self.design.T @ self.inverse
        rest = self.difference - fitted[-1] @ self.difference
        # An estimated offset goes with the errors of both methods, and takes a part of them away.
        left = np.eye(len(rest)) - self.design[:, :-1] @ fitted[:-1]
        sigma = np.zeros(2)
        sigma[offsets.estimated] = np.sqrt(np.diagonal(self.normal)[:-1])
        sigma = np.hypot(sigma, _OF_MAP)
        found = [given or Estimate.of(at[k], sigma[k]) for k, given in enumerate(offsets)]
        use = self.inside
        return Overlay(
            (found[0], found[1]),
            offsets.estimated,
            use,
            record.along_mm[use] + at[0],
            record.round_deg[use] + at[1],
            self.map_kpa,
            Estimate(record.pressure_kpa[use], record.sigma_kpa[use]),
            Joint(self.difference, left @ self.covariance @ left.T),
            float(rest @ self.inverse @ rest),
            len(rest) - self.design.shape[1],
        )


def _weights(teat: TeatMap, record: Record, at: Array) -> tuple[sparse.csr_matrix, Mask]:
    return teat.weights(record.along_mm + at[0], record.round_deg + at[1], record.cell_mm)


def _check_overlap(teat: TeatMap, record: Record, at: Array, inside: Mask) -> None:
    if inside.sum() >= LEAST_PLACES:
        return
    low, high = teat.reach
    raise AnalysisError(
        f"{inside.sum()} of {len(inside)} places of the other method lie in the supported part of the map, "
        f"which is x {low[0]:.0f} to {high[0]:.0f} mm and {low[1]:.0f} to {high[1]:.0f}°; with offsets of "
        f"{at[0]:.1f} mm and {at[1]:.0f}° they reach from {record.along_mm.min() + at[0]:.0f} to "
        f"{record.along_mm.max() + at[0]:.0f} mm: at least {LEAST_PLACES} are needed",
        "check the offsets and the direction of along_mm, or measure where the cameras see the liner",
    )


def _inverted(normal: Array, estimated: list[int]) -> Array:
    """The covariance of the estimated offsets and of a difference that is the same everywhere.

    Args:
        normal: (K + 1, K + 1) matrix of the normal equations.
        estimated: numbers of the K offsets.

    Raises:
        AnalysisError: the pressures do not determine the offsets.
    """
    count = len(estimated)
    own = normal[:count, :count] - np.outer(normal[:count, -1], normal[:count, -1]) / normal[-1, -1]
    largest = np.array(_LARGEST_SIGMA)[estimated]
    sure, ways = np.linalg.eigh(own * np.outer(largest, largest))
    if not count or sure[0] >= 1:
        return np.asarray(np.linalg.inv(normal))
    worst = estimated[int(np.abs(ways[:, 0]).argmax())]
    raise _undetermined(worst, f"σ would exceed {_LARGEST_SIGMA[worst]:g} {_UNITS[worst]}")


def _check_determined(found: Overlay) -> None:
    """Refuse offsets along which map and record have no pattern in common.

    The slopes of a map are not free of its errors, so that their size alone does not say that they are real:
    a record with errors of its own does.
    """
    for way in found.estimated:
        across = (found.round_deg, found.x_mm)[way]
        design = np.vander((across - across.mean()) / max(float(np.ptp(across)), 1.0), _POWERS)
        both = np.column_stack([found.map_kpa.value, found.other_kpa.value])
        rest = both - design @ np.linalg.lstsq(design, both, rcond=None)[0]
        size = float(np.prod(np.linalg.norm(rest, axis=0)))
        alike = float(rest[:, 0] @ rest[:, 1]) / size if size > 0 else 0.0
        if alike < _ALIKE:
            raise _undetermined(
                way, f"what changes that way has a correlation of {alike:.2f} in map and table"
            )


def _undetermined(way: int, why: str) -> AnalysisError:
    return AnalysisError(
        f"the pressures do not determine the offset {_WAYS[way]} the teat's axis: {why}", _give([way])
    )


def _give(offsets: list[int]) -> str:
    return f"measure where the table's origin lies, and give it: {', '.join(_KEYS[one] for one in offsets)}"


def _start(teat: TeatMap, record: Record, offsets: Offsets) -> Array:
    """Offsets to begin with: of many that are tried, those with the least scatter of the differences.

    Raises:
        AnalysisError: places seem to count the other way, which no offset can mend.
    """
    at, scatter = _least(teat, record, offsets)
    if offsets.x_mm is None and scatter > _UNEXPLAINED:
        _, reversed_scatter = _least(teat, record._replace(along_mm=-record.along_mm), offsets)
        if reversed_scatter < _REVERSED * scatter:
            raise AnalysisError(
                "along_mm of the other method's table seems to count the other way: reversed, differences "
                f"scatter {np.sqrt(scatter / reversed_scatter):.1f} times less",
                "let along_mm grow as x of the object's frame does",
            )
    return at


def _least(teat: TeatMap, record: Record, offsets: Offsets) -> tuple[Array, float]:
    """The offsets with the least scatter, and that."""
    low, high = teat.reach
    reach = (low[0] - record.along_mm.max(), high[0] - record.along_mm.min()), (-_FARTHEST_DEG, _FARTHEST_DEG)
    along, turns = (
        [float(given.value)] if given else np.arange(start, stop + step / 2, step).tolist()
        for given, (start, stop), step in zip(offsets, reach, _SCANNED, strict=True)
    )
    tried = np.array([(x, turn) for x in along for turn in turns])
    found = np.array([_scatter(teat, record, one) for one in tried])
    wide = found[:, 1] >= _OVERLAP * found[:, 1].max()
    best = int(np.where(wide, found[:, 0], np.inf).argmin())
    return tried[best], float(found[best, 0])


def _scatter(teat: TeatMap, record: Record, at: Array) -> tuple[float, int]:
    """Mean weighted square of the differences about their mean, and the number of places."""
    points = record._replace(cell_mm=np.zeros_like(record.cell_mm))
    weights, inside = _weights(teat, points, at)
    if inside.sum() < LEAST_PLACES:
        return np.inf, int(inside.sum())
    apart = (weights @ teat.contact_kpa.value - record.pressure_kpa)[inside]
    variance = record.sigma_kpa[inside] ** 2 + float(np.diagonal(teat.contact_kpa.covariance).mean())
    apart = apart - np.average(apart, weights=1 / variance)
    return float(np.mean(apart**2 / variance)), int(inside.sum())
