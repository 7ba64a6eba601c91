"""Symmetries of a calibration frame: turns, mirrors and shifts that map its targets onto themselves.

A view of a symmetric frame has several explanations, and no picture can choose between them.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from grabberd.core.calibration.identification.hypothesis import FALSE_BLOB, MISSING_TARGET
from grabberd.core.reconstruction import ObjectModel

Array = NDArray[np.float64]

Kind = Literal["turn", "mirror", "shift"]

_DEPTH_SHARE = 0.25
"""Displacement across the line of sight for a displacement along it, at the convergence of half the base."""
_OFF_MM = 0.5
"""Displacement in the plane that a rough camera does not tell from none, about two pixels."""
_OFF_SHARE = 0.12
"""The same as a share of the spacing, for a frame of fine pitch."""
_LEAST_SHARE = 0.7
_SAME_MM = 1.0
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
    best: Array = spots[int(np.argmax(np.minimum(apart, clear)))]
    return best


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
    moved: Array = (places * (1, -1 if mirrored else 1, 1)) @ rotation.T
    return moved


def _same(one: Symmetry, other: Symmetry) -> bool:
    turned = abs((one.turned_deg - other.turned_deg + 180) % 360 - 180)
    return (
        one.kind == other.kind
        and turned < 2.0
        and float(np.linalg.norm(one.shift_mm[:2] - other.shift_mm[:2])) < _SAME_MM
    )


def _spacing(xyz_mm: Array) -> float:
    """Median distance of a target from its nearest neighbour in the plane."""
    away = np.asarray(cKDTree(xyz_mm[:, :2]).query(xyz_mm[:, :2], k=2)[0])
    return float(np.median(away[:, 1]))
