"""Fields of a closing wall, and how each view truly sees every disc: OpenCV's cameras behind plane mirrors.

A disc is a set of points of light, without those that the wall hides, at several instants of the exposure.
Each is spread by the lens and summed over square pixels in closed form.
"""

from typing import NamedTuple

import cv2
import numpy as np
from scipy.special import ndtr
from tests.core.chain.pinhole_pictures import (
    COLUMNS,
    FOCAL_MM,
    HALF,
    LINES,
    PIXEL_MM,
    PRINCIPAL_PX,
    Camera,
)
from tests.proofs.visibility.closing_wall import DIAMETER_MM, Closing

from grabberd.core.field import Field, NumberedField, quantise
from grabberd.core.geometry import Calibration, View

FIELD_NS = 20_000_000
BACKGROUND, CONTRAST, NOISE, SPREAD_PX, JITTER_PX, LEVEL = 25.0, 180.0, 3.6, 0.75, 0.12, 60
WINDOW = 20
_RINGS, _SPOKES = 8, 24
_INSTANTS, _WEIGHTS = np.polynomial.legendre.leggauss(3)
_FEW = np.append(np.arange((_RINGS - 1) * _SPOKES, _RINGS * _SPOKES, 3), 0)
"""Points that tell whether a disc is seen as a whole, or not at all."""


class Seen(NamedTuple):
    """How a view truly sees N discs in a field; `merged` with another one, above the threshold."""

    image_px: np.ndarray
    tilt_deg: np.ndarray
    uncovered: np.ndarray
    across_px: np.ndarray
    whole: np.ndarray
    merged: np.ndarray


class Eye:
    """A view: the camera of `Camera`, as it sees through a mirror or without one."""

    def __init__(self, name: str, mirrored: bool) -> None:
        self.camera, self.name, self.mirrored = Camera(name, mirrored), name, mirrored

    def spots(self, scene: Closing, time_s: float):
        """(N, K, 2) images of the points of each disc, their brightness (N, K), and the discs (N, 3)."""
        centre, normal = scene.discs(time_s)
        light = _spread_out(centre, normal)
        faces = ((self.camera.center - centre) * normal).sum(axis=1) > 0.0
        raised = light + 0.03 * normal[:, np.newaxis]
        few = np.zeros((len(centre), _FEW.size), bool)
        few[faces] = ~scene.hidden(time_s, raised[faces][:, _FEW], self.camera.center)
        bright = np.repeat(few.all(axis=1, keepdims=True), light.shape[1], axis=1).astype(float)
        part = few.any(axis=1) & ~few.all(axis=1)
        bright[part] = ~scene.hidden(time_s, raised[part], self.camera.center)
        image = self.camera.project(light.reshape(-1, 3)).reshape(*light.shape[:2], 2)
        return image, bright, centre, normal

    def picture(self, scene: Closing, time_s: float, exposure_s: float) -> np.ndarray:
        """(576, 720) brightness of this half, and none in the other."""
        picture = np.zeros((LINES, COLUMNS))
        instants = time_s + exposure_s / 2 * _INSTANTS
        parts = [self.spots(scene, one)[:2] for one in instants]
        image = np.concatenate([one for one, _ in parts], axis=1)
        share = np.concatenate([w / 2 * one for w, (_, one) in zip(_WEIGHTS, parts, strict=True)], axis=1)
        area = _areas(image[:, : _RINGS * _SPOKES]) / (_RINGS * _SPOKES)
        for xy, weight, size in zip(image, share, area, strict=True):
            if weight.any():
                _shine(picture, xy, size * weight)
        first = self.camera.first
        picture[:, :first] = picture[:, first + HALF :] = 0.0
        return picture

    def truth(self, scene: Closing, time_s: float, picture: np.ndarray, parity: int) -> Seen:
        """What is true of this view at an instant."""
        image, bright, centre, normal = self.spots(scene, time_s)
        sight = self.camera.center - centre
        cosine = (sight * normal).sum(axis=1) / np.linalg.norm(sight, axis=1)
        rim = image[:, -_SPOKES:]
        across = np.array([_least_width(one) for one in rim])
        low = (self.camera.first + 4, 6)
        high = (self.camera.first + HALF - 5, LINES - 7)
        middle = self.camera.project(centre)
        whole = ((rim > low) & (rim < high)).all(axis=(1, 2))
        return Seen(
            middle,
            np.rad2deg(np.arccos(cosine)),
            bright.mean(axis=1),
            across,
            whole,
            _merged(picture[parity::2], image, bright, parity),
        )

    @property
    def view(self) -> View:
        """The same camera in the program's parameters."""
        k1, k2, p1, p2, k3 = self.camera.lens.tolist()
        f = FOCAL_MM
        b = 0.0, 0.0, k1 / f**2, k2 / f**4, k3 / f**6, p2 / f, -p1 / f, 0.0, 0.0
        own = View(
            self.name,
            self.camera.first,
            self.camera.first + HALF,
            *PIXEL_MM,
            1,
            f,
            *PRINCIPAL_PX,
            0.0,
            0.0,
            0.0,
            *self.camera.center.tolist(),
            b,
        )
        return own.with_axes(np.diag([1.0, -1.0, -1.0]) @ self.camera.mirror @ self.camera.rotation)


