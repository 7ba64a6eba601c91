"""What both views show of a calibration frame before a rig, which is never quite as it was built."""

from dataclasses import dataclass, replace

import numpy as np

from core.shipped_models import PAPER, shipped_model
from grabberd.core.geometry import NominalRig, View, project, rotation_angles, rotation_matrix
from grabberd.errors import InputError

NOMINAL = NominalRig(720, 576, (0, 360), (360, 720), 240.0, 128.0, 30.0, 8.0, 0.0086, 0.0083)
LENS_SPREAD = np.array([0.005, 0.005, 1.5e-3, 4e-5, 5e-7, 5e-4, 5e-4, 5e-4, 5e-4])
FRAME = shipped_model(PAPER)


@dataclass(frozen=True)
class Sight:
    """Blobs (B, 2) of one view, and which target (index) each is; −1 for a false one."""

    xy_px: np.ndarray
    target: np.ndarray

    def within(self, first_line, last_line):
        """What lies between two lines."""
        kept = (self.xy_px[:, 1] > first_line) & (self.xy_px[:, 1] < last_line)
        return Sight(self.xy_px[kept], self.target[kept])

    def first(self, count):
        return Sight(self.xy_px[:count], self.target[:count])


def roughly(rng, nominal=NOMINAL, share=0.1) -> NominalRig:
    """A rig whose numbers are another's to so great a share."""
    while True:
        base, distance, convergence, focal = 1 + share * rng.uniform(-1, 1, 4)
        rig = replace(
            nominal,
            base_mm=nominal.base_mm * base,
            distance_mm=nominal.distance_mm * distance,
            convergence_deg=nominal.convergence_deg * convergence,
            focal_length_mm=nominal.focal_length_mm * focal,
        )
        try:
            rig.views()
        except InputError:
            continue
        return rig


def placed(rng, handedness=(1, 1), turned_deg=0.0, nominal=NOMINAL) -> tuple[View, View]:
    """The views of a real rig with lens and mirrors, in the coordinates of a frame that stands askew."""
    tilt = np.radians(rng.uniform(-7, 7, 3))
    turn = rotation_matrix(tilt[0], tilt[1], np.radians(turned_deg) + tilt[2])
    shift = rng.uniform(-8, 8, 3)
    left, right = (_distorted(rng, view) for view in roughly(rng, nominal, 0.07).views(handedness))
    return _seen_from(left, turn, shift), _seen_from(right, turn, shift)


def _distorted(rng, view: View) -> View:
    values = view.vector()
    values[1:3] += rng.uniform(-8, 8, 2)
    values[3:6] += rng.uniform(-0.02, 0.02, 3)
    values[9:] += rng.uniform(-1, 1, 9) * LENS_SPREAD
    return view.with_vector(values)


def _seen_from(view: View, turn, shift_mm) -> View:
    values = view.vector()
    values[3:6] = rotation_angles(rotation_matrix(*values[3:6]) @ turn)
    values[6:9] = turn.T @ (view.center_mm - shift_mm)
    return view.with_vector(values)


def see(rng, view: View, frame=FRAME, missing=0.1, false=5, noise_px=0.2) -> Sight:
    """What a view shows, in any order."""
    pixels = project(view, frame.xyz_mm)
    shown = view.holds(pixels) & (pixels[:, 1] > 0) & (pixels[:, 1] < 575)
    here = np.flatnonzero(shown & (rng.random(len(pixels)) >= missing))
    pixels = pixels[here] + rng.normal(size=(len(here), 2)) * noise_px
    stray = rng.uniform(pixels.min(axis=0) - 15, pixels.max(axis=0) + 15, (false, 2))
    stray = stray[view.holds(stray)]
    order = rng.permutation(len(here) + len(stray))
    target = np.concatenate([here, np.full(len(stray), -1)])
    return Sight(np.vstack([pixels, stray])[order], target[order])
