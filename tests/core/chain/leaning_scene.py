"""Static fields of leaning discs behind uneven mirrors, drawn without a formula of the program.

OpenCV's camera model projects the rims of the discs. Each view has a mirror of its own brightness, which
falls off across it, and of its own displacements, smooth over the picture. Every field has its own noise and
line jitter.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from tests.core.chain.pinhole_pictures import COLUMNS, FINE, HALF, LINES, WINDOW, Camera, Optics

from grabberd.core.field import Field, NumberedField, quantise

VIEWS = ("left", "right")
RIM = 96
FIELD_NS = 20_000_000
BACKGROUND, CONTRAST, NOISE = 25.0, 180.0, 3.6


@dataclass(frozen=True)
class Mirrors:
    """Both views' mirrors, drawn from a seed.

    Attributes:
        seed: Seed of everything below.
        uneven_px: Root mean square of the displacements, which vary over 100 to 400 px.
        dim: Least brightness of a view, in shares of the brightest; 1 where both are at full brightness.
        optics: The lens and the arrangement before them.
    """

    seed: int
    uneven_px: float = 0.06
    dim: float = 0.55
    optics: Optics = field(default_factory=Optics)

    @property
    def cameras(self):
        """The left and the right virtual camera."""
        return [Camera(name, optics=self.optics) for name in VIEWS]

    @cached_property
    def _waves(self):
        rng = np.random.default_rng((self.seed, 1))
        turn, length = rng.uniform(0, 2 * np.pi, (2, 12)), rng.uniform(100, 400, (2, 12))
        wave = 2 * np.pi / length[..., None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        size = rng.normal(0, 1, (2, 12, 2)) * math.sqrt(2 / 12) * self.uneven_px
        return wave, rng.uniform(0, 2 * np.pi, (2, 12)), size

    def displaced(self, view, xy_px):
        """(N, 2) displacements of image points in a view."""
        wave, phase, size = (each[view] for each in self._waves)
        return np.sin(xy_px @ wave.T + phase) @ size

    def brightness(self, view, xy_px):
        """(N,) brightness of image points in a view, from 0 to 1."""
        if self.dim >= 1.0:
            return np.ones(len(xy_px))
        rng = np.random.default_rng((self.seed, 2, view))
        level, slope = rng.uniform(self.dim + 0.15, 0.85), rng.uniform(-1, 1, 2)
        across = (xy_px - ((view + 0.5) * HALF, LINES / 2)) / (HALF / 2, LINES / 2)
        return np.clip(level + 0.15 * across @ slope / np.abs(slope).sum(), 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs in space: places and unit normals, (N, 3)."""

    xyz_mm: np.ndarray
    normal: np.ndarray
    diameter_mm: float = 1.5

    @classmethod
    def facing(cls, xyz_mm):
        """Make discs that face the cameras, as those of a calibration frame do."""
        return cls(xyz_mm, np.broadcast_to((0.0, 0.0, 1.0), xyz_mm.shape))

    def moved(self, turn, shift_mm):
        """Turn them (3, 3) about the origin and shift them (3,)."""
        return Discs(self.xyz_mm @ turn.T + shift_mm, self.normal @ turn.T, self.diameter_mm)

    @classmethod
    def round_a_liner(cls, xyz_mm, axis, radius_mm):
        """Make discs flat on a round liner along X (axis 0) or Y (axis 1) that passes under them."""
        other = 1 - axis
        across = xyz_mm[:, other] / radius_mm
        normal = np.zeros_like(xyz_mm)
        normal[:, other], normal[:, 2] = across, np.sqrt(1.0 - across**2)
        return cls(xyz_mm, normal)

    @property
    def rims_mm(self):
        """(N, RIM, 3) points round each disc."""
        angle = np.linspace(0, 2 * np.pi, RIM, endpoint=False)
        first = np.cross(self.normal, (0.6, -0.8, 0.0))
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second = np.cross(self.normal, first)
        around = np.cos(angle)[:, None] * first[:, None] + np.sin(angle)[:, None] * second[:, None]
        return self.xyz_mm[:, None] + self.diameter_mm / 2 * around


