"""The synthetic view: the surface as a camera would see it, with the grey values of another view (paper
3.7), and its fit to the camera's own picture by least squares matching of each target.

Every pixel's ray is cast onto the estimated surface, and the intersection is looked up in the picture of the
source view. Errors of model, surface and calibration shift one picture against the other: picture(x + shift)
= offset + gain · synthetic(x); offset and gain absorb differences in light and sensitivity.
"""

from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.field import PROGRESSIVE, Field
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.camera import Camera, Hits, Raster, cast, nearest
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.surface.surface import Mesh, Surface

_HIDDEN_MM = 1.0
"""A point is hidden from a camera if the mesh in the nearest pixel is nearer by more than this."""


class SyntheticView(NamedTuple):
    """A picture made from the surface and the grey values of a source view.

    Attributes:
        raster: its pixels.
        grey: (lines, columns) grey values; NaN, that is empty, where no data support the surface, where it
            turns away or is hidden from one of the two cameras, or lies outside the source's picture.
        hits: intersections of its rays with the surface, N = lines · columns, line by line.
    """

    raster: Raster
    grey: Array
    hits: Hits

    @property
    def filled(self) -> Mask:
        """(lines, columns) True for pixels that are not empty."""
        return np.isfinite(self.grey)


def synthetic_view(
    surface: Surface, camera: Camera, raster: Raster, source: Camera, field: Field
) -> SyntheticView:
    """The surface as one camera would see it, painted with the grey values of another.

    Args:
        surface: the outer face at the field's time.
        camera: any camera, the other view or a free one.
        raster: pixels of the view.
        source: the camera that took the grey values.
        field: picture of the source, intact or doubled.
    """
    mesh = Mesh.of(surface)
    hits = cast(surface, mesh, camera, raster)
    grey = np.full(len(hits.u_mm), np.nan)
    met = np.flatnonzero(np.isfinite(hits.u_mm))
    places = source.pixels(hits.xyz_mm[met])
    seen = _shown(hits.xyz_mm[met], hits.normal[met], places, source, field, mesh)
    grey[met[seen]] = grey_at(field, places[seen])
    return SyntheticView(raster, grey.reshape(raster.shape), hits)


def grey_at(field: Field, xy_px: Array) -> Array:
    """(N,) grey values at frame pixels (N, 2), bilinear; NaN outside the field."""
    column, row = xy_px[:, 0], (xy_px[:, 1] - field.y0) / field.y_step
    inside = (column >= 0) & (column <= field.columns - 1) & (row >= 0) & (row <= field.rows - 1)
    left = np.clip(np.floor(np.where(inside, column, 0)), 0, field.columns - 2).astype(np.intp)
    above = np.clip(np.floor(np.where(inside, row, 0)), 0, field.rows - 2).astype(np.intp)
    part_x, part_y = column - left, row - above
    luma = field.luma
    upper = (1 - part_x) * luma[above, left] + part_x * luma[above, left + 1]
    lower = (1 - part_x) * luma[above + 1, left] + part_x * luma[above + 1, left + 1]
    return np.where(inside, (1 - part_y) * upper + part_y * lower, np.nan)


def _shown(xyz_mm: Array, normal: Array, places: Array, source: Camera, field: Field, mesh: Mesh) -> Mask:
    """(N,) True for points that the source's picture shows: in its half, facing it, and not hidden."""
    toward = source.view.center_mm - xyz_mm
    line = (places[:, 1] - field.y0) / field.y_step
    inside = source.view.holds(places) & (line >= 0) & (line <= field.rows - 1)
    facing = np.einsum("na,na->n", normal, toward) > 0
    raster = Raster(source.columns, range(field.y0, field.y0 + field.rows * field.y_step, field.y_step))
    buffer = nearest(mesh, source, raster).distance_mm
    column, row = np.nan_to_num(np.round(raster.places(places))).astype(np.intp).T
    before = buffer[np.clip(row, 0, raster.shape[0] - 1), np.clip(column, 0, raster.shape[1] - 1)]
    hidden = np.linalg.norm(toward, axis=1) > before + _HIDDEN_MM
    return inside & facing & ~hidden


