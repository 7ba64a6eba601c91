"""Faults of a calibration frame and its file: symmetry, order, and targets that stand elsewhere.

A view of a symmetric frame has several explanations, and no picture can choose between them. Identification
leaves out a target that is off by half a millimetre or more, the adjustment one that is off by less; neither
says where it really stands, but the image points that are left over do.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from grabberd.core.calibration.identification.hypothesis import FALSE_BLOB, MISSING_TARGET
from grabberd.core.geometry import Rig, View
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect

Array = NDArray[np.float64]

Kind = Literal["turn", "mirror", "shift"]

_DEPTH_SHARE = 0.25
"""Displacement across the line of sight for a displacement along it, at the convergence of half the base."""
_OFF_MM = 0.5
"""Displacement in the plane that a rough camera does not tell from none, about two pixels."""
_OFF_SHARE = 0.12
"""The same as a share of the spacing, for a frame of fine pitch."""
_LEAST_SHARE = 0.7
_SAME_SHIFT_MM = 1.0
_ANCHORS = 3


@dataclass(frozen=True, slots=True, eq=False)
class Symmetry:
    """A motion that maps most targets onto targets.

    Attributes:
        kind: Turn in the plane, mirror image, or shift.
        turned_deg: Its rotation in the plane; of a mirror, after y was reversed.
        shift_mm: (3,) its shift after the rotation, of the frame's middle.
        matched: Number of targets that land on targets; `of`: number of all targets.
        along: "rows" or "columns" for a shift along one of them; empty otherwise.
    """

    kind: Kind
    turned_deg: float
    shift_mm: Array
    matched: int
    of: int
    along: str = ""

    @property
    def cost(self) -> float:
        """−2 ln of the likelihood that a view that shows the whole frame holds against the motion."""
        return (FALSE_BLOB + MISSING_TARGET) * (self.of - self.matched)

    def moved(self, xyz_mm: Array, middle_mm: Array) -> Array:
        """Move positions (N, 3) about the frame's middle."""
        return _moved(xyz_mm - middle_mm, self.turned_deg, self.kind == "mirror") + middle_mm + self.shift_mm

    def __str__(self) -> str:
        across = math.hypot(self.shift_mm[0], self.shift_mm[1])
        if self.kind == "shift":
            which = f"its {self.along} are alike: " if self.along else ""
            return f"{which}a shift by {across:.1f} mm maps {self.matched} of {self.of} targets onto targets"
        name = f"a turn by {abs(self.turned_deg):.0f} degrees" if self.kind == "turn" else "its mirror image"
        return f"{name} maps {self.matched} of {self.of} targets onto targets"


def symmetries(frame: ObjectModel) -> tuple[Symmetry, ...]:
    """Find the motions that map most of a calibration frame onto itself, the most complete first.

    Depths count by what two views see of them; a common change of depth is absorbed by the distance.
    """
    middle = frame.xyz_mm.mean(axis=0)
    places = frame.xyz_mm - middle
    scaled = cKDTree(places * (1, 1, _DEPTH_SHARE))
    off_mm = min(_OFF_MM, _OFF_SHARE * _spacing(places))
    found: list[Symmetry] = []
    for mirrored in (False, True):
        for turned_deg, shift in _candidates(places, mirrored, off_mm):
            one = _symmetry(frame, places, scaled, (turned_deg, shift, mirrored), off_mm)
            if one is not None and not any(_same(one, other) for other in found):
                found.append(one)
    return tuple(sorted(found, key=lambda one: -one.matched))


def undecided(frame: ObjectModel, margin: float, *, handed: bool) -> tuple[Symmetry, ...]:
    """Select the symmetries that not even a view of the whole frame tells from the truth.

    Args:
        frame: The calibration frame.
        margin: Least difference of −2 ln(likelihood) that decides.
        handed: True if the handedness of the views is known, which rules mirrors out.
    """
    return tuple(
        one for one in symmetries(frame) if one.cost < margin and not (handed and one.kind == "mirror")
    )