def eyes(mirrored: bool) -> tuple[Eye, Eye]:
    """The left and the right view."""
    return Eye("left", mirrored), Eye("right", mirrored)


def exact_calibration(views: tuple[Eye, Eye]) -> Calibration:
    """What a perfect calibration would know."""
    left, right = (eye.view for eye in views)
    return Calibration(
        "world", "2026-01-01T00:00:00+00:00", "exact", COLUMNS, LINES, left, right, np.zeros((36, 36))
    )


def grey(picture: np.ndarray, n: int, rng: np.random.Generator) -> NumberedField:
    """A field of a picture, with line jitter and noise."""
    wave = -2j * np.pi * np.fft.rfftfreq(COLUMNS)
    shift = rng.normal(0, JITTER_PX, (LINES // 2, 1))
    light = np.fft.irfft(np.fft.rfft(picture[n % 2 :: 2], axis=1) * np.exp(wave * shift), COLUMNS, axis=1)
    luma = BACKGROUND + CONTRAST * light + rng.normal(0, NOISE, light.shape)
    field = Field.intact(np.clip(np.rint(luma), 0, 255).astype(np.uint8), n % 2)
    return NumberedField(n, n * FIELD_NS, n, quantise(field, 8, LEVEL))


def _spread_out(centre, normal):
    """(N, K, 3) points of equal areas; the last ring's are nearest to the rim."""
    first = np.cross(normal, (0.6, -0.8, 0.0))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    radius = DIAMETER_MM / 2 * np.sqrt((np.arange(_RINGS) + 0.5) / _RINGS)
    angle = 2 * np.pi / _SPOKES * np.arange(_SPOKES)
    u, v = (np.outer(radius, one(angle)).ravel() for one in (np.cos, np.sin))
    return (
        centre[:, np.newaxis]
        + u[:, np.newaxis] * first[:, np.newaxis]
        + v[:, np.newaxis] * second[:, np.newaxis]
    )


def _areas(image):
    """(N,) areas of the discs' images: those of the last ring's polygon, for the whole disc and a circle."""
    x, y = np.moveaxis(image[:, -_SPOKES:], -1, 0)
    polygon = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1))
    angle = 2 * np.pi / _SPOKES
    return polygon / ((_RINGS - 0.5) / _RINGS) * angle / np.sin(angle)


def _least_width(rim):
    """Smallest width of an ellipse given by points at equal angles, at the whole disc's radius."""
    angle = 2 * np.pi / len(rim) * np.arange(len(rim))
    axes = 2 / len(rim) * np.stack([np.cos(angle) @ rim, np.sin(angle) @ rim])
    return 2 * np.linalg.svd(axes, compute_uv=False)[1] / np.sqrt((_RINGS - 0.5) / _RINGS)


def _shine(picture, xy, weight):
    kept = weight > 0
    xy, weight = xy[kept], weight[kept]
    corner = np.floor(xy.mean(axis=0)).astype(int) - WINDOW // 2
    if (corner < 0).any() or corner[0] + WINDOW > COLUMNS or corner[1] + WINDOW > LINES:
        return
    edge = np.arange(WINDOW + 1) - 0.5
    x, y = (
        np.diff(ndtr((edge + first - at[:, np.newaxis]) / SPREAD_PX), axis=1)
        for first, at in zip(corner, xy.T, strict=True)
    )
    picture[corner[1] : corner[1] + WINDOW, corner[0] : corner[0] + WINDOW] += y.T @ (
        weight[:, np.newaxis] * x
    )


def _merged(lines, image, bright, parity):
    """(N,) True for discs that share their spot above the threshold with another one."""
    above = (BACKGROUND + CONTRAST * lines > LEVEL).astype(np.uint8)
    _, label = cv2.connectedComponents(above, connectivity=8)
    own = np.zeros(len(image), int)
    for at, (xy, seen) in enumerate(zip(image, bright, strict=True)):
        if seen.any():
            x, y = xy[seen > 0].mean(axis=0)
            row, column = round((y - parity) / 2), round(x)
            if 0 <= row < len(label) and 0 <= column < COLUMNS:
                own[at] = label[row, column]
    return (own > 0) & (np.bincount(own)[own] > 1)