# Two shifts, offset and gain.
_UNKNOWNS = 4
_LEAST_PIXELS = 12 * _UNKNOWNS
_LEAST_CONTRAST = 12.0
"""Standard deviation of the synthetic grey values round a target, below which there is nothing to match."""
_MOST_STEPS = 30
_SETTLED_PX = 1e-4
_STILL_PX = 0.01
_SINGULAR = 1e-9
_LEAST_GAIN = 0.1
_FARTHEST_PX = 6.0
_LEAST_TARGETS = 4


class Agreement(NamedTuple):
    """Comparison of a synthetic view with the picture, over the filled pixels of the synthetic view.

    Attributes:
        pixels: number of pixels compared.
        rms_grey: root mean square of picture minus synthetic view in grey values, without any fit.
        correlation: correlation of the two, −1 to 1.
        places: (K, 2) row and column of the matched targets in the target grid.
        shift_px: (K, 2) shifts in x and y, frame pixels; σ from each target's own residuals.
        mean_px: (2,) weighted mean of the shifts; its σ includes their scatter.
    """

    pixels: int
    rms_grey: float
    correlation: float
    places: Indices
    shift_px: Estimate
    mean_px: Estimate


def agreement(surface: Surface, synthetic: SyntheticView, field: Field) -> Agreement:
    """The fit of a synthetic view to the camera's field.

    Only the field's own lines are compared, not interpolated ones.

    Args:
        surface: surface from which the view was made.
        synthetic: synthetic view, whose raster has to lie within the field.
        field: the camera's field of the same time.

    Raises:
        AnalysisError: fewer than four targets are seen well enough in both.
    """
    matching = _Matching.of(surface, synthetic, field)
    picture = field.luma[matching.row, matching.column].astype(float)
    shift, sigma, found = matching.solve(field)
    if found.sum() < _LEAST_TARGETS:
        raise AnalysisError(
            f"{int(found.sum())} targets of the synthetic view could be matched with the picture",
            "look at both pictures: does the surface belong to this field, and is it lit and in focus?",
        )
    shifts = Estimate(shift[found], sigma[found])
    return Agreement(
        pixels=len(picture),
        rms_grey=float(np.sqrt(np.mean((picture - matching.grey) ** 2))),
        correlation=float(np.corrcoef(picture, matching.grey)[0, 1]),
        places=np.column_stack(np.divmod(np.flatnonzero(found), surface.domain.columns)),
        shift_px=shifts,
        mean_px=_mean(shifts),
    )