def target_to_add(frame: ObjectModel, against: tuple[Symmetry, ...]) -> Array:
    """(3,) position in mm of a further target that all of these symmetries lead away from any target.

    It lies between the present ones, half a spacing from the grid, in the depth of the frame's middle.
    """
    middle = frame.xyz_mm.mean(axis=0)
    spacing = _spacing(frame.xyz_mm)
    low, high = frame.xyz_mm[:, :2].min(axis=0), frame.xyz_mm[:, :2].max(axis=0)
    axes = [np.arange(a + spacing / 2, b, spacing / 2) for a, b in zip(low, high, strict=True)]
    spots = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    spots = np.column_stack([spots, np.full(len(spots), middle[2])])
    tree = cKDTree(frame.xyz_mm[:, :2])
    clear = tree.query(spots[:, :2])[0]
    apart = np.full(len(spots), np.inf)
    for one in against:
        there = one.moved(spots, middle)[:, :2]
        own = np.linalg.norm(there - spots[:, :2], axis=1)
        apart = np.minimum(apart, np.minimum(own, tree.query(there)[0]))
    return spots[int(np.argmax(np.minimum(apart, clear)))]


def _candidates(places: Array, mirrored: bool, off_mm: float) -> list[tuple[float, Array]]:
    """Rotations and shifts that carry a central target and its neighbour onto two targets."""
    start = _moved(places, 0.0, mirrored)
    found = []
    for anchor in np.argsort(np.linalg.norm(places[:, :2], axis=1), kind="stable")[:_ANCHORS]:
        away = np.linalg.norm(start[:, :2] - start[anchor, :2], axis=1)
        arm = start[np.argsort(away, kind="stable")[1]] - start[anchor]
        between = places[np.newaxis] - places[:, np.newaxis]
        fits = np.abs(np.hypot(between[..., 0], between[..., 1]) - math.hypot(arm[0], arm[1])) < off_mm
        for first, second in zip(*np.nonzero(fits), strict=True):
            to = between[first, second]
            turned = math.degrees(math.atan2(to[1], to[0]) - math.atan2(arm[1], arm[0]))
            there = _moved(places[anchor][np.newaxis], turned, mirrored)[0]
            found.append((turned, places[first] - there))
    return found


def _symmetry(
    frame: ObjectModel, places: Array, scaled: cKDTree, motion: tuple[float, Array, bool], off_mm: float
) -> Symmetry | None:
    turned_deg, shift, mirrored = motion
    turned_deg = (turned_deg + 180) % 360 - 180
    moved = _moved(places, turned_deg, mirrored) + shift
    off, nearest = map(np.asarray, scaled.query(moved * (1, 1, _DEPTH_SHARE)))
    own = off <= off_mm
    if own.sum() < _LEAST_SHARE * len(places) or (nearest == np.arange(len(places)))[own].all():
        return None
    kind: Kind = "mirror" if mirrored else "turn" if abs(turned_deg) > 1.0 else "shift"
    along = _along(frame, np.flatnonzero(own), nearest[own]) if kind == "shift" else ""
    return Symmetry(kind, turned_deg, shift, int(own.sum()), len(places), along)


def _along(frame: ObjectModel, origin: NDArray[np.intp], to: NDArray[np.intp]) -> str:
    """Name what is alike where targets go from one to another: rows, columns, or neither."""
    same_column = (frame.column[origin] == frame.column[to]).all()
    same_row = (frame.row[origin] == frame.row[to]).all()
    return "rows" if same_column else "columns" if same_row else ""


def _moved(places: Array, turned_deg: float, mirrored: bool) -> Array:
    turn = math.radians(turned_deg)
    cosine, sine = math.cos(turn), math.sin(turn)
    rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return (places * (1, -1 if mirrored else 1, 1)) @ rotation.T


def _same(one: Symmetry, other: Symmetry) -> bool:
    turned = abs((one.turned_deg - other.turned_deg + 180) % 360 - 180)
    return (
        one.kind == other.kind
        and turned < 2.0
        and float(np.linalg.norm(one.shift_mm[:2] - other.shift_mm[:2])) < _SAME_SHIFT_MM
    )


def _spacing(xyz_mm: Array) -> float:
    """Median distance of a target from its nearest neighbour in the plane."""
    away = np.asarray(cKDTree(xyz_mm[:, :2]).query(xyz_mm[:, :2], k=2)[0])
    return float(np.median(away[:, 1]))


_ROUNDS = 3
_MOST_PITCHES = 0.5


@dataclass(frozen=True, slots=True)
class GridOrder:
    """Targets, by their indices, that stand more than half a pitch from where row and column put them.

    Attributes:
        swapped: Pairs of which each stands where row and column put the other.
        astray: All others.
    """

    swapped: tuple[tuple[int, int], ...] = ()
    astray: tuple[int, ...] = ()


