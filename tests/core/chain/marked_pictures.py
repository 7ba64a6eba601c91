"""Marks before cameras that OpenCV turns, drawn by OpenCV, with noise and a shift of each line.

Only the pixels about the marks are drawn. Nothing here shares a formula with the program.
"""

from dataclasses import replace

import cv2
import numpy as np

from core.chain.pinhole_pictures import COLUMNS, FOCAL_MM, HALF, LINES, PIXEL_MM, PRINCIPAL_PX, Camera
from grabberd.core.chain.mark_watch import MarkWatch
from grabberd.core.field import split_frame
from grabberd.core.geometry import Calibration, View
from grabberd.core.measurement.marks import KEY, MarkLocator, MarkReference

PX_RAD = PIXEL_MM[0] / FOCAL_MM
CORNERS = {
    "left": [(30, 40), (330, 536), (330, 40), (30, 536)],
    "right": [(390, 40), (690, 536), (690, 40), (390, 536)],
}
VIEWS = tuple(CORNERS)
FINE, SIZE, SPREAD_PX = 16, 36, 0.75
DIAMETER_MM = 1.6


def calibration():
    """What the program has to know of the views: their columns, their focal length, where their axis lies."""
    left, right = (
        View(name, first, first + HALF, *PIXEL_MM, 1, FOCAL_MM, *PRINCIPAL_PX, 0, 0, 0, 0, 0, 0)
        for name, first in (("left", 0), ("right", HALF))
    )
    nothing = np.zeros((36, 36))
    return Calibration("marked", "2026-01-01T00:00:00+00:00", "", COLUMNS, LINES, left, right, nothing)


def images(name, places, turn_px=(0, 0, 0), keystone=(0, 0)):
    """Images (N, 2) after the camera has been turned by so many pixels' angles, then bent by a keystone."""
    camera = Camera(name)
    rotation = cv2.Rodrigues(np.array(turn_px, float) * PX_RAD)[0] @ camera.rotation
    seen = (places - camera.center) @ rotation.T
    points = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), camera.matrix, camera.lens)[0][:, 0]
    middle = np.array([camera.first + HALF / 2, LINES / 2])
    bent = np.array([[1, 0, 0], [0, 1, 0], [*keystone, 1.0]])
    return cv2.perspectiveTransform((points - middle)[np.newaxis], bent)[0] + middle


def places_of(name, pixels):
    """(N, 3) places on the plane z = 0 whose images these pixels are."""
    camera = Camera(name)
    ideal = cv2.undistortPoints(np.array(pixels, float)[:, np.newaxis], camera.matrix, camera.lens)[:, 0]
    rays = np.column_stack([ideal, np.ones(len(ideal))]) @ camera.rotation
    return camera.center - rays * (camera.center[2] / rays[:, 2])[:, np.newaxis]


class Marks:
    """Some marks in each view, as they stand after movements of the views, which are by view's name.

    Those in `off`, by number, have come off by so many columns and lines.
    """

    def __init__(self, count, movements=None, off=None):
        movements, off = movements or {}, off or {}
        angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        rim = DIAMETER_MM / 2 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(64)])
        self.windows = []
        for name in VIEWS:
            for place in places_of(name, CORNERS[name][:count]):
                outline = images(name, place + rim, **movements.get(name, {}))
                outline += off.get(len(self.windows), (0, 0))
                corner = np.floor(outline.mean(axis=0)).astype(int) - SIZE // 2
                self.windows.append((corner, _shifted_discs(outline - corner)))

    def fields(self, rng, count, noise=0.02, jitter_px=0.12):
        """Fields of both parities by turns."""
        while count > 0:
            jitter = np.rint(np.clip(rng.normal(0, jitter_px * FINE, LINES), -FINE, FINE)).astype(int)
            frame = np.full((LINES, COLUMNS), 25, np.uint8)
            for (x, y), discs in self.windows:
                rows = np.arange(SIZE)
                window = 25 + 180 * discs[jitter[y + rows] + FINE, rows]
                window += rng.normal(0, 180 * noise, window.shape)
                frame[y : y + SIZE, x : x + SIZE] = np.clip(np.rint(window), 0, 255)
            yield from split_frame(frame)[: min(count, 2)]
            count -= 2


def _shifted_discs(outline):
    """(shifts, rows, columns) brightness of a disc for each shift of its lines by fine pixels."""
    fine = np.zeros((SIZE * FINE, (SIZE + 2) * FINE), np.float32)
    points = ((outline + np.array([1.5, 0.5])) * FINE - 0.5) * 16
    cv2.fillPoly(fine, [np.rint(points).astype(np.int32)], 1.0, shift=4)
    soft = cv2.GaussianBlur(fine, (0, 0), SPREAD_PX * FINE).reshape(SIZE, FINE, -1).mean(axis=1)
    shifts = range(FINE, -FINE - 1, -1)
    return np.array(
        [
            soft[:, FINE + s : FINE + s + SIZE * FINE].reshape(SIZE, SIZE, FINE).mean(axis=2)
            if s < FINE
            else soft[:, 2 * FINE :].reshape(SIZE, SIZE, FINE).mean(axis=2)
            for s in shifts
        ]
    )


class Watched:
    """A watch over marks that were learnt while they stood still."""

    def __init__(self, count, seed, learnt=80, **picture):
        self.rng, self._count, self._picture = np.random.default_rng(seed), count, picture
        self._locator = MarkLocator([place for name in VIEWS for place in CORNERS[name][:count]])
        fields = Marks(count).fields(self.rng, learnt, **picture)
        reference = MarkReference.learnt((one.parity, self._locator.locate(one)) for one in fields)
        self.calibration = replace(calibration(), details={KEY: reference.to_document()})
        self.watch = MarkWatch.of(self.calibration)

    def see(self, fields, movements=None, hide=(), off=None):
        """Corrections of so many fields after movements; marks in `hide` are covered, in `off` shifted."""
        corrections = []
        for field in Marks(self._count, movements, off).fields(self.rng, fields, **self._picture):
            marks = self._locator.locate(field)
            marks[list(hide)] = np.nan
            corrections.append(self.watch.see(field.parity, marks))
        return corrections


def left_px(correction, movements):
    """By view: rms over the view of what is left of movements, and its χ² (None if nothing is taken off)."""
    left = {}
    for index, name in enumerate(VIEWS):
        first = Camera(name).first
        pixels = np.stack(np.meshgrid(first + np.linspace(15, 345, 6), np.linspace(20, 556, 8)), axis=2)
        places = places_of(name, pixels.reshape(-1, 2))
        before, now = images(name, places), images(name, places, **movements.get(name, {}))
        movement = correction.movements[index]
        off = now - before - (0 if movement is None else movement.at(now))
        chi = None if movement is None else float(np.mean(np.square(off / movement.sigma_at(now))))
        left[name] = float(np.sqrt(np.mean(np.square(off)))), chi
    return left
