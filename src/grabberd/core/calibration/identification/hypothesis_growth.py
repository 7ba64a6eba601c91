"""Growth of hypotheses about an identification, from one blob over the whole calibration frame.

Any target may be the one seen at an anchor, with the calibration frame rotated in any way and the view of
either handedness. From there a hypothesis grows: it predicts its nearest targets, takes the blobs nearest to
the predictions, improves its pose, and looks further. No grid is needed: the targets' depths reveal a wrong
hypothesis as it grows. Its pose is a rough camera without distortion, one of many at once.
"""

from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import View, rotation_matrix

_TURN_RAD = 0.15  # prior σ of one damped step, likewise below
_SIDEWAYS_MM = 3.0
_IN_DEPTH_MM = 30.0
_STEP = np.array([_TURN_RAD] * 3 + [_SIDEWAYS_MM] * 2 + [_IN_DEPTH_MM])


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """H cameras; camera coordinates are axes · X + away_mm, negative in z in front of the camera.

    Attributes:
        axes: (H, 3, 3) orthogonal; the determinant is the handedness.
        away_mm: (H, 3) the object's origin in camera coordinates.
    """

    axes: Array
    away_mm: Array

    def __len__(self) -> int:
        return len(self.axes)

    @classmethod
    def anchored(cls, view: View, turns: int, anchors_px: Array, xyz_mm: Array) -> "Poses":
        """Make every pose in which one of T targets is seen at one of A anchors, rotated in the object's
        plane.

        Args:
            view: The nominal view.
            turns: Number of equal steps of a full turn.
            anchors_px: (A, 2) frame pixels.
            xyz_mm: (T, 3) targets.

        Returns:
            A · turns · T poses, the target running fastest.
        """
        upright = view.axes
        angles = 2 * np.pi * np.arange(turns) / turns
        axes = np.array([upright @ rotation_matrix(0.0, 0.0, angle) for angle in angles])
        depth = float((upright @ view.center_mm)[2])
        ray = _rays(view, anchors_px) * depth
        seen = np.einsum("sij,tj->sti", axes, xyz_mm)
        away = ray[:, np.newaxis, np.newaxis] - seen
        shape = away.shape[:3]
        every = np.broadcast_to(axes[np.newaxis, :, np.newaxis], (*shape, 3, 3))
        return cls(every.reshape(-1, 3, 3), away.reshape(-1, 3))

    def select(self, chosen: Indices) -> "Poses":
        """Select some of them."""
        return Poses(self.axes[chosen], self.away_mm[chosen])

    def seen_mm(self, places_mm: Array) -> Array:
        """(H, K, 3) camera coordinates of positions (H, K, 3) or (K, 3)."""
        turned: Array = places_mm @ self.axes.swapaxes(1, 2)
        return turned + self.away_mm[:, np.newaxis]

    def moved(self, step: Array, about_mm: Array) -> "Poses":
        """Rotate by step (H, 6)[:3] about points (H, 3) in camera coordinates, and shift by [3:]."""
        # About the targets' middle, where a rotation hardly shifts them, so the two do not mix in one step.
        turn = _turns(step[:, :3])
        away = np.einsum("hij,hj->hi", turn, self.away_mm - about_mm) + about_mm + step[:, 3:]
        return Poses(turn @ self.axes, away)

    def view(self, nominal: View, index: int) -> View:
        """Convert one of them to a view, with the nominal lens."""
        x, y, z = (-self.axes[index].T @ self.away_mm[index]).tolist()
        return replace(nominal.with_axes(self.axes[index]), X0_mm=x, Y0_mm=y, Z0_mm=z)


def mirrored(view: View, at_px: Array) -> View:
    """Make a view of the other handedness from the same position, its picture mirrored about a column.

    Args:
        view: View without distortion.
        at_px: (2,) frame pixels of a point whose ray stays where it is.
    """
    normal = np.cross(_rays(view, at_px[np.newaxis])[0], (0.0, 1.0, 0.0))
    mirror = np.eye(3) - 2 * np.outer(normal, normal) / (normal @ normal)
    return view.with_axes(mirror @ view.axes)


