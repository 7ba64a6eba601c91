"""Nominal places of an object's targets as a capture shows them, where the object model has them elsewhere.

A target's displacement, its place relative to the nominal one, is compared with what its neighbours'
displacements predict: they move alike, so what remains on average is the error of the nominal place. Only
what differs from target to target can be told; what all of a neighbourhood have in common is deformation.

The fields are measured with gates so wide that targets are found which the object model's own σ rejects, and
those in which the object is nearest to its nominal shape count: there, the wall is open and hardly deformed.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.chain.measure import MeasuredField, MeasureSetup, measure_fields
from grabberd.core.field import NumberedField
from grabberd.core.reconstruction import ObjectModel, Smoothness
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField

SEARCHED_SHARE = 0.1
"""σ of all nominal places while they are looked for, as a share of the pitch."""
NEAREST_SHARE = 0.25
"""Share of the fields that count: those nearest to the nominal shape."""
LEAST_SHARE = 0.8
"""Share of the usual number of targets that a field must show to count."""
LEAST_FIELDS = 10
MOST_FIELDS = 1000
NOISE_MM = 0.05
"""Standard deviation of a target's mean displacement round the smooth field once its place is right."""
LEAST_DEFORMATION_MM = 0.3
"""Least prior σ of the deformation in the fields that count."""
LEAST_MM = 0.1
SIGNIFICANT = 5.0
"""χ of an offset, of three coordinates: one target in place in sixty thousand exceeds it."""
UNTOLD_SHARE = 0.06
"""Share of an offset, in each coordinate, that is not told from a deformation of the neighbourhood."""
_ROUNDS = 60
_DAMPING = 0.9
_BLOCKS = 10


@dataclass(frozen=True, slots=True, eq=False)
class NominalPlaces:
    """Offsets of M targets from their nominal places.

    Attributes:
        model: The object model that they are offsets from.
        offset_mm: (M, 3) mean offset from where the neighbours predict a target; NaN if it was not seen.
        sigma_mm: (M,) their standard deviation in each coordinate.
        seen: (M,) number of the fields that a target was found in.
        fields: Number of fields that counted.
    """

    model: ObjectModel
    offset_mm: Array
    sigma_mm: Array
    seen: Indices
    fields: int

    @property
    def significance(self) -> Array:
        """(M,) lengths of the offsets in units of σ; 0 for targets that were not seen."""
        return np.nan_to_num(np.linalg.norm(self.offset_mm, axis=1) / self.sigma_mm)

    @property
    def misplaced(self) -> Mask:
        """(M,) True for targets whose nominal place is wrong: significantly, and by enough to matter."""
        length_mm = np.nan_to_num(np.linalg.norm(self.offset_mm, axis=1))
        return (self.significance > SIGNIFICANT) & (length_mm >= LEAST_MM)

    @property
    def proposed(self) -> ObjectModel:
        """The object model with the misplaced targets where they are, each with its own σ."""
        wrong, model = self.misplaced, self.model
        own = np.full(len(model), np.nan) if model.own_sigma_mm is None else model.own_sigma_mm
        xyz_mm = model.xyz_mm + np.where(wrong[:, np.newaxis], self.offset_mm, 0.0)
        return replace(model, xyz_mm=xyz_mm, own_sigma_mm=np.where(wrong, self.sigma_mm, own))


def nominal_places(fields: Iterable[NumberedField], setup: MeasureSetup) -> NominalPlaces:
    """Compare the nominal places of a setup's object model with what fields show.

    A target counts if it was found in at least `LEAST_FIELDS` of the fields that count; fewer fields tell
    nothing.
    """
    model = setup.object_model
    wide = replace(model, own_sigma_mm=np.full(len(model), SEARCHED_SHARE * _pitch_mm(model)))
    measured = measure_fields(fields, replace(setup, object_model=wide))
    displacement = _nearest(np.array(list(_thinned(measured, model))).reshape(-1, len(model), 3))
    return _offsets(model, displacement)


def _pitch_mm(model: ObjectModel) -> float:
    pairs = model.neighbours()
    if not len(pairs):
        return 0.0
    return float(np.median(np.linalg.norm(model.xyz_mm[pairs[:, 0]] - model.xyz_mm[pairs[:, 1]], axis=1)))


