"""Poses: many rough cameras at once, each a hypothesis of how a view sees the calibration frame.

They have no distortion and keep the nominal lens: enough to tell targets apart.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import View, rotation_matrix

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

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
    slopes = _slopes(view, seen, about) * _STEP
    weighted = slopes * np.sqrt(weight)[:, :, np.newaxis, np.newaxis]
    flat = weighted.reshape(len(poses), -1, 6)
    misfit = (misfit_px * np.sqrt(weight)[:, :, np.newaxis]).reshape(len(poses), -1, 1)
    normal = flat.swapaxes(1, 2) @ flat + np.eye(6)
    step = np.linalg.solve(normal, flat.swapaxes(1, 2) @ misfit)[:, :, 0] * _STEP
    return poses.moved(step, about)


def _slopes(view: View, seen: Array, about: Array) -> Array:
    """(H, K, 2, 6) derivatives of the pixels by a rotation about a point and by a shift, camera
    coordinates.
    """
    closeness = -1.0 / seen[..., 2]
    ideal = seen[..., :2] * closeness[..., np.newaxis]
    arm = seen - about[:, np.newaxis]
    moved = np.zeros((*seen.shape, 6))
    moved[..., 0, 1], moved[..., 0, 2] = arm[..., 2], -arm[..., 1]
    moved[..., 1, 0], moved[..., 1, 2] = -arm[..., 2], arm[..., 0]
    moved[..., 2, 0], moved[..., 2, 1] = arm[..., 1], -arm[..., 0]
    moved[..., range(3), range(3, 6)] = 1.0
    sideways = moved[..., :2, :] + ideal[..., np.newaxis] * moved[..., 2:, :]
    return sideways * (closeness[..., np.newaxis] * _scale(view))[..., np.newaxis]


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
    turns: Array = np.eye(3) + first * cross + second * (cross @ cross)
    return turns
