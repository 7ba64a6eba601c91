"""Poses of the calibration frame: one rig that sees the same targets several times, moved and turned between.

    X_rig = R_k·X_frame + t_k,  R_k = Rκ·Rφ·Rω;  the first pose defines the coordinates: R = 1, t = 0

A view of the frame in pose k is a view of its own, with the rig's lens and the projection centre and axes
that follow from rig and pose. Six unknowns a pose then stand for the six of each of its views.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.calibration.adjustment.adjustment import Adjustment
from grabberd.core.calibration.adjustment.network import Network, Unknowns
from grabberd.core.geometry import PARAMETERS, View, rotation_angles, rotation_derivatives, rotation_matrix
from grabberd.errors import MeasurementError

POSE_PARAMETERS = ("omega_rad", "phi_rad", "kappa_rad", "x_mm", "y_mm", "z_mm")
_SIX, _ANGLES, _CENTER = len(POSE_PARAMETERS), slice(3, 6), slice(6, 9)


@dataclass(frozen=True, slots=True, eq=False)
class FramePose:
    """Pose of the calibration frame, in the coordinates of its first.

    Attributes:
        values: (6,) ω, φ, κ in rad and x, y, z in mm.
        sigma: (6,) their standard deviations.
        count: Number of image points of all views.
        tau: Root mean square of its standardised residuals: 1 where it agrees with the other poses.
    """

    values: Array
    sigma: Array
    count: int
    tau: float

    @property
    def turn_deg(self) -> float:
        """Angle of the rotation from the first pose."""
        cosine = 0.5 * (np.trace(rotation_matrix(*self.values[:3])) - 1.0)
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


@dataclass(frozen=True, slots=True, eq=False)
class PosedUnknowns(Unknowns):
    """Unknowns of a rig, then six for every pose of the calibration frame but the first.

    Attributes:
        number: (K·V, 18) unknown behind a parameter of each view; −1 also where it follows from several.
        rig: Unknowns of the rig's V views.
    """

    rig: Unknowns

    @classmethod
    def of_rig(cls, rig: Unknowns, poses: int) -> "PosedUnknowns":
        """Make those of a rig and a number of poses."""
        names = [f"pose{pose + 1}.{name}" for pose in range(1, poses) for name in POSE_PARAMETERS]
        later = rig.number.copy()
        later[:, 3:9] = -1
        number = np.concatenate([rig.number, np.tile(later, (poses - 1, 1))])
        return cls((*rig.names, *names), number, rig)

    def values(self, views: Sequence[View]) -> Array:
        """(U,) values: those of the rig, then ω, φ, κ and x, y, z of each pose."""
        rig = views[: len(self.rig.number)]
        poses = [pose_between(rig, one).ravel() for one in _by_pose(views, len(rig))[1:]]
        return np.concatenate([self.rig.values(rig), *poses])

    def with_values(self, views: Sequence[View], values: Array) -> tuple[View, ...]:
        """Copy the views with other values (U,) of the unknowns; all poses see one rig."""
        rig = self.rig.with_values(views[: len(self.rig.number)], values[: len(self.rig)])
        return self._seen(rig, values[len(self.rig) :].reshape(-1, _SIX), views)

    def moved(self, views: Sequence[View], step: Array) -> tuple[View, ...]:
        """Apply a step (U,) of the unknowns to the views."""
        return self.with_values(views, self.values(views) + step)

    def without(self, dropped: Collection[str]) -> "PosedUnknowns":
        """Drop some unknowns of the rig."""
        poses = len(self.number) // len(self.rig.number)
        return PosedUnknowns.of_rig(self.rig.without(dropped), poses)

    def derivatives(self, views: Sequence[View]) -> Array:
        """(18·K·V, U) derivatives of the views' parameters by the unknowns."""
        count = len(self.rig.number)
        rig, blocks = views[:count], self.rig.selection.reshape(count, len(PARAMETERS), -1)
        table = np.zeros((len(views), len(PARAMETERS), len(self)))
        table[:count, :, : len(self.rig)] = blocks
        for pose, seen in enumerate(_by_pose(views, count)[1:], start=1):
            own = slice(len(self.rig) + _SIX * (pose - 1), len(self.rig) + _SIX * pose)
            values = pose_between(rig, seen)
            for index, (one, block) in enumerate(zip(rig, blocks, strict=True)):
                by_rig, by_pose = _derivatives(one, seen[index], values)
                table[pose * count + index, :, : len(self.rig)] = by_rig @ block
                table[pose * count + index, :, own] = by_pose
        return table.reshape(-1, len(self))

    def _seen(self, rig: tuple[View, ...], poses: Array, views: Sequence[View]) -> tuple[View, ...]:
        later = [
            replace(from_pose(one, pose), name=views[len(rig) * number + index].name)
            for number, pose in enumerate(poses, start=1)
            for index, one in enumerate(rig)
        ]
        return (*rig, *later)


def from_pose(view: View, pose: Array) -> View:
    """View of the calibration frame in a pose (6,), in the frame's own coordinates."""
    turn = rotation_matrix(*pose[:3])
    x, y, z = (turn.T @ (view.center_mm - pose[3:])).tolist()
    return replace(view.with_axes(view.axes @ turn), X0_mm=x, Y0_mm=y, Z0_mm=z)