def pixels(view: View, seen_mm: Array) -> Array:
    """Project camera coordinates (H, K, 3) to frame pixels (H, K, 2); NaN behind the camera."""
    closeness = -1.0 / np.where(seen_mm[..., 2] < 0.0, seen_mm[..., 2], np.nan)
    image: Array = seen_mm[..., :2] * closeness[..., np.newaxis] * _scale(view)
    image += (view.x0_px, view.y0_px)
    return image


def improved(view: View, poses: Poses, places_mm: Array, misfit_px: Array, weight: Array) -> Poses:
    """Improve poses by one damped least-squares step.

    Args:
        view: The nominal view, whose lens they have.
        poses: H poses.
        places_mm: (H, K, 3) targets.
        misfit_px: (H, K, 2) observed minus computed.
        weight: (H, K) in px⁻², 0 where nothing was observed.
    """
    seen = poses.seen_mm(places_mm)
    total = weight.sum(axis=1, keepdims=True) + 1e-12
    about = (seen * weight[:, :, np.newaxis]).sum(axis=1) / total
    root = np.sqrt(weight)
    flat = (_slopes(view, seen, about) * root[:, np.newaxis, np.newaxis]).reshape(len(poses), 6, -1)
    misfit = (misfit_px * root[:, :, np.newaxis]).swapaxes(1, 2).reshape(len(poses), -1, 1)
    normal = flat @ flat.swapaxes(1, 2) * np.outer(_STEP, _STEP) + np.eye(6)
    right = flat @ misfit * _STEP[:, np.newaxis]
    return poses.moved(np.linalg.solve(normal, right)[:, :, 0] * _STEP, about)


def _slopes(view: View, seen: Array, about: Array) -> Array:
    """(H, 6, 2, K) derivatives of the pixels by a rotation about a point and by a shift, camera
    coordinates.
    """
    # The targets lie side by side, for a search computes this of a hundred thousand at once.
    x, y, closeness = seen[..., 0], seen[..., 1], -1.0 / seen[..., 2]
    u, v = x * closeness, y * closeness
    arm_x, arm_y, arm_z = (seen[..., axis] - about[:, axis, np.newaxis] for axis in range(3))
    slopes = np.zeros((len(seen), 6, 2, seen.shape[1]))
    slopes[:, 0, 0], slopes[:, 0, 1] = u * arm_y, v * arm_y - arm_z
    slopes[:, 1, 0], slopes[:, 1, 1] = arm_z - u * arm_x, -v * arm_x
    slopes[:, 2, 0], slopes[:, 2, 1] = -arm_y, arm_x
    slopes[:, 3, 0], slopes[:, 4, 1] = 1.0, 1.0
    slopes[:, 5, 0], slopes[:, 5, 1] = u, v
    slopes *= closeness[:, np.newaxis, np.newaxis] * _scale(view)[:, np.newaxis]
    return slopes


def _scale(view: View) -> Array:
    return view.f_mm / np.array([view.pixel_x_mm, -view.pixel_y_mm])


def _rays(view: View, xy_px: Array) -> Array:
    """(N, 3) camera coordinates at depth 1 in front of the camera."""
    return np.column_stack([(xy_px - (view.x0_px, view.y0_px)) / _scale(view), np.full(len(xy_px), -1.0)])


def _turns(vectors: Array) -> Array:
    """(H, 3, 3) rotations by vectors (H, 3), after Rodrigues."""
    angle = np.linalg.norm(vectors, axis=1)[:, np.newaxis, np.newaxis]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + first * cross + second * (cross @ cross)


TURNS = 12
"""Rotations of the calibration frame that are tried, in equal steps; each converges from ± half a step."""


