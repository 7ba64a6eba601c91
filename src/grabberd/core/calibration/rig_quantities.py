"""The rig in a workshop's terms, and its comparison with the nominal and the previous one."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.geometry import NominalRig, View, rays
from grabberd.core.geometry.document_reader import finite

NOMINAL_SHARE = 0.05
"""σ of a nominal dimension: each is good to ten per cent, two σ."""
NOMINAL_PRINCIPAL_PX = 15.0
"""σ of the principal point about the middle of the picture, as lenses are mounted."""
_STEP = 1e-4
"""Step of a derivative in units of the parameter's own σ, which is small enough for any of them."""


@dataclass(frozen=True, slots=True)
class RigQuantity:
    """One property of the rig: as built, as calibrated before, and as found.

    Attributes:
        name: `focal_length`, `principal_x`, `principal_y`, `base`, `distance`, `convergence` or `handedness`.
        view: The view that it belongs to; empty for the rig as a whole.
        unit: mm, px, degrees or none.
        nominal: As built; None if that is not stated.
        previous: As calibrated before; None without a previous calibration.
        found: As found.
        sigma: σ of what was found.
        nominal_z: Difference from nominal in σ of the difference; None where there is none.
        previous_z: Likewise from the previous calibration.
    """

    name: str
    view: str
    unit: str
    nominal: float | None
    previous: float | None
    found: float
    sigma: float
    nominal_z: float | None
    previous_z: float | None


def base_mm(views: Sequence[View]) -> float:
    """Distance of the two virtual cameras."""
    return float(np.linalg.norm(views[1].center_mm - views[0].center_mm))


def distance_mm(views: Sequence[View], middle_mm: Array) -> float:
    """Distance of the middle between the cameras from the middle of the targets."""
    return float(np.linalg.norm((views[0].center_mm + views[1].center_mm) / 2 - middle_mm))


def convergence_deg(views: Sequence[View], lines: int) -> float:
    """Angle between the rays through the middle of each half."""
    first, second = (rays(view, _middle_px(view, lines))[1][0] for view in views[:2])
    return math.degrees(math.acos(float(np.clip(first @ second, -1, 1))))


def compared_rig(
    views: Sequence[View],
    covariance: Array,
    nominal: NominalRig,
    middle_mm: Array,
    previous: tuple[Sequence[View], Array] | None = None,
) -> tuple[RigQuantity, ...]:
    """Compare the rig that was found with the nominal and the previous one.

    Args:
        views: Left and right view as found.
        covariance: (36, 36) of their parameters.
        nominal: The rig as built.
        middle_mm: (3,) middle of the targets.
        previous: Views and covariance of the previous calibration.
    """
    found, sigma = _known(views, covariance, nominal.lines, middle_mm)
    built, built_sigma = _built(nominal)
    before, before_sigma = (
        _known(*previous, nominal.lines, middle_mm) if previous else (np.full_like(found, np.nan),) * 2
    )
    rows = [
        RigQuantity(
            name,
            view,
            unit,
            finite(built[i]),
            finite(before[i]),
            float(found[i]),
            float(sigma[i]),
            finite((found[i] - built[i]) / math.hypot(sigma[i], built_sigma[i])),
            finite((found[i] - before[i]) / max(math.hypot(sigma[i], before_sigma[i]), 1e-12)),
        )
        for i, (name, view, unit) in enumerate(_NAMES)
    ]
    return (*rows, *_handedness(views, nominal, previous[0] if previous else None))


_NAMES = (
    ("focal_length", "left", "mm"),
    ("focal_length", "right", "mm"),
    ("principal_x", "left", "px"),
    ("principal_x", "right", "px"),
    ("principal_y", "left", "px"),
    ("principal_y", "right", "px"),
    ("base", "", "mm"),
    ("distance", "", "mm"),
    ("convergence", "", "deg"),
)


def _values(views: Sequence[View], lines: int, middle_mm: Array) -> Array:
    left, right = views
    return np.array(
        [
            *(left.f_mm, right.f_mm, left.x0_px, right.x0_px, left.y0_px, right.y0_px),
            *(base_mm(views), distance_mm(views, middle_mm), convergence_deg(views, lines)),
        ]
    )


def _known(views: Sequence[View], covariance: Array, lines: int, middle_mm: Array) -> tuple[Array, Array]:
    """Values and σ, by numerical derivatives in steps of each parameter's σ."""
    values = _values(views, lines, middle_mm)
    vectors = [view.vector() for view in views]
    count = len(vectors[0])
    deviation = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    influence = np.zeros((len(values), len(deviation)))
    for index in np.flatnonzero(deviation):
        moved = [vector.copy() for vector in vectors]
        step = deviation[index] * _STEP
        moved[index // count][index % count] += step
        changed = [view.with_vector(vector) for view, vector in zip(views, moved, strict=True)]
        influence[:, index] = (_values(changed, lines, middle_mm) - values) / step
    return values, np.sqrt(np.einsum("ij,jk,ik->i", influence, covariance, influence))


def _built(nominal: NominalRig) -> tuple[Array, Array]:
    middle = (0.5 * (nominal.columns - 1), 0.5 * (nominal.lines - 1))
    lengths = (nominal.base_mm, nominal.distance_mm, nominal.convergence_deg)
    values = np.array([*(nominal.focal_length_mm,) * 2, *(middle[0],) * 2, *(middle[1],) * 2, *lengths])
    sigma = NOMINAL_SHARE * np.abs(values)
    sigma[2:6] = NOMINAL_PRINCIPAL_PX
    return values, sigma


def _handedness(
    views: Sequence[View], nominal: NominalRig, previous: Sequence[View] | None
) -> list[RigQuantity]:
    rows = []
    for index, view in enumerate(views):
        before = None if previous is None else float(previous[index].handedness)
        stated = nominal.handedness[index]
        built = None if stated is None else float(stated)
        found = float(view.handedness)
        rows.append(RigQuantity("handedness", view.name, "", built, before, found, 0.0, None, None))
    return rows


def _middle_px(view: View, lines: int) -> Array:
    return np.array([[0.5 * (view.first_column + view.end_column - 1), 0.5 * (lines - 1)]])