def pose_between(rig: Sequence[View], seen: Sequence[View]) -> Array:
    """(6,) pose from which a rig's views look like others, as nearly as one pose can explain all of them."""
    turns = sum(one.axes.T @ other.axes for one, other in zip(rig, seen, strict=True))
    left, _, right = np.linalg.svd(turns)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    shift = [one.center_mm - turn @ other.center_mm for one, other in zip(rig, seen, strict=True)]
    return np.array([*rotation_angles(turn), *np.mean(shift, axis=0)])


def joined(networks: Sequence[Network]) -> Network:
    """Join networks of one rig and one calibration frame, one for each pose.

    Raises:
        MeasurementError: The views are not those of one rig: their handedness differs.
    """
    first = networks[0]
    views = list(first.views)
    for number, one in enumerate(networks[1:], start=2):
        if [view.handedness for view in one.views] != [view.handedness for view in first.views]:
            raise MeasurementError(
                f"capture {number} shows the calibration frame mirrored otherwise than the first",
                "all captures must be of the same rig",
            )
        pose = pose_between(first.views, one.views)
        views += [replace(from_pose(view, pose), name=f"{view.name} ({number})") for view in first.views]
    count = len(first.views)
    return replace(
        first,
        views=tuple(views),
        view=np.concatenate([one.view + count * pose for pose, one in enumerate(networks)]),
        target=np.concatenate([one.target for one in networks]),
        xy_px=np.concatenate([one.xy_px for one in networks]),
        sigma_px=np.concatenate([one.sigma_px for one in networks]),
        camera=np.tile(np.arange(count), len(networks)),
    )


def of_first_pose(adjusted: Adjustment) -> Adjustment:
    """The rig's share of an adjustment: views, unknowns and image points of the first pose alone.

    σ0, degrees of freedom and sum of squares remain those of all poses.
    """
    if not isinstance(adjusted.unknowns, PosedUnknowns):
        return adjusted
    rig = adjusted.unknowns.rig
    views, size = len(rig.number), len(rig)
    own = adjusted.network.view < views
    network = replace(adjusted.network.select(own), views=adjusted.network.views[:views], camera=None)
    return replace(
        adjusted,
        network=network,
        unknowns=rig,
        views=adjusted.views[:views],
        covariance=adjusted.covariance[:size, :size],
        place_coupling=adjusted.place_coupling[:, :, :size],
        residual_px=adjusted.residual_px[own],
        redundancy=adjusted.redundancy[own],
    )


def frame_poses(adjusted: Adjustment) -> tuple[FramePose, ...]:
    """Poses after the first; none where there is one."""
    unknowns = adjusted.unknowns
    if not isinstance(unknowns, PosedUnknowns):
        return ()
    poses, standardised = [], adjusted.standardised
    values, sigma = adjusted.values[len(unknowns.rig) :], adjusted.sigma[len(unknowns.rig) :]
    for number in range(1, len(adjusted.views) // len(unknowns.rig.number)):
        own = adjusted.network.view // len(unknowns.rig.number) == number
        part = slice(_SIX * (number - 1), _SIX * number)
        tau = float(np.sqrt(np.nanmean(standardised[own] ** 2)))
        poses.append(FramePose(values[part], sigma[part], int(own.sum()), tau))
    return tuple(poses)


def _by_pose(views: Sequence[View], count: int) -> list[Sequence[View]]:
    return [views[first : first + count] for first in range(0, len(views), count)]


def _derivatives(view: View, seen: View, pose: Array) -> tuple[Array, Array]:
    """(18, 18) and (18, 6) derivatives of a seen view's parameters by the rig's view and by the pose."""
    mirror = np.diag([view.handedness, 1.0, 1.0])
    turn, turn_rates = rotation_matrix(*pose[:3]), rotation_derivatives(*pose[:3])
    own = mirror @ view.axes
    to_angles = _to_angles(seen)
    by_rig, by_pose = np.eye(len(PARAMETERS)), np.zeros((len(PARAMETERS), _SIX))
    rates = rotation_derivatives(view.omega_rad, view.phi_rad, view.kappa_rad)
    by_rig[_ANGLES, _ANGLES] = to_angles @ _turning(rates @ turn, own @ turn)
    by_pose[_ANGLES, :3] = to_angles @ _turning(own @ turn_rates, own @ turn)
    by_rig[_CENTER, _CENTER] = turn.T
    by_pose[_CENTER, :3] = (turn_rates.swapaxes(1, 2) @ (view.center_mm - pose[3:])).T
    by_pose[_CENTER, 3:] = -turn.T
    return by_rig, by_pose


def _to_angles(view: View) -> Array:
    """(3, 3) ω, φ, κ by an infinitesimal rotation about the camera's axes."""
    angles = view.omega_rad, view.phi_rad, view.kappa_rad
    rates = _turning(rotation_derivatives(*angles), rotation_matrix(*angles))
    return np.asarray(np.linalg.inv(rates), np.float64)


def _turning(rates: Array, rotation: Array) -> Array:
    """(3, K) rotation vectors of rates (K, 3, 3) of a rotation (3, 3)."""
    skew = rates @ rotation.T
    return np.array([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]])