@dataclass(frozen=True, slots=True)
class Effort:
    """Effort of the search for hypotheses.

    Attributes:
        anchors: Number of blobs to start from.
        turns: Number of rotations tried, in equal steps.
        rounds: For each round: targets predicted, gate as a share of the blobs' spacing, number of the best
            that are kept (0: all).
    """

    anchors: int
    turns: int
    rounds: tuple[tuple[int, float, int], ...]


QUICK = Effort(
    3,
    TURNS,
    (
        (9, 0.42, 0),
        (9, 0.42, 0),
        (9, 0.35, 600),
        (25, 0.35, 0),
        (25, 0.25, 100),
        (60, 0.25, 0),
        (60, 0.2, 40),
    ),
)
THOROUGH = Effort(
    6,
    2 * TURNS,
    (
        *((9, 0.42, 0), (9, 0.42, 0), (9, 0.42, 0), (9, 0.35, 2000)),
        *((25, 0.35, 0), (25, 0.25, 300), (60, 0.25, 0), (60, 0.2, 100)),
    ),
)
_WHOLE = (0.25, 0.2, 0.2)
_CELL_PX = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Half:
    """The blobs of one half of the picture.

    Attributes:
        view: The nominal view.
        lines: Height of the picture.
        xy_px: (B, 2) blobs.
        spacing_px: Median distance of a blob from the nearest other one.
        corner_px: (2,) corner of a raster over the blobs.
        nearest: (I, J) the blob nearest to each raster cell in x, y.
    """

    view: View
    lines: int
    xy_px: Array
    spacing_px: float
    corner_px: Array
    nearest: Indices

    @classmethod
    def of(cls, view: View, lines: int, xy_px: Array) -> "Half":
        """Prepare at least two blobs."""
        spacing = float(np.median(np.sqrt(np.sort(_squares(xy_px, xy_px), axis=1)[:, 1])))
        corner = xy_px.min(axis=0) - spacing
        # A raster finds the nearest blob by one look-up, for thousands of hypotheses at once.
        cells = np.ceil((xy_px.max(axis=0) + spacing - corner) / _CELL_PX).astype(int)
        middles = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in cells), indexing="ij"), axis=-1)
        nearest = _squares(corner + _CELL_PX * middles.reshape(-1, 2), xy_px).argmin(axis=1)
        return cls(view, lines, xy_px, spacing, corner, nearest.reshape(*cells))

    def handed(self, handedness: int) -> "Half":
        """The same blobs with a nominal view of this handedness."""
        if handedness == self.view.handedness:
            return self
        middle = np.array([0.5 * (self.view.first_column + self.view.end_column - 1), self.view.y0_px])
        return replace(self, view=mirrored(self.view, middle))

    def closest(self, predicted_px: Array) -> tuple[Indices, Array]:
        """Find the blob nearest to each prediction (…, 2), and the vector (…, 2) from the prediction to
        it.
        """
        cell = np.nan_to_num((predicted_px - self.corner_px) / _CELL_PX, nan=-1.0)
        index = np.clip(cell, 0, np.array(self.nearest.shape) - 1).astype(np.intp)
        blob = self.nearest[index[..., 0], index[..., 1]]
        return blob, self.xy_px[blob] - predicted_px

    def shows(self, predicted_px: Array) -> Mask:
        """(…) True for predictions inside this half."""
        x, y = predicted_px[..., 0], predicted_px[..., 1]
        across = (x >= self.view.first_column) & (x <= self.view.end_column - 1)
        return across & (y >= 0) & (y <= self.lines - 1)

    def anchors(self, count: int) -> Indices:
        """Choose blobs to start from, central ones first, and away from one another."""
        away = np.sqrt(_squares(self.xy_px, np.median(self.xy_px, axis=0)[np.newaxis])[:, 0])
        order = np.argsort(away, kind="stable")
        apart = np.sqrt(_squares(self.xy_px, self.xy_px))
        chosen: list[int] = []
        for index in order.tolist():
            if len(chosen) < count and (apart[index, chosen] > 1.5 * self.spacing_px).all():
                chosen.append(index)
        return np.array(chosen, np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Growth:
    """H hypotheses with the target that each started from.

    Attributes:
        half: The blobs that they explain.
        poses: Their poses.
        start: (H,) target at their anchor.
        cost: (H,) share of their predictions without a blob, 0 to 1.
    """

    half: Half
    poses: Poses
    start: Indices
    cost: Array

    def best(self, count: int) -> "Growth":
        """Select the best."""
        chosen = np.argsort(self.cost, kind="stable")[:count]
        return Growth(self.half, self.poses.select(chosen), self.start[chosen], self.cost[chosen])

    def views(self, xyz_mm: Array, count: int) -> list[View]:
        """Views of the best that differ by more than a third of the spacing in where they see targets (T,
        3).
        """
        predicted = pixels(self.half.view, self.poses.seen_mm(xyz_mm))
        chosen: list[int] = []
        for index in np.argsort(self.cost, kind="stable").tolist():
            off = np.linalg.norm(predicted[chosen] - predicted[index], axis=2)
            if len(chosen) < count and (np.median(off, axis=1) > self.half.spacing_px / 3).all():
                chosen.append(index)
        return [self.poses.view(self.half.view, index) for index in chosen]


def grow(half: Half, xyz_mm: Array, effort: Effort) -> Growth:
    """Grow hypotheses of the handedness of the half's nominal view, with any target at any anchor."""
    return _grown(half, xyz_mm, half.anchors(effort.anchors), np.arange(len(xyz_mm)), effort)


def regrow(half: Half, xyz_mm: Array, anchor: int, targets: Indices) -> Growth:
    """Grow hypotheses with one of some targets at an anchor, rotated by quarter turns."""
    return _grown(half, xyz_mm, np.array([anchor]), targets, replace(QUICK, turns=4))


def _grown(half: Half, xyz_mm: Array, anchors: Indices, targets: Indices, effort: Effort) -> Growth:
    poses = Poses.anchored(half.view, effort.turns, half.xy_px[anchors], xyz_mm[targets])
    start = np.tile(targets, len(poses) // len(targets))
    growth = Growth(half, poses, start, np.zeros(len(poses)))
    nearby = np.argsort(_squares(xyz_mm, xyz_mm), axis=1, kind="stable")
    for reach, gate, kept in effort.rounds:
        growth = _round(growth, xyz_mm, nearby[:, :reach], gate)
        growth = growth.best(kept) if kept else growth
    for gate in _WHOLE:
        growth = _round(growth, xyz_mm, nearby, gate)
    return growth


def _round(growth: Growth, xyz_mm: Array, nearby: Indices, gate: float) -> Growth:
    """Predict targets (T, K) near the start, match blobs, improve the pose; the cost is that before."""
    half, targets_mm = growth.half, xyz_mm[nearby[growth.start]]
    predicted = pixels(half.view, growth.poses.seen_mm(targets_mm))
    _, misfit = half.closest(predicted)
    square = (misfit * misfit).sum(axis=2) / (gate * half.spacing_px) ** 2
    shown = half.shows(predicted)
    fits = shown & (square < 1.0)
    weight = np.where(fits, (1.0 - np.where(fits, square, 0.0)) ** 2, 0.0)
    misfit = np.where(fits[:, :, np.newaxis], misfit, 0.0)
    poses = improved(half.view, growth.poses, targets_mm, misfit, weight)
    return replace(growth, poses=poses, cost=_cost(square, shown))


def _cost(square: Array, shown: Mask) -> Array:
    """(H,) mean truncated square over targets that should be seen; 1 if most lie outside the half."""
    count = shown.sum(axis=1)
    total = np.where(shown, np.minimum(square, 1.0), 0.0).sum(axis=1)
    return np.where(count >= 0.5 * shown.shape[1], total / np.maximum(count, 1), 1.0)


def _squares(first: Array, second: Array) -> Array:
    """(N, M) squared distances."""
    between = first[:, np.newaxis] - second
    return np.einsum("nmi,nmi->nm", between, between)