class LeaningScene:
    """The picture of discs behind mirrors, and where their centres truly appear.

    Attributes:
        discs: The discs.
        picture: (576, 720) brightness.
        true_px: (N, 2 views, 2) frame pixels.
    """

    def __init__(self, discs, mirrors, spread_px=0.75):
        self.discs = discs
        self.true_px = np.empty((len(discs.xyz_mm), 2, 2))
        self.picture = np.zeros((LINES, COLUMNS))
        for view, camera in enumerate(mirrors.cameras):
            half = np.zeros((LINES, COLUMNS))
            rims = camera.project(discs.rims_mm.reshape(-1, 3)).reshape(-1, RIM, 2)
            centre = camera.project(discs.xyz_mm)
            moved = mirrors.displaced(view, centre)
            self.true_px[:, view] = centre + moved
            light = mirrors.brightness(view, centre)
            for rim, shift, bright in zip(rims, moved, light, strict=True):
                _draw(half, rim + shift, bright, spread_px)
            own = slice(camera.first, camera.first + HALF)
            self.picture[:, own] = half[:, own]

    def fields(self, count, seed, bits=8, threshold=50, jitter_px=0.12):
        """Numbered fields of alternate parity, each with its own jitter and noise."""
        rng = np.random.default_rng((seed, 3))
        wave = -2j * np.pi * np.fft.rfftfreq(COLUMNS)
        spectra = [np.fft.rfft(self.picture[parity::2], axis=1) for parity in range(2)]
        for n in range(count):
            shift = rng.normal(0, jitter_px, (LINES // 2, 1))
            light = np.fft.irfft(spectra[n % 2] * np.exp(wave * shift), COLUMNS, axis=1)
            grey = BACKGROUND + CONTRAST * light + rng.normal(0, NOISE, light.shape)
            field = Field.intact(np.clip(np.rint(grey), 0, 255).astype(np.uint8), n % 2)
            yield NumberedField(n, n * FIELD_NS, n, quantise(field, bits, threshold))


def _draw(picture, rim, bright, spread_px):
    """Add the blurred ellipse of a rim; its edge is smoothed over a sixteenth of a pixel."""
    x, y = rim.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    centre = ((rim + np.roll(rim, -1, axis=0)) * cross[:, None]).sum(axis=0) / (3 * cross.sum())
    angle = np.linspace(0, 2 * np.pi, RIM, endpoint=False)
    axes = 2 / RIM * np.stack([np.cos(angle) @ rim, np.sin(angle) @ rim], axis=1)
    corner = np.floor(centre).astype(int) - WINDOW // 2
    if (corner < 0).any() or corner[0] + WINDOW > COLUMNS or corner[1] + WINDOW > LINES:
        return
    at = (np.arange(WINDOW * FINE) + 0.5) / FINE - 0.5
    x, y = (at + corner[0] - centre[0])[np.newaxis], (at + corner[1] - centre[1])[:, np.newaxis]
    inverse = np.linalg.inv(axes)
    u, v = ((row[0] * x + row[1] * y).astype(np.float32) for row in inverse)
    radius = np.sqrt(u * u + v * v)
    along, across = (u * np.float32(one) + v * np.float32(other) for one, other in inverse.T)
    steep = np.sqrt(along * along + across * across) / np.maximum(radius, np.float32(1e-6))
    fine = np.clip(0.5 - (radius - 1.0) / steep * FINE, 0.0, 1.0)
    soft = cv2.GaussianBlur(fine, (0, 0), spread_px * FINE)
    coarse = soft.reshape(WINDOW, FINE, WINDOW, FINE).mean(axis=(1, 3))
    picture[corner[1] : corner[1] + WINDOW, corner[0] : corner[0] + WINDOW] += bright * coarse
