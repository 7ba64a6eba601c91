"""The test of the mounted liner without vacuum: radius, ovality, pitch of the rows and place along the axis,
as its targets show them, against its profile and the object model.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.wall.material import Material
from grabberd_liner.chain.analysis.inputs import CHAMBERS
from grabberd_liner.chain.analysis.wall_state import FieldPoints, averaged_fields
from grabberd_liner.chain.guided_tests.outcome import LINE, POINTS, Check, Curve, Evidence, Outcome, Question
from grabberd_liner.chain.guided_tests.recipes import UNMOUNTED_PITCH_MM

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


def mounted_tube(fields: Sequence[FieldPoints], grid: Grid) -> MountedTube:
    """The tube that a capture of the still liner shows.

    Args:
        fields: of the capture.
        grid: targets of the object model.

    Raises:
        AnalysisError: too few targets are seen, or they determine no tube.
    """
    (averaged,) = averaged_fields(fields, len(fields))
    mean = averaged.timed.points
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
    of_calibration = np.sqrt(np.einsum("ni,nij,nj->n", normal, mean.calibration_covariance_mm2, normal))
    common_mm = float(np.sqrt(np.mean(np.square(of_calibration))))
    # A radius is read from the height of an arc, whose error it multiplies where the arc is short.
    by_arc_mm = common_mm / max(1 - float(normal[:, 2].min()), _LEAST_ARC)
    oval_mm = 4 * float(np.sqrt(max(covariance[1, 1], 0.0)))
    return MountedTube(
        radius_mm=Estimate.of(values[0], float(np.hypot(np.sqrt(covariance[0, 0]), by_arc_mm))),
        ovality_mm=Estimate.of(4 * values[1], float(np.hypot(oval_mm, 2 * by_arc_mm))) if oval else None,
        pitch_mm=_pitch(mean, row, float(np.sqrt(1 + values[3] ** 2 + values[5] ** 2))),
        shift_mm=_shift(mean, nominal_mm),
        across_mm=offsets[:, 0],
        towards_mm=offsets[:, 1],
        sigma_mm=np.hypot(np.sqrt(np.einsum("ni,nij,nj->n", normal, mean.covariance_mm2, normal)), common_mm),
    )


def _axis(values: Array, x_mm: Array) -> Array:
    """(N, 2) Y and Z of the axis."""
    return np.column_stack([values[2] + values[3] * x_mm, values[4] + values[5] * x_mm])


def _fit(mean: Points, oval: bool) -> tuple[Array, Array, Array]:
    """Radius, half the amplitude of the oval, and the axis (6,), their covariance, and the normals (N, 3)."""
    x_mm = mean.xyz_mm[:, 0]
    values = np.array([10.0, 0.0, mean.xyz_mm[:, 1].mean(), 0.0, mean.xyz_mm[:, 2].min() - 5.0, 0.0])
    for _ in range(_ROUNDS):
        offset = mean.xyz_mm[:, 1:] - _axis(values, x_mm)
        radius = np.linalg.norm(offset, axis=1)
        sine, cosine = (offset / radius[:, np.newaxis]).T
        normal = np.column_stack([np.zeros_like(sine), sine, cosine])
        sigma = np.sqrt(np.einsum("ni,nij,nj->n", normal, mean.covariance_mm2, normal)) + _LEAST_SIGMA_MM
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


def _pitch(mean: Points, row: Array, along: float) -> Estimate:
    centred = row - row.mean()
    weights = centred / np.sum(np.square(centred))
    pitch = float(weights @ mean.xyz_mm[:, 0])
    left = mean.xyz_mm[:, 0] - mean.xyz_mm[:, 0].mean() - pitch * centred
    noise = float(np.sqrt(np.sum(np.square(weights)) * np.mean(np.square(left))))
    # An error of the calibration that grows along the liner shows as another pitch.
    scale = float(np.sqrt(mean.calibration_covariance_mm2[:, 0, 0].mean()) / np.ptp(row))
    return Estimate.of(pitch * along, np.hypot(noise, scale))


def _shift(mean: Points, nominal_mm: Array) -> Estimate:
    off = mean.xyz_mm[:, 0] - nominal_mm[:, 0]
    common = np.sqrt(mean.calibration_covariance_mm2[:, 0, 0].mean())
    return Estimate.of(off.mean(), np.hypot(off.std(ddof=1) / np.sqrt(len(off)), common))


_VACUUM_KPA = 1.0
_RADIUS_SHARE = 0.02
"""Of the radius: tension presses with T/R, so that it is as far off as the radius."""
_OVAL_MM = 1.0
"""Difference of diameters: 4 % of one; a liner that is flattened by more is pinched, or has a teat in it."""
_PITCH_SHARE = 0.01
_SHIFT_MM = 2.0
"""Along the liner: its ends are given in the object model's frame, and bending fades over 20 mm from them."""
_LEAST_STRETCH, _MOST_STRETCH = 0.02, 0.30
_LIMITS_SOURCE = "a liner that is stretched less goes slack with age; one stretched more is hard to mount"
_PITCH_SIGMA_MM = 0.05
"""σ of a pitch that was measured with a calliper before mounting, over all rows."""
_OF = "reference state, by the targets of the capture"