def grid_order(frame: ObjectModel) -> GridOrder:
    """Find the targets that are out of order.

    Positions follow row and column by an affine map that is fitted without those that contradict it. Nothing
    is said of a frame whose rows and columns follow no such map at all.
    """
    terms = np.column_stack([np.ones(len(frame)), frame.row, frame.column]).astype(float)
    places = frame.xyz_mm[:, :2]
    kept = np.ones(len(frame), np.bool_)
    for _ in range(_ROUNDS):
        map_mm, *_ = np.linalg.lstsq(terms[kept], places[kept], rcond=None)
        pitch = min(np.linalg.norm(map_mm[1]), np.linalg.norm(map_mm[2]))
        if pitch < 1e-9:
            return GridOrder()
        expected = terms @ map_mm
        pitches = np.linalg.norm(places - expected, axis=1) / pitch
        kept = pitches <= max(_MOST_PITCHES, float(np.median(pitches)))
    wrong = np.flatnonzero(pitches > _MOST_PITCHES)
    if 2 * len(wrong) >= len(frame):
        return GridOrder()
    between = np.linalg.norm(places[wrong, np.newaxis] - expected[wrong], axis=2) / pitch
    mutual = (between <= _MOST_PITCHES) & (between <= _MOST_PITCHES).T
    pairs = tuple((int(wrong[i]), int(wrong[j])) for i, j in zip(*np.nonzero(np.triu(mutual)), strict=True))
    paired = {one for pair in pairs for one in pair}
    return GridOrder(pairs, tuple(int(one) for one in wrong if one not in paired))


_MEET_PX = 0.5
"""Greatest RMS of the image coordinates of one target's two image points."""
_MARGIN_MM = 10.0
"""Distance from the other targets within which a left-over target may stand."""
_MOST_PAIRS = 2500
_SAME_MM = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class DisplacedTarget:
    """Target that stands elsewhere.

    Attributes:
        target: Index of the target.
        shift_mm: (3,) from its place in the file to where it stands.
    """

    target: int
    shift_mm: Array

    @property
    def distance_mm(self) -> float:
        """Length of the shift."""
        return float(np.linalg.norm(self.shift_mm))


def displaced_targets(
    views: Sequence[View], frame: ObjectModel, missing: NDArray[np.intp], left_px: Array, right_px: Array
) -> tuple[DisplacedTarget, ...]:
    """Find where missing targets stand.

    Args:
        views: The calibrated left and right view.
        frame: The calibration frame.
        missing: Indices of the targets that neither view shows where they should be.
        left_px: (L, 2) image points of the left view that belong to no target.
        right_px: (R, 2) likewise of the right view.
    """
    places = _left_over(views, frame, left_px, right_px)
    if not len(missing) or not len(places):
        return ()
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy, and the daemon does without

    shift = places - frame.xyz_mm[missing, np.newaxis]
    rows, columns = linear_sum_assignment(np.linalg.norm(shift, axis=2))
    return tuple(DisplacedTarget(int(missing[i]), shift[i, j]) for i, j in zip(rows, columns, strict=True))


def swapped_axes(one: DisplacedTarget, other: DisplacedTarget, frame: ObjectModel) -> str:
    """Axes whose values two targets have swapped in the file, such as "z"; empty if they have not."""
    apart = frame.xyz_mm[other.target] - frame.xyz_mm[one.target]
    opposite = np.abs(one.shift_mm + other.shift_mm) < _SAME_MM
    moved = np.abs(one.shift_mm) >= _SAME_MM
    explained = ~moved | (np.abs(one.shift_mm - apart) < _SAME_MM)
    return "".join(np.array(list("xyz"))[moved]) if (opposite & explained).all() else ""


def _left_over(views: Sequence[View], frame: ObjectModel, left_px: Array, right_px: Array) -> Array:
    """(N, 3) places among the targets where the rays of two left-over image points meet."""
    first, second = (one.ravel() for one in np.indices((len(left_px), len(right_px))))
    if not 0 < len(first) <= _MOST_PAIRS:
        return np.empty((0, 3))
    left, right = (ViewBlobs(xy_px, np.ones_like(xy_px)) for xy_px in (left_px[first], right_px[second]))
    ids = np.arange(len(first), dtype=np.int32)
    found = intersect(Rig.of_views(views), ids, left, right, ImageNoise(0.0, 1, 1.0))
    low, high = frame.xyz_mm.min(axis=0) - _MARGIN_MM, frame.xyz_mm.max(axis=0) + _MARGIN_MM
    with np.errstate(invalid="ignore"):
        inside = ((found.xyz_mm >= low) & (found.xyz_mm <= high)).all(axis=1)
        places: Array = found.xyz_mm[inside & (found.residual_px < _MEET_PX)]
    return places
