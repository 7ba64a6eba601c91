"""Planning: expected σ of X, Y and Z before anything is built, from the rig's nominal dimensions."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import Calibration, NominalRig, Rig, View, linearise, project_all
from grabberd.core.measurement.noise import binary_sigma_px
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect
from grabberd.core.reconstruction.accuracy import Axes
from grabberd.errors import InputError

Lines = Literal["doubled", "field", "progressive"]
"""Lines of a picture: a field's own and those interpolated between them, a field's own alone, or all of a
progressive picture."""
LINES_IN_WORDS: dict[Lines, str] = {
    "doubled": "doubled lines",
    "field": "intact lines",
    "progressive": "progressive lines",
}
_GREY_OF_BOUND = (1.2, 1.5)
"""Measured error of a grey centre in x, y over the Cramér–Rao bound: .019 and .024 px at D = 5, 2 % noise."""
_WHOLE_OF_BOUND = (1.2, 1.2)
"""The same where no line is missing: .013 px in both at D = 5.9, 2 % noise."""
_FEW_BITS = {2: 6.0, 3: 3.0, 4: 1.7}
"""Factor on the error of a grey centre by bits per pixel; 5 bits are as good as 8."""
_UNSOLVED = 0.7
"""Share of the line jitter that remains after solving for the line shifts."""
_VARIED_BY = 0.2
_SMALL = 1e-3
"""Share of the noise that is added in a simulated adjustment: small enough that its covariance is that of the
nominal rig, and not zero, since σ0 divides the covariance."""


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """Expected properties of the picture.

    Attributes:
        target_diameter_mm: diameter of the discs.
        bits: bits per pixel; `lines`: lines of a picture.
        noise: standard deviation of a pixel as a share of the contrast.
        spread_px: σ of the spread function; `line_jitter_px`: σ of a line's shift.
        sigma_px: measured pointing in x and y including line jitter, in place of the predicted one.
    """

    target_diameter_mm: float = 1.5
    bits: int = 1
    lines: Lines = "doubled"
    noise: float = 0.02
    spread_px: float = 0.8
    line_jitter_px: float = 0.12
    sigma_px: tuple[float, float] | None = None

    @property
    def lines_apart(self) -> int:
        """Frame lines from one row of the picture to the next."""
        return 2 if self.lines == "field" else 1


class PlannedPlace(NamedTuple):
    """Expected σ at one position.

    Attributes:
        name: name of the position; `xyz_mm`: its coordinates, object's frame.
        pointing: σ of one field's point; None unless both views see the position.
        calibration: the calibration's share, which no averaging reduces; None if unknown.
    """

    name: str
    xyz_mm: tuple[float, float, float]
    pointing: Axes | None
    calibration: Axes | None


class Plan(NamedTuple):
    """Expected σ over a volume.

    Attributes:
        places: centre, middles of the faces, and corners of the volume.
        sigma_px: pointing at the centre, without line jitter unless the settings give it as measured.
        mm_per_px: scale at the centre, along the lines and across them.
    """

    places: tuple[PlannedPlace, ...]
    sigma_px: tuple[float, float]
    mm_per_px: tuple[float, float]


def plan(rig: Rig, low_mm: Array, high_mm: Array, settings: PlanSettings) -> Plan:
    """Expected σ of points in a box.

    Args:
        rig: both views, nominal or calibrated; with a covariance, the calibration's share is computed too.
        low_mm: (3,) one corner of the box.
        high_mm: (3,) the opposite corner.
        settings: expected properties of the picture.

    Raises:
        InputError: a view does not see the middle of the box.
    """
    named = list(_places(low_mm, high_mm))
    xyz = np.array([place for _, place in named])
    seen = _seen(rig, xyz)
    if not seen[0]:
        raise InputError(
            f"not both views see the middle of the volume, at {xyz[0].round(1).tolist()} mm",
            "check the rig's nominal dimensions and the object's coordinates",
        )
    covariance, share = np.full((2, len(xyz), 3, 3), np.nan)
    covariance[seen], share[seen] = _covariance(rig, xyz[seen], settings)
    planned = tuple(
        PlannedPlace(
            name,
            (float(at[0]), float(at[1]), float(at[2])),
            Axes.of(np.diag(own)) if visible else None,
            Axes.of(np.diag(common)) if visible and rig.factor is not None else None,
        )
        for (name, at), own, common, visible in zip(named, covariance, share, seen, strict=True)
    )
    x_px, y_px = (1.0 / _px_per_mm(rig, xyz[:1])).ravel().tolist()
    sigma = _pointing(rig, xyz[:1], settings)
    return Plan(planned, (float(sigma[0, 0]), float(sigma[0, 1])), (x_px, y_px))


def variations(rig: NominalRig, settings: PlanSettings) -> Iterator[tuple[str, NominalRig, PlanSettings]]:
    """The rig unchanged, then with one thing changed at a time: base, distance, bits."""
    yield "as it is", rig, settings
    for name in ("base", "distance"):
        for share in (-_VARIED_BY, _VARIED_BY):
            changed = {f"{name}_mm": getattr(rig, f"{name}_mm") * (1.0 + share)}
            yield f"{name} {100 * share:+.0f} %", _agreeing(replace(rig, **changed)), settings
    if settings.sigma_px is None:
        for bits, lines in _kinds(settings.lines):
            label = f"{bits} bit{'s' * (bits > 1)}, {LINES_IN_WORDS[lines]}"
            yield label, rig, replace(settings, bits=bits, lines=lines)


def _kinds(lines: Lines) -> Sequence[tuple[int, Lines]]:
    """Bits and lines that a camera of this kind can have."""
    if lines == "progressive":
        return (1, lines), (4, lines), (8, lines)
    return (1, "doubled"), (1, "field"), (4, "field"), (8, "field")


def nominal_calibration(
    rig: NominalRig, frame: ObjectModel, settings: PlanSettings, handedness: tuple[int, int] = (1, 1)
) -> Calibration:
    """Covariance to expect from calibrating the nominal rig, by a simulated adjustment.

    All parameters of both views are free, b9 = b8. Image points are weighted by the pointing of one field,
    since averaging does not reduce quantisation; the calibration frame's targets are known to its σ.

    Raises:
        InputError: a view does not see enough of the calibration frame's targets.
        MeasurementError: the calibration frame does not determine the parameters.
    """
    views = rig.views(handedness)
    network = _simulated(rig, views, frame, settings)
    adjusted = adjust(network, Unknowns.of(views, tied=True))
    left, right = views
    return Calibration(
        id="nominal",
        created_utc="1970-01-01T00:00:00Z",
        source="simulated adjustment of a nominal rig",
        columns=rig.columns,
        lines=rig.lines,
        left=left,
        right=right,
        covariance=adjusted.parameter_covariance / adjusted.sigma0**2,
    )


def _simulated(
    rig: NominalRig, views: tuple[View, View], frame: ObjectModel, settings: PlanSettings
) -> Network:
    """Images of the targets that lie in each view, with a little noise so that σ0 is not zero."""
    ready = Rig.of_views(views)
    sigma = np.hypot(
        _pointing(ready, frame.xyz_mm, settings), (_jitter_px(ready, frame.xyz_mm, settings), 0.0)
    )
    xy = project_all(ready, frame.xyz_mm)
    inside = np.array([_holds(view, xy[:, index], rig.lines) for index, view in enumerate(views)])
    if inside.sum(axis=1).min() < 12:
        raise InputError(
            f"the nominal views see {inside[0].sum()} and {inside[1].sum()} of {len(frame)} targets of the "
            "calibration frame; 12 are needed in each",
            "check the rig's nominal dimensions, or use a smaller calibration frame",
        )
    view, target = np.nonzero(inside)
    # A fixed seed: a plan of the same rig is the same every time.
    noise = np.random.default_rng(0).normal(size=(len(target), 2)) * sigma[target]
    places = xy[:, view, target].T + _SMALL * noise
    known = np.full_like(frame.xyz_mm, frame.sigma_mm)
    return Network(views, view, target, places, sigma[target], frame.xyz_mm, known)


def _places(low_mm: Array, high_mm: Array) -> Iterator[tuple[str, Array]]:
    middle, half = 0.5 * (low_mm + high_mm), 0.5 * (high_mm - low_mm)
    yield "centre", middle
    for axis, letter in enumerate("XYZ"):
        for sign in (-1.0, 1.0):
            yield f"{'+' if sign > 0 else '−'}{letter}", middle + sign * half * np.eye(3)[axis]
    for index in range(8):
        signs = np.array([1.0 if index >> axis & 1 else -1.0 for axis in range(3)])
        letters = " ".join(f"{'+' if s > 0 else '−'}{c}" for s, c in zip(signs, "XYZ", strict=True))
        yield letters, middle + signs * half


def _covariance(rig: Rig, xyz_mm: Array, settings: PlanSettings) -> tuple[Array, Array]:
    """(N, 3, 3) covariance from pointing and line jitter, and the calibration's share of it.

    A target's images in the two views are taken to share half of the line jitter: midway between images on
    the same lines, as in the nominal rig, and on different lines, as misaligned mirrors may place them.
    """
    pointing, jitter_px = _pointing(rig, xyz_mm, settings), _jitter_px(rig, xyz_mm[:1], settings)
    # A line that jitters moves along itself: only x is affected.
    whole = np.hypot(pointing, (jitter_px, 0.0))
    image, slopes = linearise(rig, xyz_mm)
    design = slopes.transpose(3, 0, 1, 2).reshape(-1, 4, 3)
    noise = np.repeat(whole, 2, axis=1)[:, :, np.newaxis] ** 2 * np.eye(4)
    noise[:, (0, 1), (1, 0)] += 0.5 * jitter_px**2
    covariance: Array = np.linalg.inv(design.swapaxes(1, 2) @ np.linalg.solve(noise, design))
    left, right = (ViewBlobs(image[:, view].T.copy(), whole) for view in (0, 1))
    number = np.arange(len(xyz_mm), dtype=np.int32)
    points = intersect(rig, number, left, right, ImageNoise(0.0, 2, 1.0), xyz_mm)
    return covariance, points.calibration_covariance_mm2


def _jitter_px(rig: Rig, xyz_mm: Array, settings: PlanSettings) -> float:
    """Error of a blob's x from line jitter; less for grey, intact lines, whose shifts are solved for.

    Lines of a progressive picture do not shift.
    """
    if settings.sigma_px or settings.lines == "progressive":
        return 0.0
    radius = 0.5 * settings.target_diameter_mm * float(_px_per_mm(rig, xyz_mm)[0, 1])
    jitter_px = ImageNoise(settings.line_jitter_px, settings.lines_apart, radius).blob_jitter_px
    return jitter_px if settings.bits == 1 or settings.lines == "doubled" else _UNSOLVED * jitter_px


def _pointing(rig: Rig, xyz_mm: Array, settings: PlanSettings) -> Array:
    """(N, 2) σ of x and y in px, without line jitter unless the settings give it as measured."""
    if settings.sigma_px:
        return np.tile(np.array(settings.sigma_px), (len(xyz_mm), 1))
    diameter = settings.target_diameter_mm * np.sqrt(_px_per_mm(rig, xyz_mm).prod(axis=1))
    doubled = settings.lines == "doubled"
    binary = binary_sigma_px(0.25 * np.pi * diameter**2, settings.lines_apart, doubled=doubled)
    if settings.bits == 1:
        return binary
    # Interpolated lines tell nothing that is not known from the field's own, which are two apart.
    apart = 1 if settings.lines == "progressive" else 2
    bound = settings.noise * np.sqrt(2.0 * apart * settings.spread_px / (math.sqrt(math.pi) * 0.5 * diameter))
    of_bound = _WHOLE_OF_BOUND if settings.lines == "progressive" else _GREY_OF_BOUND
    grey = bound[:, np.newaxis] * of_bound * _FEW_BITS.get(settings.bits, 1.0)
    # Grey values contain the one-bit picture: with strong noise they are no worse than it.
    return np.minimum(grey, binary)


def _px_per_mm(rig: Rig, xyz_mm: Array) -> Array:
    """(N, 2) scale along the lines and across them, averaged over both views."""
    _, slopes = linearise(rig, xyz_mm)
    return np.sqrt((slopes * slopes).sum(axis=2)).mean(axis=1).T


def _seen(rig: Rig, xyz_mm: Array) -> Mask:
    image = project_all(rig, xyz_mm)
    return np.all([view.holds(image[:, i].T) for i, view in enumerate(rig.views)], axis=0)


def _holds(view: View, xy_px: Array, lines: int) -> Mask:
    return view.holds(xy_px.T) & (xy_px[1] >= 0) & (xy_px[1] < lines)


def _agreeing(rig: NominalRig) -> NominalRig:
    """The rig with the convergence that its base and distance imply."""
    return replace(rig, convergence_deg=2.0 * math.degrees(math.atan(0.5 * rig.base_mm / rig.distance_mm)))