VACUUM_ZERO = Question(
    "vacuum_zero", "no vacuum", "open both hoses, wait until the gauges show 0, and capture again", "kPa"
)
RADIUS = Question(
    "mounted_radius",
    "radius of the targets as in the profile",
    "check the liner's label, and radius_mm, wall_mm and target_mm of its profile",
    "mm",
)
ROUND = Question(
    "round",
    "section is round",
    "take out teat or plug, let nothing pinch the liner, mount it again; a worn liner may stay oval",
    "mm",
)
PITCH = Question(
    "row_pitch",
    "pitch of the rows as in the object model",
    "mount the liner with the length that it had when the object model was measured, or measure that again",
    "mm",
)
PLACE = Question(
    "axial_place",
    "place along the liner as in the object model",
    "push the cup to its stop in the holder, or measure the object model again",
    "mm",
)
ZERO = Question(
    "pressure_zero",
    "no pressure without a teat",
    "check F0_n and the ends of the liner's profile, and whether glass bends under the vacuum",
    "kPa",
)
STRETCH = Question(
    "mounting_stretch",
    "stretch that the mounting force implies is usual",
    "measure F0_n with a spring balance at mounting, and E_mpa by a ramp",
    "1",
)
SEEN_STRETCH = Question(
    "seen_stretch",
    "stretch that is seen agrees with the mounting force",
    "measure the pitch before mounting again; let a ramp find E and F0",
    "1",
)


def reference_test(one: Evidence) -> Outcome:
    """Judges a capture of the mounted liner without vacuum."""
    tube, problem = _tube(one)
    checks = [_vacuum(one), *_shape(one, tube, problem), _pressure(one), *_stretches(one, tube)]
    return Outcome(tuple(checks), tuple(_findings(tube)), tuple(_curves(one, tube)))


def _tube(one: Evidence) -> tuple[MountedTube | None, str]:
    if one.analysis is None:
        return None, "the capture was not analysed"
    try:
        return mounted_tube(one.captured, one.analysis.grid), ""
    except AnalysisError as error:
        return None, error.message


def _vacuum(one: Evidence) -> Check:
    """The greater of both chambers, where a gauge has read it."""
    if one.analysis is None or not one.analysis.vacuum:
        return VACUUM_ZERO.not_checked("the vacuum is not known")
    if not one.analysis.inputs.channels and "log" not in one.analysis.inputs.vacuum:
        return VACUUM_ZERO.not_checked("no gauge has read it: it is what the steps of the recipe say")
    read = one.analysis.vacuum
    chambers = [
        Estimate.of(
            np.mean([getattr(at, f"{name}_kpa") for at in read]),
            np.mean([getattr(at, f"{name}_sigma_kpa") for at in read]),
        )
        for name in CHAMBERS
    ]
    return VACUUM_ZERO.within(max(chambers, key=lambda found: abs(float(found.value))), 0.0, _VACUUM_KPA)


def _shape(one: Evidence, tube: MountedTube | None, problem: str) -> Iterator[Check]:
    if tube is None or one.analysis is None:
        yield from (question.not_checked(problem) for question in (RADIUS, ROUND, PITCH, PLACE))
        return
    material = one.material
    if material is None:
        yield RADIUS.not_checked("the liner's material is not known")
    else:
        expected_mm = material.radius_mm + material.depth_mm
        radius_mm, sigma_mm = (float(part) for part in tube.radius_mm)
        found = Estimate.of(radius_mm, float(np.hypot(sigma_mm, material.wall_sigma_mm / 2)))
        yield RADIUS.within(found, expected_mm, _RADIUS_SHARE * expected_mm)
    if tube.ovality_mm is None:
        yield ROUND.not_checked(
            "both views see fewer than five columns, which do not tell an oval from a circle"
        )
    else:
        yield ROUND.within(tube.ovality_mm, 0.0, _OVAL_MM)
    expected_mm = _nominal_pitch_mm(one)
    yield PITCH.within(tube.pitch_mm, expected_mm, _PITCH_SHARE * expected_mm)
    yield PLACE.within(tube.shift_mm, 0.0, _SHIFT_MM)


