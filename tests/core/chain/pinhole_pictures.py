"""Pictures that no code of this program made: OpenCV's camera model, polygons drawn and blurred."""

import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

COLUMNS, LINES, HALF = 720, 576, 360
FOCAL_MM, PIXEL_MM = 7.7, (0.0086, 0.0083)
BASE_MM, DISTANCE_MM = 122.0, 251.0
LENS = (-0.03, 0.05, 4e-4, -3e-4, 0.0), (-0.02, 0.02, -3e-4, 5e-4, 0.0)
PRINCIPAL_PX = (352.0, 291.0)
FINE = 16
WINDOW = 24


@dataclass(frozen=True)
class Optics:
    """Lens, principal point and arrangement of a rig; one reflection a view makes its camera left-handed."""

    focal_mm: float = FOCAL_MM
    base_mm: float = BASE_MM
    distance_mm: float = DISTANCE_MM
    principal_px: tuple[float, float] = PRINCIPAL_PX
    lens: tuple[tuple[float, ...], tuple[float, ...]] = LENS
    mirrored: bool = False

    @classmethod
    def drawn(cls, seed: int) -> "Optics":
        """Draw a rig like none before; even seeds have one reflection a view, odd ones two."""
        rng = np.random.default_rng((seed, 7))
        lens = np.array(LENS) * rng.uniform(-1.5, 1.5, (2, 5))
        return cls(
            FOCAL_MM * rng.uniform(0.95, 1.05),
            BASE_MM * rng.uniform(0.93, 1.07),
            DISTANCE_MM * rng.uniform(0.95, 1.05),
            (PRINCIPAL_PX[0] + rng.uniform(-12, 12), PRINCIPAL_PX[1] + rng.uniform(-12, 12)),
            (tuple(lens[0]), tuple(lens[1])),
            seed % 2 == 0,
        )


class Camera:
    """A virtual camera; its middle ray meets the object's origin near the middle of its half."""

    def __init__(self, name: str, mirrored: bool = False, optics: Optics | None = None) -> None:
        optics = optics or Optics(mirrored=mirrored)
        side = -1 if name == "left" else 1
        self.first = 0 if name == "left" else HALF
        middle_px = self.first + HALF / 2 - optics.principal_px[0]
        aside = math.atan(middle_px * PIXEL_MM[0] / optics.focal_mm)
        outward_mm = side * optics.base_mm / 2
        turn = math.atan2(-outward_mm, optics.distance_mm) - (-aside if optics.mirrored else aside)
        right = np.array([0.0, math.cos(turn), math.sin(turn)])
        forward = np.array([0.0, math.sin(turn), -math.cos(turn)])
        self.rotation = np.array([right, np.cross(forward, right), forward])
        self.mirror = np.diag([-1.0, 1.0, 1.0]) if optics.mirrored else np.eye(3)
        self.center = np.array([0.3 * side, outward_mm, optics.distance_mm])
        x, y = optics.principal_px
        focal = [optics.focal_mm / PIXEL_MM[0], optics.focal_mm / PIXEL_MM[1]]
        self.matrix = np.array([[focal[0], 0, x], [0, focal[1], y], [0, 0, 1.0]])
        self.lens = np.array(optics.lens[name == "right"])

    def project(self, places: np.ndarray) -> np.ndarray:
        seen = (places - self.center) @ (self.mirror @ self.rotation).T
        points, _ = cv2.projectPoints(seen, np.zeros(3), np.zeros(3), self.matrix, self.lens)
        return points[:, 0]


def still(
    places: np.ndarray, diameter_mm: float, mirrored: bool = False, spread_px: float = 0.75
) -> np.ndarray:
    """(576, 720) brightness from 0 to 1 of discs that face +Z, each in its half."""
    picture = np.zeros((LINES, COLUMNS))
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    circle = diameter_mm / 2 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(64)])
    for name in ("left", "right"):
        camera, half = Camera(name, mirrored), np.zeros((LINES, COLUMNS))
        for place in places:
            _draw(half, camera.project(place + circle), spread_px)
        picture[:, camera.first : camera.first + HALF] = half[:, camera.first : camera.first + HALF]
    return picture


def _draw(picture: np.ndarray, outline: np.ndarray, spread_px: float) -> None:
    corner = np.floor(outline.mean(axis=0)).astype(int) - WINDOW // 2
    if (corner < 0).any() or corner[0] + WINDOW > COLUMNS or corner[1] + WINDOW > LINES:
        return
    fine = np.zeros((WINDOW * FINE, WINDOW * FINE), np.float32)
    points = ((outline - corner + 0.5) * FINE - 0.5) * 16
    cv2.fillPoly(fine, [np.rint(points).astype(np.int32)], 1.0, shift=4)
    soft = cv2.GaussianBlur(fine, (0, 0), spread_px * FINE)
    coarse = soft.reshape(WINDOW, FINE, WINDOW, FINE).mean(axis=(1, 3))
    picture[corner[1] : corner[1] + WINDOW, corner[0] : corner[0] + WINDOW] += coarse


def frames(picture: np.ndarray, count: int, rng: np.random.Generator, jitter_px: float = 0.12):
    """Interlaced pictures with noise of 2 % of the contrast and a shift of each line."""
    spectrum, wave = np.fft.rfft(picture, axis=1), np.fft.rfftfreq(COLUMNS)
    for _ in range(count):
        shift = rng.normal(0, jitter_px, (LINES, 1))
        moved = np.fft.irfft(spectrum * np.exp(-2j * np.pi * wave * shift), COLUMNS, axis=1)
        grey = 25 + 180 * moved + rng.normal(0, 3.6, picture.shape)
        yield np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def write_frames(folder: Path, picture: np.ndarray, count: int, seed: int) -> None:
    folder.mkdir()
    for number, frame in enumerate(frames(picture, count, np.random.default_rng(seed))):
        cv2.imwrite(str(folder / f"frame_{number:04d}.png"), frame)
