"""Faults of a calibration frame's file: targets out of order, and targets that stand elsewhere.

Identification leaves out a target that is off by half a millimetre or more, the adjustment one that is off by
less; neither says where it really stands, but the image points that are left over do.

Symmetry of a calibration frame: the motions that map it onto itself, and the targets to add against them.

A view of a frame that maps onto itself has several explanations, and no picture can choose between them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import Rig, View
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs, intersect

FALSE_BLOB, MISSING_TARGET = 13.0, 5.0
"""−2 ln of the odds of a blob that is no target, against one where it must be; and of an unseen target."""
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
MOST_EXAMINED = 200
"""Targets up to which a frame's symmetries are looked for: with 400 it takes a quarter of a minute."""


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
        """−2 ln of the likelihood that two views that show the whole frame hold against the motion."""
        return 2 * (FALSE_BLOB + MISSING_TARGET) * (self.of - self.matched)

    def moved(self, xyz_mm: Array, middle_mm: Array) -> Array:
        """Move positions (N, 3) about the frame's middle."""
        return _moved(xyz_mm - middle_mm, self.turned_deg, self.kind == "mirror") + middle_mm + self.shift_mm

    def seen_from(self, view: View, middle_mm: Array) -> View:
        """The view that sees each target where `view` sees the one that is moved onto it.

        Args:
            view: A view that explains the picture.
            middle_mm: (3,) the frame's middle.
        """
        axes = _moved(view.axes, self.turned_deg, self.kind == "mirror")
        x, y, z = self.moved(view.center_mm[np.newaxis], middle_mm)[0].tolist()
        return replace(view.with_axes(axes), X0_mm=x, Y0_mm=y, Z0_mm=z)

    def __str__(self) -> str:
        across = math.hypot(self.shift_mm[0], self.shift_mm[1])
        if self.kind == "shift":
            which = f"its {self.along} are alike: " if self.along else ""
            return f"{which}a shift by {across:.1f} mm maps {self.matched} of {self.of} targets onto targets"
        name = f"a turn by {abs(self.turned_deg):.0f} degrees" if self.kind == "turn" else "its mirror image"
        return f"{name} maps {self.matched} of {self.of} targets onto targets"


@lru_cache(maxsize=2)  # each capture of a frame is identified with them, and the verdict names them
def symmetries(frame: ObjectModel) -> tuple[Symmetry, ...]:
    """Find the motions that map most of a calibration frame onto itself, the most complete first.

    Depths count by what two views see of them; a common change of depth is absorbed by the distance. A frame
    of more than `MOST_EXAMINED` targets is not examined.
    """
    if len(frame) > MOST_EXAMINED:
        return ()
    middle = frame.xyz_mm.mean(axis=0)
    places = frame.xyz_mm - middle
    scaled = cKDTree(places * (1, 1, _DEPTH_SHARE))
    off_mm = min(_OFF_MM, _OFF_SHARE * pitch_mm(frame))
    found: list[Symmetry] = []
    for mirrored in (False, True):
        for turned_deg, shift in _candidates(places, mirrored, off_mm):
            one = _symmetry(frame, places, scaled, (turned_deg, shift, mirrored), off_mm)
            if one is not None and not any(_same(one, other) for other in found):
                found.append(one)
    return tuple(sorted(found, key=lambda one: -one.matched))


def undecided(frame: ObjectModel, margin: float) -> tuple[Symmetry, ...]:
    """Select the symmetries that not even two views of the whole frame tell from the truth.

    Args:
        frame: The calibration frame.
        margin: Least difference of −2 ln(likelihood) that decides.
    """
    return tuple(one for one in symmetries(frame) if one.cost < margin)


_MOST_ADDED = 4


def targets_to_add(frame: ObjectModel, margin: float) -> tuple[Array, ...]:
    """Positions (3,) in mm of further targets that leave no symmetry undecided: as few as that takes.

    Each lies between the present ones, half a spacing from the grid, in the depth of the frame's middle. None
    are needed by a frame that is decided.
    """
    added: list[Array] = []
    while len(added) < _MOST_ADDED and (alike := undecided(frame, margin)):
        added.append(_spot(frame, alike))
        frame = frame.with_target(added[-1])
    return tuple(added)


def _spot(frame: ObjectModel, against: tuple[Symmetry, ...]) -> Array:
    """(3,) position that as many of the motions as possible lead away from any target."""
    middle = frame.xyz_mm.mean(axis=0)
    spacing = pitch_mm(frame)
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


def _along(frame: ObjectModel, origin: Indices, to: Indices) -> str:
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


