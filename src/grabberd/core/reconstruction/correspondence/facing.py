"""Targets that a view cannot show, by the grid that they form: turned away, behind the wall, or merged.

The grid's normal at a target is that of the wall, and its rows and columns are the wall: where one folds over
itself in a picture, what lies behind is hidden. A target that a view cannot show is not looked for there: the
nearest blob is a neighbour's.
"""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction.object_model import ObjectModel
from grabberd.core.reconstruction.points import Miss

MOST_OBLIQUE_DEG = 65.0
"""Angle between normal and line of sight up to which a disc is expected to be seen: at a larger one its image
has 42 % of its width, and the grid's normal is not certain enough to tell what is hidden."""
CERTAIN_SIGMA = 2.0
"""Number of standard deviations by which a predicted normal may be wrong: a target that may be turned away
is not expected. A corner that was never seen is predicted from one side, and its normal is ten to twenty
degrees wrong while the wall closes."""
_LEAST_COSINE = math.cos(math.radians(MOST_OBLIQUE_DEG))
TURNED_AWAY_DEG = 84.0
"""Angle beyond which a target is not looked for: its blob would be a pixel wide, and the next is another's.
It lies between the angles at which the outermost columns of common walls rest (80° with six, 93° with seven),
so that noise does not turn their targets to and fro."""
APART_PX = 2.0
"""Least gap between the edges of two discs' images whose blobs do not merge: a low threshold and the lens
widen each by a pixel."""
CROWDED_PX = 4.0
"""Gap up to which a neighbour at the limb, too faint for a blob of its own, draws a narrow image towards it,
by up to .7 px."""
_NARROW_COSINE, _LIMB_COSINE = 0.36, (-0.25, 0.17)
"""Greatest cosine of what is narrow; cosines of what may be too faint for a blob and still be seen, some of
them negative: the normal of a target that is only predicted is ten degrees wrong."""
_TURNED_AWAY_COSINE = math.cos(math.radians(TURNED_AWAY_DEG))
_SHORTEST = 2
"""Targets of a line that cannot fold over itself."""
BEHIND_MM = 1.0
"""Distance by which what is hidden lies farther than what hides it."""