class _Matching(NamedTuple):
    """M pixels of the synthetic view that lie on lines of the field, each with the target it belongs to.

    The slopes are the synthetic view's, which is never interpolated here: with those of the picture, whose
    noise is less between pixels than on them, matches would be drawn to half pixels.
    """

    column: Indices
    row: Indices
    grey: Array
    slope: Array
    label: Indices
    labels: int

    @classmethod
    def of(cls, surface: Surface, synthetic: SyntheticView, field: Field) -> "_Matching":
        domain, raster = surface.domain, synthetic.raster
        pixels = raster.pixels().astype(np.intp)
        slope = _slopes(synthetic)
        delivered = (field.parity == PROGRESSIVE) | (pixels[:, 1] % 2 == field.parity)
        own = np.isfinite(slope).all(axis=1) & delivered
        column, row = pixels[own, 0], (pixels[own, 1] - field.y0) // field.y_step
        u = np.round((synthetic.hits.u_mm[own] - domain.u_mm) / domain.u_pitch_mm)
        v = np.round((synthetic.hits.v_mm[own] - domain.v_mm) / domain.v_pitch_mm)
        u, v = np.clip(u, 0, domain.rows - 1), np.clip(v, 0, domain.columns - 1)
        label = (u * domain.columns + v).astype(np.intp)
        grey = synthetic.grey.ravel()[own]
        return cls(column, row, grey, slope[own], label, domain.rows * domain.columns)

    def solve(self, field: Field) -> tuple[Array, Array, Mask]:
        """(labels, 2) shifts in frame pixels and their σ, and which were found."""
        spline, shift, enough = _spline(field), np.zeros((self.labels, 2)), self._contrasty()
        design = np.stack([-self.slope[:, 0], -self.slope[:, 1], np.ones_like(self.grey), self.grey])
        inverse = self._inverse(design)
        for _ in range(_MOST_STEPS):
            step, sigma = self._step(design, inverse, spline, shift, field.y_step)
            step[~enough] = 0.0
            # Grey values are linear in the shift only over about a pixel.
            shift += np.clip(step, -1.0, 1.0)
            if np.abs(step).max(initial=0.0) < _SETTLED_PX:
                break
        near = (np.abs(shift) < _FARTHEST_PX) & (np.abs(step) < _STILL_PX) & np.isfinite(sigma)
        return shift, sigma, enough & near.all(axis=1)

    def _contrasty(self) -> Mask:
        count = np.bincount(self.label, minlength=self.labels)
        mean, square = (self._sum(values) / np.maximum(count, 1) for values in (self.grey, self.grey**2))
        return (count >= _LEAST_PIXELS) & (square - mean**2 > _LEAST_CONTRAST**2)

    def _sum(self, values: Array) -> Array:
        return np.bincount(self.label, values, minlength=self.labels).astype(float)

    def _inverse(self, design: Array) -> Array:
        """(labels, 4, 4) inverse normal matrices; NaN where a target's pixels determine no shift."""
        normal = np.moveaxis(np.array([[self._sum(a * b) for a in design] for b in design]), 2, 0)
        scale = np.sqrt(np.maximum(np.einsum("nii->ni", normal), 1e-30))
        scale = scale[:, :, np.newaxis] * scale[:, np.newaxis]
        regular = np.linalg.eigvalsh(normal / scale)[:, 0] > _SINGULAR
        inverse = np.full_like(normal, np.nan)
        inverse[regular] = np.linalg.inv((normal / scale)[regular]) / scale[regular]
        return inverse

    def _step(
        self, design: Array, inverse: Array, spline: Array, shift: Array, y_step: int
    ) -> tuple[Array, Array]:
        """(labels, 2) the next step of all targets at once, and the shifts' σ; NaN without contrast."""
        x, y = self.column + shift[self.label, 0], self.row + shift[self.label, 1] / y_step
        picture = _at(spline, x, y)
        right = np.stack([self._sum(each * picture) for each in design], axis=1)
        solution = np.einsum("nij,nj->ni", inverse, right)
        rest = picture - np.einsum("im,mi->m", design, solution[self.label])
        free = np.maximum(np.bincount(self.label, minlength=self.labels) - _UNKNOWNS, 1)
        # A small or negative gain means that the patterns do not resemble each other: no match.
        gain = np.where(solution[:, 3:] > _LEAST_GAIN, solution[:, 3:], np.nan)
        variance = (self._sum(rest**2) / free)[:, np.newaxis] * np.einsum("nii->ni", inverse)[:, :2]
        return solution[:, :2] / gain, np.sqrt(variance) / gain


def _slopes(synthetic: SyntheticView) -> Array:
    """(lines · columns, 2) by column and by frame line; NaN beside what is empty."""
    slope = np.full((*synthetic.grey.shape, 2), np.nan)
    grey, raster = synthetic.grey, synthetic.raster
    slope[:, 1:-1, 0] = (grey[:, 2:] - grey[:, :-2]) / (2 * raster.columns.step)
    slope[1:-1, :, 1] = (grey[2:] - grey[:-2]) / (2 * raster.lines.step)
    slope[~synthetic.filled] = np.nan
    return slope.reshape(-1, 2)


def _mean(shifts: Estimate) -> Estimate:
    """Weighted mean; its σ grows with the scatter where that is more than the single σ explain."""
    weight = 1.0 / np.maximum(shifts.sigma, 1e-6) ** 2
    mean = (weight * shifts.value).sum(axis=0) / weight.sum(axis=0)
    per_degree = (weight * (shifts.value - mean) ** 2).sum(axis=0) / (len(weight) - 1)
    return Estimate(mean, np.sqrt(np.maximum(per_degree, 1.0) / weight.sum(axis=0)))


def _spline(field: Field) -> Array:
    from scipy.ndimage import spline_filter  # noqa: PLC0415 - heavy

    # Cubic, not linear: linear interpolation blurs the picture, and more at some shifts than at others.
    return spline_filter(field.luma.astype(float), order=3, mode="mirror")


def _at(spline: Array, column: Array, row: Array) -> Array:
    """(M,) grey values between pixels, cubic."""
    from scipy.ndimage import map_coordinates  # noqa: PLC0415 - heavy

    return map_coordinates(spline, [row, column], order=3, mode="mirror", prefilter=False)