def _nominal_pitch_mm(one: Evidence) -> float:
    assert one.analysis is not None
    grid = one.analysis.grid
    slope, _ = np.polyfit(grid.row, grid.nominal_mm[:, 0], 1)
    return float(slope)


def _pressure(one: Evidence) -> Check:
    if one.analysis is None:
        return ZERO.not_checked("the capture was not analysed")
    found, _ = one.mean_contact_kpa()
    if not math.isfinite(float(found.value)):
        return ZERO.not_checked(one.no_pressure)
    return ZERO.agrees(found, 0.0, float(found.sigma))


def _stretches(one: Evidence, tube: MountedTube | None) -> Iterator[Check]:
    material = one.material
    if material is None:
        yield from (ask.not_checked("the liner's material is not known") for ask in (STRETCH, SEEN_STRETCH))
        return
    implied = mounting_stretch(material)
    excess = Estimate.of(float(implied.value) - 1, float(implied.sigma))
    middle, reach = (_MOST_STRETCH + _LEAST_STRETCH) / 2, (_MOST_STRETCH - _LEAST_STRETCH) / 2
    yield STRETCH.within(excess, middle, reach, _LIMITS_SOURCE)
    free_mm = one.labelled(UNMOUNTED_PITCH_MM)
    if tube is None or not free_mm > 0:
        yield SEEN_STRETCH.not_checked(
            f"label {UNMOUNTED_PITCH_MM} of the capture does not say the rows' pitch before mounting"
        )
        return
    seen = float(tube.pitch_mm.value) / free_mm
    sigma = seen * np.hypot(
        float(tube.pitch_mm.sigma) / float(tube.pitch_mm.value), _PITCH_SIGMA_MM / free_mm
    )
    yield SEEN_STRETCH.agrees(
        Estimate.of(seen, sigma), float(implied.value), float(np.hypot(sigma, implied.sigma))
    )


def mounting_stretch(material: Material) -> Estimate:
    """Stretch λ along the liner that its mounting force implies, by neo-Hookean rubber.

    F0 / 2πRt is the true stress E/3 (λ² − 1/λ), with the thickness as mounted.
    """
    stress = material.F0_n / (2 * np.pi * material.radius_mm * material.wall_mm) / material.E_mpa
    stretch = 1.0 + stress
    for _ in range(40):
        stretch -= (stretch**2 - 1 / stretch - 3 * stress) / (2 * stretch + 1 / stretch**2)
    # Of ln stress by ln E, ln t, ln F0, whose errors go together after a ramp.
    relative = np.array(
        [
            material.E_sigma_mpa / material.E_mpa,
            material.wall_sigma_mm / material.wall_mm,
            material.F0_sigma_n / material.F0_n if material.F0_n else 0.0,
        ]
    ) * (-1.0, -1.0, 1.0)
    both, young_force, force_wall = material.correlations
    related = np.array([[1, both, young_force], [both, 1, force_wall], [young_force, force_wall, 1]])
    of_stress = stress * np.sqrt(max(float(relative @ related @ relative), 0.0))
    return Estimate.of(stretch, 3 * of_stress / (2 * stretch + 1 / stretch**2))


def _findings(tube: MountedTube | None) -> Iterator[Finding]:
    quantities = {
        "mounted_radius_mm": ("radius of the targets", "Mean distance of the targets from the tube's axis."),
        "ovality_mm": ("ovality", "Diameter towards the cameras less that across the view."),
        "row_pitch_mm": ("pitch of the rows", "Distance of neighbouring rows of targets along the axis."),
        "axial_shift_mm": ("place along the liner", "Mean place of the targets less the object model's."),
    }
    found = (tube.radius_mm, tube.ovality_mm, tube.pitch_mm, tube.shift_mm) if tube else (None,) * 4
    for (name, (title, definition)), value in zip(quantities.items(), found, strict=True):
        quantity = Quantity(name, title, "mm", definition, _OF)
        yield Finding.of(quantity, value) if value else Finding.missing(quantity, "too few targets are seen")


def _curves(one: Evidence, tube: MountedTube | None) -> Iterator[Curve]:
    if tube is None:
        return
    axes = (("across the view", "mm"), ("towards the cameras", "mm"))
    yield Curve("section", "targets", axes, POINTS, tube.across_mm, tube.towards_mm, tube.sigma_mm)
    if (material := one.material) is not None:
        angle = np.radians(np.linspace(-100, 100, 81))
        radius_mm = material.radius_mm + material.depth_mm
        x, y = radius_mm * np.sin(angle), radius_mm * np.cos(angle)
        yield Curve("profile_section", "profile", axes, LINE, x, y, np.full(len(x), np.nan))