def pitch_mm(frame: ObjectModel) -> float:
    """Median distance of a target from its nearest neighbour in the plane."""
    places = frame.xyz_mm[:, :2]
    away = np.asarray(cKDTree(places).query(places, k=2)[0])
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
    is said of a frame whose rows and columns follow no such map at all, nor of targets whose row and column
    are next to no other's: they are beside the grid, and tell how the frame stands.
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
    wrong = np.intersect1d(np.flatnonzero(pitches > _MOST_PITCHES), frame.neighbours())
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
_NOWHERE_MM = 1e6
"""Distance of a place where a target cannot be."""
_ASTRAY = 0.9
"""Share of a distance that counts for targets whose row and column put them elsewhere."""
_IN_PLACE_MM = 0.05
"""Shift that is none: its image points were left out for another reason."""


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


class LeftOver(NamedTuple):
    """Image points of one view that may be of targets that stand elsewhere.

    Attributes:
        xy_px: (L, 2) frame pixels.
        target: (L,) index of the target that each was taken for; −1 for none.
    """

    xy_px: Array
    target: Indices


def displaced_targets(
    views: Sequence[View], frame: ObjectModel, missing: Indices, left: LeftOver, right: LeftOver
) -> tuple[DisplacedTarget, ...]:
    """Find where missing targets stand.

    Args:
        views: The calibrated left and right view.
        frame: The calibration frame.
        missing: Indices of the targets that a view does not show where they should be.
        left: Image points of the left view, those of missing targets and those of none.
        right: Likewise of the right view.
    """
    pairs, places = _meeting(views, frame, left, right)
    if not len(missing) or not len(places):
        return ()
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy, and the daemon does without

    shift = places - frame.xyz_mm[missing, np.newaxis]
    # What was taken for a target is that target's or nobody's: rays of neighbours meet, too, far from either.
    taken_for = np.maximum(left.target[pairs[0]], right.target[pairs[1]])
    others = (taken_for >= 0) & (taken_for != missing[:, np.newaxis])
    away_mm = np.where(others, _NOWHERE_MM, np.linalg.norm(shift, axis=2))
    # Of two that the file has at one place, the one that its row and column contradict stands elsewhere.
    away_mm[np.isin(missing, grid_order(frame).astray)] *= _ASTRAY
    found = [
        DisplacedTarget(int(missing[i]), shift[i, j])
        for i, j in zip(*linear_sum_assignment(away_mm), strict=True)
        if away_mm[i, j] < _NOWHERE_MM * _ASTRAY and np.linalg.norm(shift[i, j]) > _IN_PLACE_MM
    ]
    return tuple(sorted(found, key=lambda one: one.target))


def swapped_axes(one: DisplacedTarget, other: DisplacedTarget, frame: ObjectModel) -> str:
    """Axes whose values two targets have swapped in the file, such as "z"; empty if they have not."""
    apart = frame.xyz_mm[other.target] - frame.xyz_mm[one.target]
    opposite = np.abs(one.shift_mm + other.shift_mm) < _SAME_MM
    moved = np.abs(one.shift_mm) >= _SAME_MM
    explained = ~moved | (np.abs(one.shift_mm - apart) < _SAME_MM)
    if not (opposite & explained).all():
        return ""
    # Two axes exchanged are the third, if the ids are exchanged with them: one slip is likelier than three.
    return "".join(np.array(list("xyz"))[~moved if moved.sum() > 1 else moved])


def _meeting(
    views: Sequence[View], frame: ObjectModel, left: LeftOver, right: LeftOver
) -> tuple[tuple[Indices, Indices], Array]:
    """Pairs of left-over image points whose rays meet among the targets, and the places (N, 3)."""
    taken = left.target[:, np.newaxis], right.target
    first, second = np.nonzero((taken[0] == taken[1]) | (taken[0] < 0) | (taken[1] < 0))
    if not 0 < len(first) <= _MOST_PAIRS:
        return (first[:0], second[:0]), np.empty((0, 3))
    pair = [ViewBlobs(xy_px, np.ones_like(xy_px)) for xy_px in (left.xy_px[first], right.xy_px[second])]
    ids = np.arange(len(first), dtype=np.int32)
    found = intersect(Rig.of_views(views), ids, pair[0], pair[1], ImageNoise(0.0, 1, 1.0))
    low, high = frame.xyz_mm.min(axis=0) - _MARGIN_MM, frame.xyz_mm.max(axis=0) + _MARGIN_MM
    with np.errstate(invalid="ignore"):
        inside = ((found.xyz_mm >= low) & (found.xyz_mm <= high)).all(axis=1)
        kept = inside & (found.residual_px < _MEET_PX)
    return (first[kept], second[kept]), found.xyz_mm[kept]
