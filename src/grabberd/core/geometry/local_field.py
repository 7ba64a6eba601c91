"""Local field: smooth displacements in one view's half of the picture that the global model does not explain.

    observed = equations (6), (7) + field(observed position)

The field is a uniform bicubic spline. It spans the whole half: where the calibration frame had no targets
nearby, its estimate has faded to zero and its σ has grown to the prior's, so no special rule for such places
is needed. Nothing is seen beyond the half; positions there take the value of the nearest edge.

Movement of a view's images since the calibration: camera, mirrors or cup have been turned or pushed.

    observed now = observed at calibration + movement(observed now)

To first order a homography moves an image by a sum of eight patterns. Three are what a turn of the camera
does, the keystone that comes with the shift included. The others (scale, aspect, skew, further keystone) are
small beside these when a camera or a mirror is turned; what few marks do not determine of them stays in σ.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry.document_reader import Reading
from grabberd.core.geometry.view import View

_KEYS = ("origin_px", "step_px", "x_px", "y_px", "sigma_x_px", "sigma_y_px")
_CUBIC = np.array([[1, -3, 3, -1], [4, 0, -6, 3], [1, 3, 3, -3], [0, 0, 0, 1]]) / 6.0
"""Four pieces of the uniform cubic B-spline over one interval, by powers of the position in it."""
_SHORT = 1e-9
"""Intervals by which the last position is kept short of the last node, so that it has an interval."""
_LEAST_NODES = 4


@dataclass(frozen=True, slots=True, eq=False)
class LocalField:
    """Spline with a coefficient at every node of a square grid.

    Attributes:
        origin_px: Frame pixel (x, y) where the spline begins; its first coefficients lie one step before.
        step_px: Distance between nodes, in columns and in frame lines.
        shift_px: (rows, columns, 2) float64, coefficients of the displacement in x and y.
        sigma_px: (rows, columns, 2) float64, coefficients of its standard deviation.
    """

    origin_px: tuple[float, float]
    step_px: float
    shift_px: Array
    sigma_px: Array

    @classmethod
    def through(
        cls, origin_px: tuple[float, float], step_px: float, shift: Array, sigma: Array
    ) -> "LocalField":
        """Interpolate displacements at the nodes by a natural spline.

        Args:
            origin_px: Frame pixel of the first node.
            step_px: Distance between nodes, in columns and in frame lines.
            shift: (rows, columns, 2) displacements at the nodes, frame pixels.
            sigma: (rows, columns, 2) their standard deviations; used as coefficients, which smooths them a
                little and keeps them above 0 everywhere.
        """
        edges = np.pad(sigma, ((1, 1), (1, 1), (0, 0)), mode="edge")
        return cls(
            origin_px, step_px, _interpolating(_interpolating(shift).swapaxes(0, 1)).swapaxes(0, 1), edges
        )

    @classmethod
    def unknown(cls, first_column: int, end_column: int, lines: int, sigma_px: float) -> "LocalField":
        """Make one of which only the size is known, the same everywhere."""
        step = max(end_column - first_column, lines) / (_LEAST_NODES - 1)
        nowhere = np.zeros((_LEAST_NODES, _LEAST_NODES, 2))
        return cls.through((first_column - 0.5, -0.5), step, nowhere, nowhere + sigma_px)

    @classmethod
    def flat(cls, first_column: int, end_column: int, lines: int, step_px: float) -> "LocalField":
        """Make one without any displacement, over columns and frame lines, to add others to."""
        rows, columns = (int(-(-size // step_px)) + 1 for size in (lines, end_column - first_column))
        nowhere = np.zeros((max(rows, 2), max(columns, 2), 2))
        return cls.through((first_column - 0.5, -0.5), step_px, nowhere, nowhere)

    @property
    def nodes_px(self) -> Array:
        """(rows, columns, 2) frame pixels of the nodes that displacements are interpolated through."""
        rows, columns = (count - 2 for count in self.shift_px.shape[:2])
        x, y = (
            at + self.step_px * np.arange(count)
            for at, count in zip(self.origin_px, (columns, rows), strict=True)
        )
        return np.stack(np.meshgrid(x, y), axis=2)

    def at(self, xy_px: Array) -> Array:
        """(N, 2) float64 displacements in frame pixels at observed positions (N, 2)."""
        return self._value(self.shift_px, xy_px)

    def sigma_at(self, xy_px: Array) -> Array:
        """(N, 2) float64 standard deviations of x and y left after subtracting `at`, frame pixels."""
        return self._value(self.sigma_px, xy_px)

    @classmethod
    def from_document(cls, reading: Reading, where: str, values: Mapping[str, Any]) -> "LocalField":
        """Read the field from its part of a calibration document; problems are added to `reading`."""
        reading.keys(where, values, _KEYS)
        shape = _shape(reading, where, values.get("x_px"))
        x, y, sigma_x, sigma_y = (reading.numbers(values.get(key), where + key, shape) for key in _KEYS[2:])
        if min(sigma_x.min(), sigma_y.min()) < 0:
            reading.problems.append(f"{where}sigma_x_px, sigma_y_px: a standard deviation is below 0")
        origin = reading.numbers(values.get("origin_px"), where + "origin_px", (2,)).tolist()
        step = reading.number(values, "step_px", where, positive=True)
        return cls(
            (origin[0], origin[1]), step, np.stack([x, y], axis=2), np.stack([sigma_x, sigma_y], axis=2)
        )

    def to_document(self) -> dict[str, Any]:
        """Convert to its part of the document; `from_document` restores the same field bit for bit."""
        channels = [*np.moveaxis(self.shift_px, 2, 0), *np.moveaxis(self.sigma_px, 2, 0)]
        arrays = zip(_KEYS[2:], (channel.tolist() for channel in channels), strict=True)
        return {"origin_px": list(self.origin_px), "step_px": self.step_px, **dict(arrays)}

    def _value(self, coefficients: Array, xy_px: Array) -> Array:
        rows, columns, _ = coefficients.shape
        position = (xy_px - self.origin_px) * (1.0 / self.step_px)
        np.clip(position, 0.0, (columns - 3 - _SHORT, rows - 3 - _SHORT), out=position)
        first = position.astype(np.intp)
        along_x, along_y = _weights(position - first)
        taps = coefficients.reshape(-1, 2).take(
            (first[:, 1] * columns + first[:, 0])[:, np.newaxis] + _taps(columns), axis=0
        )
        strips = along_y[:, np.newaxis] @ taps.reshape(-1, 4, 8)
        return (along_x[:, np.newaxis] @ strips.reshape(-1, 4, 2))[:, 0]


class LocalFields(NamedTuple):
    """Both views' local fields.

    Attributes:
        left: That of the left view; None if it has none.
        right: That of the right view.
        correlation: Correlation of their errors in x and in y, at images of one point.
    """

    left: LocalField | None
    right: LocalField | None
    correlation: tuple[float, float] = (0.0, 0.0)


def _weights(part: Array) -> Array:
    """(2, N, 4) weights of the four coefficients along x and along y, at a part (N, 2) of an interval."""
    powers = np.ones((4, *part.shape))
    powers[1] = part
    np.multiply(part, part, out=powers[2])
    np.multiply(powers[2], part, out=powers[3])
    return (_CUBIC @ powers.reshape(4, -1)).reshape(4, *part.shape).transpose(2, 1, 0)


def _taps(columns: int) -> Indices:
    """(16,) offsets of the coefficients that a position depends on from the first of them."""
    return (np.arange(4)[:, np.newaxis] * columns + np.arange(4)).ravel()


def _interpolating(values: Array) -> Array:
    """Coefficients along the first axis, two more than values; linear beyond the ends."""
    count = len(values)
    matrix = (np.eye(count + 2) + 4 * np.eye(count + 2, k=1) + np.eye(count + 2, k=2))[:count] / 6.0
    straight = np.zeros((2, count + 2))
    straight[0, :3] = straight[1, -3:] = (1.0, -2.0, 1.0)
    right = np.concatenate([values, np.zeros((2, *values.shape[1:]))]).reshape(count + 2, -1)
    solved: Array = np.linalg.solve(np.concatenate([matrix, straight]), right)
    return solved.reshape(count + 2, *values.shape[1:])


def _shape(reading: Reading, where: str, value: object) -> tuple[int, int]:
    """Rows and columns of the first array; a harmless shape if it is invalid."""
    if isinstance(value, list) and value and isinstance(value[0], list):
        shape = len(value), len(value[0])
        if min(shape) >= _LEAST_NODES:
            return shape
    reading.refuse(where + "x_px", value, f"at least {_LEAST_NODES} rows of {_LEAST_NODES} numbers")
    return _LEAST_NODES, _LEAST_NODES


PATTERNS = ("turn_x", "turn_y", "rotation", "scale", "aspect", "skew", "keystone_x", "keystone_y")
"""Each in px: a shift of the principal point by turning the camera, or what it does at the view's corner."""
_STRONG = 3
"""Patterns of a camera that is turned; a mirror that is turned, a cup that tilts show some of the others."""
_LARGE_PX = 20.0
_SHIFTS, _DEPTH_SHARE = np.arange(2), 0.005
"""σ of a shift as a share of it: a turned mirror shifts nearer images further, by 1 % for 10 mm."""
STEP_PX = 48.0
"""Nodes of the movement's spline, which reproduces its squares to .002 of the movement."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageMovement:
    """Smooth movement of one view's images.

    Attributes:
        view: The view as calibrated.
        lines: Picture height in frame lines.
        pattern_px: (8,) coefficients of `PATTERNS`.
        covariance_px2: (8, 8) their covariance.
        cost: Squares of the displacements in units of the σ of their noise and of what the largest share
            allows; about twice the number of marks, less the three of a turn, where they move as one.
    """

    view: View
    lines: int
    pattern_px: Array
    covariance_px2: Array
    cost: float

    @classmethod
    def fitted(
        cls,
        view: View,
        lines: int,
        places_px: Array,
        displacement_px: Array,
        sigma_px: Array,
        shares: Sequence[float],
    ) -> "ImageMovement":
        """Fit it to displacements of marks.

        A turned camera is free, the other patterns have a common prior: one of some shares of the
        displacements' size. The displacements weigh the shares by their likelihood, as a scale that is not
        known beforehand, so that σ is that of a turn where nothing else is seen.

        Args:
            view: The view as calibrated.
            lines: Picture height in frame lines.
            places_px: (K, 2) places of the marks, frame pixels.
            displacement_px: (K, 2) observed now minus at calibration.
            sigma_px: (K, 2) standard deviations, above 0.
            shares: Prior σ of the other patterns as shares of the displacements, in rising order.
        """
        design = _patterns(view, lines, places_px).reshape(-1, len(PATTERNS))
        observed, noise = displacement_px.reshape(-1), np.diag(sigma_px.reshape(-1) ** 2)
        size_px = float(np.sqrt((displacement_px**2).sum(axis=1).mean()))
        fits = [_Fit.of(design, observed, noise, share * size_px) for share in shares]
        likelihood = np.array([one.log_likelihood for one in fits])
        weights = np.exp(likelihood - likelihood.max())
        weights /= weights.sum()
        patterns = np.array([one.pattern_px for one in fits])
        mean = weights @ patterns
        spread = patterns - mean
        covariance = np.tensordot(weights, [one.covariance_px2 for one in fits], axes=1)
        covariance = covariance + spread.T @ (weights[:, np.newaxis] * spread)
        # Marks that agree worse than their σ let the rest be known worse, too.
        worse = max(fits[-1].cost / (len(observed) - _STRONG), 1.0)
        covariance *= worse
        covariance[_SHIFTS, _SHIFTS] += (_DEPTH_SHARE * mean[_SHIFTS]) ** 2
        return cls(view, lines, mean, covariance, fits[-1].cost)

    def at(self, xy_px: Array) -> Array:
        """(N, 2) movement in frame pixels at observed positions (N, 2)."""
        moved: Array = _patterns(self.view, self.lines, xy_px) @ self.pattern_px
        return moved

    def sigma_at(self, xy_px: Array) -> Array:
        """(N, 2) standard deviation of x and y left after subtracting `at`, frame pixels."""
        patterns = _patterns(self.view, self.lines, xy_px)
        return np.sqrt(((patterns @ self.covariance_px2) * patterns).sum(axis=2))

    @property
    def in_the_middle(self) -> tuple[Array, Array]:
        """(2,) shift of the middle of the view in x and y, frame pixels, and its standard deviation."""
        middle = _middle(self.view, self.lines)[0][np.newaxis]
        return self.at(middle)[0], self.sigma_at(middle)[0]

    @property
    def size_px(self) -> float:
        """Root mean square of the movement over the view."""
        return _rms(self.at(_over(self.view, self.lines)))

    @property
    def sigma_px(self) -> float:
        """Root mean square of its standard deviation over the view."""
        return _rms(self.sigma_at(_over(self.view, self.lines)))

    def added_to(self, known: LocalField | None) -> LocalField:
        """The local field of a view that has moved, with the movement's σ; `known` is the calibration's."""
        base = known or LocalField.flat(self.view.first_column, self.view.end_column, self.lines, STEP_PX)
        nodes = base.nodes_px
        flat = nodes.reshape(-1, 2)
        shift, sigma = (values.reshape(nodes.shape) for values in (self.at(flat), self.sigma_at(flat)))
        own = LocalField.through(base.origin_px, base.step_px, shift, sigma)
        return LocalField(
            base.origin_px, base.step_px, base.shift_px + own.shift_px, np.hypot(base.sigma_px, own.sigma_px)
        )


class _Fit(NamedTuple):
    """The patterns for one size of those beside a turn."""

    pattern_px: Array
    covariance_px2: Array
    cost: float
    log_likelihood: float

    @classmethod
    def of(cls, design: Array, observed: Array, noise: Array, weak_px: float) -> "_Fit":
        prior = np.full(len(PATTERNS), weak_px**2)
        prior[:_STRONG] = _LARGE_PX**2
        spread = prior[:, np.newaxis] * design.T
        total = design @ spread + noise
        gain = np.linalg.solve(total, spread.T).T
        cost = float(observed @ np.linalg.solve(total, observed))
        return cls(
            gain @ observed,
            np.diag(prior) - gain @ spread.T,
            cost,
            -0.5 * (cost + float(np.linalg.slogdet(total)[1])),
        )


def _patterns(view: View, lines: int, xy_px: Array) -> Array:
    """(N, 2, 8) displacement in x and y by 1 px of every pattern at positions (N, 2)."""
    focal = np.array([view.f_mm / view.pixel_x_mm, view.f_mm / view.pixel_y_mm])
    u, v = ((xy_px - (view.x0_px, view.y0_px)) / focal).T
    middle, radius = _middle(view, lines)
    a, b = ((xy_px - middle) / radius).T
    # About the camera's axis, and in millimetres: pixels need not be square.
    aspect, (away_x, away_y) = focal[1] / focal[0], (xy_px - (view.x0_px, view.y0_px)).T / radius
    x = [1.0 + u * u, u * v / aspect, -away_y / aspect, away_x, a, b, a * a, a * b]
    y = [u * v * aspect, 1.0 + v * v, away_x * aspect, away_y, -b, a, a * b, b * b]
    return np.stack([np.stack(row, axis=1) for row in (x, y)], axis=1)


def _middle(view: View, lines: int) -> tuple[Array, float]:
    """Middle of a view's half, and its distance from the corners, frame pixels."""
    middle = np.array([0.5 * (view.first_column + view.end_column - 1), 0.5 * (lines - 1)])
    return middle, float(np.hypot(0.5 * (view.end_column - view.first_column), 0.5 * lines))


def _over(view: View, lines: int) -> Array:
    """Positions all over a view."""
    x = np.linspace(view.first_column, view.end_column - 1, 5)
    y = np.linspace(0, lines - 1, 7)
    return np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2)


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).sum(axis=1).mean()))