class Facing:
    """The targets of one object, before one rig.

    Attributes:
        slopes: Differences between neighbours: along the rows, and along the columns.
        side: 1.0, or −1.0 where the grid's normals point away from the views.
        lines: Indices of the targets of every row and every column of at least three, in order.
        half_pitch_px: Half the distance of neighbours' images, face on; 0 without neighbours.
    """

    def __init__(self, rig: Rig, model: ObjectModel, radius_px: float = 0.0) -> None:
        self._center_mm = rig.center_mm[:, :, 0]
        self.slopes = wall_slopes(model)
        self.side = 1.0
        toward, _ = self._toward(model.xyz_mm)
        # Of targets all round a wall half face away: those nearest to the views face them.
        away_mm = np.linalg.norm(self._center_mm[:, np.newaxis] - model.xyz_mm, axis=2).sum(axis=0)
        front = np.argsort(away_mm, kind="stable")[: max(len(model) // 4, 1)]
        self.side = -1.0 if np.sign(toward[:, front]).sum() < 0 else 1.0
        self.lines = [*_lines(model.row, model.column), *_lines(model.column, model.row)]
        self._pairs = model.neighbours()
        self._radius_px = radius_px
        apart_mm = np.sort(np.linalg.norm(np.diff(model.xyz_mm[self._pairs], axis=1), axis=(1, 2)))
        middle_mm = float(apart_mm[len(apart_mm) // 2]) if len(apart_mm) else 0.0
        self.half_pitch_px = middle_mm * radius_px / model.target_diameter_mm

    def both(self, xyz_mm: Array, sigma_mm: Array | None = None) -> Mask:
        """(M,) True for targets at these positions (M, 3) that face both views, or may do so.

        Args:
            xyz_mm: Positions.
            sigma_mm: (M,) their standard deviations, by which normals may be turned; None: there are none.
        """
        toward, length = self._toward(xyz_mm)
        least = _LEAST_COSINE if sigma_mm is None else self._least_cosine(xyz_mm, sigma_mm)
        # A row or a column alone has no normal: both are 0, and its targets may face anywhere.
        return np.logical_and.reduce(toward >= least * length, axis=0)

    def unseen(self, xyz_mm: Array, image_px: Array) -> NDArray[np.int64]:
        """(V, M) `Miss` of targets that a view cannot show, or not in their place; `FOUND` of the others.

        Args:
            xyz_mm: (M, 3) positions.
            image_px: (2, V, M) their images; NaN behind a camera.
        """
        toward, length = self._toward(xyz_mm)
        unseen = np.where(toward < _TURNED_AWAY_COSINE * length, int(Miss.TURNED_AWAY), int(Miss.FOUND))
        cosine = np.divide(toward, length, out=np.ones_like(toward), where=length > 0.0)
        for view, image in enumerate(image_px.transpose(1, 2, 0)):
            away_mm = np.sqrt(((self._center_mm[view] - xyz_mm) ** 2).sum(axis=1))
            self._hide(unseen[view], toward[view] >= 0.0, image, away_mm)
            self._merge(unseen[view], image, cosine[view])
        return unseen

    def _hide(self, unseen: NDArray[np.int64], faces: Mask, image_px: Array, away_mm: Array) -> None:
        """Mark targets behind a line of the grid that folds over itself."""
        for line in self.lines:
            facing = np.flatnonzero(faces[line])
            # Only where a line turns away and back again is anything behind it that faces the view.
            if not len(facing) or facing[-1] - facing[0] + 1 == len(facing):
                continue
            begin, end = line[:-1], line[1:]
            for own in line[unseen[line] == Miss.FOUND]:
                along, off = image_px[end] - image_px[begin], image_px[own] - image_px[begin]
                length2 = (along * along).sum(axis=1)
                share = (off * along).sum(axis=1)
                beside = off[:, 0] * along[:, 1] - off[:, 1] * along[:, 0]
                over = (share > 0.0) & (share < length2) & (begin != own) & (end != own)
                over &= beside * beside < self.half_pitch_px**2 * length2
                near_mm = away_mm[begin] * length2 + share * (away_mm[end] - away_mm[begin])
                if (over & (near_mm + BEHIND_MM * length2 < away_mm[own] * length2)).any():
                    unseen[own] = Miss.HIDDEN

    def _merge(self, unseen: NDArray[np.int64], image_px: Array, cosine: Array) -> None:
        """Mark neighbours whose images are too near to one another for two blobs, or for true places."""
        own, other = np.concatenate([self._pairs, self._pairs[:, ::-1]]).T
        off = image_px[own] - image_px[other]
        half_px = self._radius_px * np.maximum(cosine, 0.0)
        gap_px = np.sqrt((off * off).sum(axis=1)) - (half_px[own] + half_px[other])
        is_faint = (cosine[other] < _LIMB_COSINE[1]) & (cosine[other] > _LIMB_COSINE[0])
        is_faint &= unseen[other] != Miss.HIDDEN
        crowded = is_faint & (cosine[own] < _NARROW_COSINE) & (gap_px < CROWDED_PX)
        merged = (unseen[other] == Miss.FOUND) & (gap_px < APART_PX)
        is_shown = unseen[own] == Miss.FOUND
        unseen[own[crowded & is_shown]] = Miss.CROWDED
        unseen[own[merged & is_shown]] = Miss.MERGED

    def _least_cosine(self, xyz_mm: Array, sigma_mm: Array) -> Array:
        """(M,) cosines of the largest angles at which targets face a view for certain."""
        turned2 = sum(slope.turned2(xyz_mm, sigma_mm) for slope in self.slopes)
        largest = np.maximum(math.radians(MOST_OBLIQUE_DEG) - CERTAIN_SIGMA * np.sqrt(turned2), 0.0)
        return np.cos(largest)

    def _toward(self, xyz_mm: Array) -> tuple[Array, Array]:
        """(V, M) products of the normals and the lines of sight, and of the lengths of both."""
        normal = normals(*self.slopes, xyz_mm)
        sight = self._center_mm[:, np.newaxis] - xyz_mm
        length: Array = np.sqrt((normal * normal).sum(axis=1) * (sight * sight).sum(axis=2))
        return self.side * (sight * normal).sum(axis=2), length


def _lines(of: NDArray[np.int32], by: NDArray[np.int32]) -> Iterator[Indices]:
    """Targets of equal number, in the order of another: each row, or each column, of at least three."""
    for number in np.unique(of):
        line = np.flatnonzero(of == number)
        if len(line) > _SHORTEST:
            yield line[np.argsort(by[line], kind="stable")]


class Slope(NamedTuple):
    """Differences between neighbours along the rows, or along the columns, up to a factor.

    The mean of both sides where there are two neighbours; at the edge of the grid, where a curved wall is
    most oblique, a parabola through three targets if there are so many.

    Attributes:
        target: (3, M) indices of three targets.
        weight: (3, M) their weights; 0 for targets without a neighbour.
    """

    target: Indices
    weight: Array

    @classmethod
    def of(cls, model: ObjectModel, rows: int, columns: int) -> "Slope":
        """Make it along a step of rows and columns: (0, 1) along the rows."""
        at = {(int(r), int(c)): i for i, (r, c) in enumerate(zip(model.row, model.column, strict=True))}
        chosen = [_weighted(at, r, c, rows, columns) for r, c in at]
        target = np.array([one for one, _ in chosen], np.intp).T
        weight = np.array([one for _, one in chosen], np.float64).T
        return cls(target, weight)

    def at(self, xyz_mm: Array) -> Array:
        """(M, 3) of targets at these positions."""
        return (xyz_mm[self.target] * self.weight[:, :, np.newaxis]).sum(axis=0)

    def turned2(self, xyz_mm: Array, sigma_mm: Array) -> Array:
        """(M,) variances of the slope's direction in rad²; 0 without a neighbour."""
        square_mm2 = (self.at(xyz_mm) ** 2).sum(axis=1)
        variance_mm2 = ((self.weight * sigma_mm[self.target]) ** 2).sum(axis=0)
        return np.divide(variance_mm2, square_mm2, out=np.zeros_like(square_mm2), where=square_mm2 > 0.0)


_BENT, _MOST_ROUGH = 0.35, 0.1
"""Least bend of a line of the grid that counts (20°), and greatest share of bends that go to and fro, as at a
step in a smooth body."""


def wall_slopes(model: ObjectModel) -> tuple[Slope, Slope]:
    """Slopes along the rows and across them, of weight 0 where the discs do not lie in the grid's surface.

    They do on a wall, however it curves; not where the file states their normal, and not on a stepped frame,
    whose lines bend to and fro.
    """
    along, across = Slope.of(model, 0, 1), Slope.of(model, 1, 0)
    if model.normal is None and _is_wall(model):
        return along, across
    return along._replace(weight=0.0 * along.weight), across._replace(weight=0.0 * across.weight)


def _is_wall(model: ObjectModel) -> bool:
    at = {(int(r), int(c)): i for i, (r, c) in enumerate(zip(model.row, model.column, strict=True))}
    four = [
        [at.get((r + k * down, c + k * right), -1) for k in range(4)]
        for r, c in at
        for down, right in ((0, 1), (1, 0))
    ]
    whole = np.array([line for line in four if min(line) >= 0], np.intp).reshape(-1, 4)
    steps = np.diff(model.xyz_mm[whole], axis=1)
    bends = np.diff(steps / np.linalg.norm(steps, axis=2, keepdims=True), axis=1)
    counts = (np.linalg.norm(bends, axis=2) > _BENT).all(axis=1)
    to_and_fro = counts & ((bends[:, 0] * bends[:, 1]).sum(axis=1) < 0.0)
    return bool(to_and_fro.sum() <= _MOST_ROUGH * len(whole))


def normals(along: Slope, across: Slope, xyz_mm: Array) -> Array:
    """(M, 3) normals of the grid at positions (M, 3), of any length and either sign; 0 without neighbours."""
    first, second = along.at(xyz_mm), across.at(xyz_mm)
    # np.cross is several times slower.
    return first[:, [1, 2, 0]] * second[:, [2, 0, 1]] - first[:, [2, 0, 1]] * second[:, [1, 2, 0]]


def _weighted(
    at: Mapping[tuple[int, int], int], r: int, c: int, rows: int, columns: int
) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Three targets, and their weights in the slope of the one at this row and column."""
    own = at[r, c]
    before, after = (at.get((r + k * rows, c + k * columns)) for k in (-1, 1))
    if before is not None and after is not None:
        return (before, own, after), (-1.0, 0.0, 1.0)
    side = 1 if after is not None else -1
    beside, next_one = (at.get((r + k * side * rows, c + k * side * columns)) for k in (1, 2))
    if beside is None:
        return (own, own, own), (0.0, 0.0, 0.0)
    if next_one is None:
        return (own, beside, own), (-2.0 * side, 2.0 * side, 0.0)
    return (own, beside, next_one), (-3.0 * side, 4.0 * side, -1.0 * side)
