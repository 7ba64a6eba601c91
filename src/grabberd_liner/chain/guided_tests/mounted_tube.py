"""The mounted liner as its targets show it: radius, ovality, pitch of the rows, place along its axis."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from grabberd.errors import AnalysisError
from grabberd_liner.analysis import Estimate, Grid
from grabberd_liner.chain.analysis.field_points import FieldPoints
from grabberd_liner.chain.guided_tests.outcome import Array, estimate

_ROUNDS = 30
_LEAST_SIGMA_MM = 1e-3
_LEAST_TARGETS = 12
_LEAST_ARC = 0.05
_LEAST_COLUMNS = 5
"""From which on an oval shows: four columns about the middle have two heights, which any circle meets."""


class MountedTube(NamedTuple):
    """A tube along X through the targets, by least squares.

    Attributes:
        radius_mm: mean radius of the targets' face.
        ovality_mm: diameter towards the cameras less that across, if the hidden half mirrors the seen one;
            None where too few columns are seen.
        pitch_mm: distance of neighbouring rows along the axis.
        shift_mm: mean place along X less that of the object model.
        across_mm: (N,) places of the targets across the view, from the axis.
        towards_mm: (N,) towards the cameras, likewise.
        sigma_mm: (N,) σ of their distance from the axis.
    """

    radius_mm: Estimate
    ovality_mm: Estimate | None
    pitch_mm: Estimate
    shift_mm: Estimate
    across_mm: Array
    towards_mm: Array
    sigma_mm: Array


class _Mean(NamedTuple):
    """Targets averaged over the fields: places, and the covariances of noise and of the calibration."""

    target: Array
    xyz_mm: Array
    noise_mm2: Array
    calibration_mm2: Array


def mounted_tube(fields: Sequence[FieldPoints], grid: Grid) -> MountedTube:
    """The tube that a capture of the still liner shows.

    Args:
        fields: of the capture.
        grid: targets of the object model.

    Raises:
        AnalysisError: too few targets are seen, or they determine no tube.
    """
    mean = _mean(fields)
    index = np.searchsorted(grid.target, mean.target)
    row, nominal_mm = grid.row[index].astype(np.float64), grid.nominal_mm[index]
    if len(index) < _LEAST_TARGETS or len(np.unique(row)) < 2 or len(np.unique(grid.column[index])) < 3:
        raise AnalysisError(
            f"{len(index)} targets are seen, too few for a tube",
            "turn the cup until both views see four columns of targets",
        )
    oval = len(np.unique(grid.column[index])) >= _LEAST_COLUMNS
    values, covariance, normal = _fit(mean, oval)
    offsets = mean.xyz_mm[:, 1:] - _axis(values, mean.xyz_mm[:, 0])
    of_calibration = np.sqrt(np.einsum("ni,nij,nj->n", normal, mean.calibration_mm2, normal))
    common_mm = float(np.sqrt(np.mean(np.square(of_calibration))))
    # A radius is read from the height of an arc, whose error it multiplies where the arc is short.
    by_arc_mm = common_mm / max(1 - float(normal[:, 2].min()), _LEAST_ARC)
    oval_mm = 4 * float(np.sqrt(max(covariance[1, 1], 0.0)))
    return MountedTube(
        radius_mm=estimate(values[0], float(np.hypot(np.sqrt(covariance[0, 0]), by_arc_mm))),
        ovality_mm=estimate(4 * values[1], float(np.hypot(oval_mm, 2 * by_arc_mm))) if oval else None,
        pitch_mm=_pitch(mean, row, float(np.sqrt(1 + values[3] ** 2 + values[5] ** 2))),
        shift_mm=_shift(mean, nominal_mm),
        across_mm=offsets[:, 0],
        towards_mm=offsets[:, 1],
        sigma_mm=np.hypot(np.sqrt(np.einsum("ni,nij,nj->n", normal, mean.noise_mm2, normal)), common_mm),
    )


def _mean(fields: Sequence[FieldPoints]) -> _Mean:
    points = [one.timed.points for one in fields]
    target = np.concatenate([one.target for one in points])
    known, at, count = np.unique(target, return_inverse=True, return_counts=True)
    often = count >= len(points) / 2

    def averaged(name: str) -> Array:
        values = np.concatenate([getattr(one, name) for one in points])
        summed = np.zeros((len(known), *values.shape[1:]))
        np.add.at(summed, at, values)
        mean: Array = summed / count.reshape(-1, *(1,) * (values.ndim - 1))
        return mean[often]

    noise = averaged("covariance_mm2") / count[often, np.newaxis, np.newaxis]
    return _Mean(known[often], averaged("xyz_mm"), noise, averaged("calibration_covariance_mm2"))


def _axis(values: Array, x_mm: Array) -> Array:
    """(N, 2) Y and Z of the axis."""
    axis: Array = np.column_stack([values[2] + values[3] * x_mm, values[4] + values[5] * x_mm])
    return axis


def _fit(mean: _Mean, oval: bool) -> tuple[Array, Array, Array]:
    """Radius, half the amplitude of the oval, and the axis (6,), their covariance, and the normals (N, 3)."""
    x_mm = mean.xyz_mm[:, 0]
    values = np.array([10.0, 0.0, mean.xyz_mm[:, 1].mean(), 0.0, mean.xyz_mm[:, 2].min() - 5.0, 0.0])
    for _ in range(_ROUNDS):
        offset = mean.xyz_mm[:, 1:] - _axis(values, x_mm)
        radius = np.linalg.norm(offset, axis=1)
        sine, cosine = (offset / radius[:, np.newaxis]).T
        normal = np.column_stack([np.zeros_like(sine), sine, cosine])
        sigma = np.sqrt(np.einsum("ni,nij,nj->n", normal, mean.noise_mm2, normal)) + _LEAST_SIGMA_MM
        twice = 2 * np.square(cosine) - 1
        left = (radius - values[0] - values[1] * twice) / sigma
        columns = [np.ones_like(sine), twice * oval, sine, sine * x_mm, cosine, cosine * x_mm]
        design = np.column_stack(columns) / sigma[:, np.newaxis]
        step, *_ = np.linalg.lstsq(design, left, rcond=None)
        values = values + step
    # A wall is no perfect tube: what is left says how far the values can be trusted.
    beyond = max(1.0, float(left @ left) / max(len(left) - len(values), 1))
    covariance: Array = np.linalg.pinv(design.T @ design) * beyond
    return values, covariance, normal


def _pitch(mean: _Mean, row: Array, along: float) -> Estimate:
    centred = row - row.mean()
    weights = centred / np.sum(np.square(centred))
    pitch = float(weights @ mean.xyz_mm[:, 0])
    left = mean.xyz_mm[:, 0] - mean.xyz_mm[:, 0].mean() - pitch * centred
    noise = float(np.sqrt(np.sum(np.square(weights)) * np.mean(np.square(left))))
    # An error of the calibration that grows along the liner shows as another pitch.
    scale = float(np.sqrt(mean.calibration_mm2[:, 0, 0].mean()) / np.ptp(row))
    return estimate(pitch * along, np.hypot(noise, scale))


def _shift(mean: _Mean, nominal_mm: Array) -> Estimate:
    off = mean.xyz_mm[:, 0] - nominal_mm[:, 0]
    common = np.sqrt(mean.calibration_mm2[:, 0, 0].mean())
    return estimate(off.mean(), np.hypot(off.std(ddof=1) / np.sqrt(len(off)), common))