def _thinned(measured: Iterable[MeasuredField], model: ObjectModel) -> Iterator[Array]:
    """(M, 3) displacements of at most `MOST_FIELDS` fields from all over the capture, NaN where not seen."""
    kept: list[Array] = []
    stride = 1
    for index, one in enumerate(measured):
        if index % stride:
            continue
        displacement = np.full_like(model.xyz_mm, np.nan)
        at = np.searchsorted(model.target, one.points.target)
        displacement[at] = one.points.xyz_mm - model.xyz_mm[at]
        kept.append(displacement)
        if len(kept) > MOST_FIELDS:
            kept, stride = kept[::2], 2 * stride
    yield from kept


def _nearest(displacement_mm: Array) -> Array:
    """Choose the fields (F, M, 3) that show most of the targets and are nearest to the nominal shape."""
    seen = np.isfinite(displacement_mm[:, :, 0])
    count = seen.sum(axis=1)
    usual = np.sort(count)[len(count) // 2 :][:1].sum()
    whole: Array = displacement_mm[count >= LEAST_SHARE * usual]
    if not len(whole):
        return whole
    squares = np.nansum(whole * whole, axis=(1, 2)) / np.maximum(np.isfinite(whole).sum(axis=(1, 2)), 1)
    chosen = max(LEAST_FIELDS, round(NEAREST_SHARE * len(whole)))
    return whole[np.sort(np.argsort(squares, kind="stable")[:chosen])]


def _offsets(model: ObjectModel, displacement_mm: Array) -> NominalPlaces:
    seen = np.isfinite(displacement_mm[:, :, 0])
    known = seen.sum(axis=0) >= LEAST_FIELDS
    field = DisplacementField.of(model.xyz_mm, _smoothness(displacement_mm))
    offset, sigma, left = np.zeros_like(model.xyz_mm), np.full(len(model), np.nan), displacement_mm
    # A misplaced target also shifts what is expected of its neighbours: what is known of its offset is taken
    # off, and the rest determined again.
    for _ in range(_ROUNDS if known.any() else 0):
        left, sigma = _left(field, displacement_mm - offset, seen)
        offset[known] += _DAMPING * _mean(left, seen)[known]
    sigma = np.hypot(sigma, UNTOLD_SHARE * np.linalg.norm(offset, axis=1))
    sigma = np.hypot(sigma, _scatter(left, seen))
    offset[~known] = np.nan
    return NominalPlaces(model, offset, sigma, seen.sum(axis=0), len(displacement_mm))


def _smoothness(displacement_mm: Array) -> Smoothness:
    """Smoothness of fields that are hardly deformed: their displacements' own size, robustly, as prior σ."""
    known = displacement_mm[np.isfinite(displacement_mm)]
    typical_mm = 1.48 * float(np.median(np.abs(known))) if len(known) else 0.0
    return Smoothness(min(max(typical_mm, LEAST_DEFORMATION_MM), Smoothness().sigma_mm), noise_mm=NOISE_MM)


def _left(field: DisplacementField, displacement_mm: Array, seen: Mask) -> tuple[Array, Array]:
    """(F, M, 3) displacements without what the neighbours predict, and (M,) the mean σ of that."""
    left, sigma = np.full_like(displacement_mm, np.nan), np.zeros(displacement_mm.shape[1])
    for row, own, mask in zip(left, displacement_mm, seen, strict=True):
        expected = field.expect(np.flatnonzero(mask), own[mask])
        row[mask] = (own - expected.displacement_mm)[mask]
        sigma += expected.sigma_mm / len(seen)
    return left, sigma


def _mean(left: Array, seen: Mask) -> Array:
    """(M, 3) mean over the fields in which a target was seen; 0 if in none."""
    total = np.where(seen[:, :, np.newaxis], left, 0.0).sum(axis=0)
    return total / np.maximum(seen.sum(axis=0), 1)[:, np.newaxis]


def _scatter(left: Array, seen: Mask) -> Array:
    """(M,) standard deviation of the mean, in the worst coordinate, from blocks of time."""
    if len(left) < _BLOCKS:
        return np.zeros(left.shape[1])
    blocks = zip(np.array_split(left, _BLOCKS), np.array_split(seen, _BLOCKS), strict=True)
    means = [_mean(*block) for block in blocks]
    return np.std(means, axis=0, ddof=1).max(axis=1) / np.sqrt(_BLOCKS)
