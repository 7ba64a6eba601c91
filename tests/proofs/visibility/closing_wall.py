"""Closing walls with discs on them: sections by quadrature, and what hides what by marching along rays.

A wall is a tube of constant perimeter along X. Its section is z = ± b √(1 − u²) (1 − p (1 − u²)), u = y / a,
turned about X: an ellipse that flattens, and with p a waist. How far it has closed varies along X.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

RADIUS_MM, PITCH_MM, DIAMETER_MM, AXIS_MM, LENGTH_MM = 14.5, 6.5, 1.5, -8.0, 77.35
_STEPS, _KNOTS, _FLATTEST = 61, 801, 12.0
LAWS = {
    "half cosine": lambda part: 0.5 - 0.5 * np.cos(np.pi * part),
    "smoothstep": lambda part: part * part * (3.0 - 2.0 * part),
    "uniform": lambda part: part,
    "snap": lambda part: part * part,
}
"""How far a closure has come after a part of its time."""


@dataclass(frozen=True)
class Closing:
    """A wall that closes and opens: its columns, time and stroke, and which side of it flattens.

    Attributes:
        turned_deg: Angle of the flattened sides: 0 toward the cameras, 90 away from each other.
        waist: Share by which the middle is thinner when closed; 0 is an ellipse.
    """

    columns: int
    seconds: float
    seed: int
    stroke_mm: float = 8.0
    rows: int = 9
    turned_deg: float = 0.0
    waist: float = 0.0
    exposure_ms: float = 1.0

    @cached_property
    def _times(self):
        rng = np.random.default_rng((self.seed, 41))
        start, still = rng.uniform(0.1, 0.2), rng.uniform(0.22, 0.3)
        back = self.seconds * rng.uniform(1.0, 2.0)
        return start, start + self.seconds + still, back, list(LAWS)[self.seed % len(LAWS)]

    def share(self, time_s):
        """How far it has closed, 0 to 1."""
        start, back, opening, law = self._times
        closing = np.clip((time_s - start) / self.seconds, 0.0, 1.0)
        return float(LAWS[law](closing) - LAWS[law](np.clip((time_s - back) / opening, 0.0, 1.0)))

    @cached_property
    def _places(self):
        """(N,) X in mm and arc from the line that faces the cameras, each a little off the grid."""
        rng = np.random.default_rng((self.seed, 42))
        row, column = (each.ravel() for each in np.indices((self.rows, self.columns)))
        off = rng.uniform(-0.1, 0.1, (2, len(row)))
        x = PITCH_MM * (row - (self.rows - 1) / 2) + off[0]
        arc = PITCH_MM * (column - (self.columns - 1) / 2) + off[1]
        return row, column, x, arc

    @property
    def grid(self):
        """(N,) rows and columns."""
        return self._places[:2]

    def discs(self, time_s):
        """(N, 3) centres and unit normals."""
        _, _, x, arc = self._places
        share, step = self.share(time_s), 1e-3
        here, along, around = (
            self._surface(share, x + dx, arc + ds) for dx, ds in ((0, 0), (step, 0), (0, step))
        )
        normal = np.cross(around - here, along - here)
        normal *= np.sign((normal * (here - (0, 0, AXIS_MM)))[:, 1:].sum(axis=1))[:, np.newaxis]
        return here, normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def _depth(self, share, x):
        return self.stroke_mm * share * np.cos(np.pi * np.clip(x / LENGTH_MM, -0.5, 0.5)) ** 2

    def _turn(self):
        angle = np.deg2rad(self.turned_deg)
        return np.cos(angle), np.sin(angle)

    def _surface(self, share, x, arc):
        depth = self._depth(share, x)
        cosine, sine = self._turn()
        y, z = _on_section(depth, arc - np.deg2rad(self.turned_deg) * RADIUS_MM, self._waist)
        return np.stack([x, cosine * y + sine * z, cosine * z - sine * y + AXIS_MM], axis=1)

    @property
    def _waist(self):
        return self.waist / self.stroke_mm

    def hidden(self, time_s, places, center):
        """True for places (…, 3) that the wall hides from a centre."""
        share, (cosine, sine) = self.share(time_s), self._turn()
        away = center - places
        away /= np.linalg.norm(away, axis=-1, keepdims=True)
        steps = np.concatenate([np.linspace(0.1, 4.0, 20), np.linspace(4.5, 45.0, 55)])
        along = places[..., np.newaxis, :] + steps[:, np.newaxis] * away[..., np.newaxis, :]
        x, y, z = np.moveaxis(along, -1, 0)
        z = z - AXIS_MM
        return _inside(self._depth(share, x), cosine * y - sine * z, cosine * z + sine * y, self._waist).any(
            axis=-1
        )


def _height(u2, b, p):
    return b * np.sqrt(np.maximum(1.0 - u2, 0.0)) * (1.0 - p * np.maximum(1.0 - u2, 0.0))


def _section(a, depth, waist):
    """Quarter of a section from the middle of its flat side to its edge: y, z, and the arc to there."""
    angle = np.linspace(0.0, np.pi / 2, _KNOTS)
    y = a * np.sin(angle)
    z = _height(np.sin(angle) ** 2, RADIUS_MM - depth, waist * depth)
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    return y, z, arc


@lru_cache(maxsize=16)
def _family(waist):
    """Half widths over the depth, and tables of y and z over depth and share of the quarter's arc."""
    depths, quarter = np.linspace(0.0, _FLATTEST, _STEPS), np.pi / 2 * RADIUS_MM
    widths, table = [], np.empty((2, _STEPS, _KNOTS))
    for at, depth in enumerate(depths):
        low, high = 0.5 * RADIUS_MM, 1.7 * RADIUS_MM
        for _ in range(30):
            middle = (low + high) / 2
            low, high = (low, middle) if _section(middle, depth, waist)[2][-1] > quarter else (middle, high)
        y, z, arc = _section(low, depth, waist)
        widths.append(low)
        for one, values in zip(table, (y, z), strict=True):
            one[at] = np.interp(np.linspace(0, quarter, _KNOTS), arc, values)
    return depths, np.array(widths), table


def _on_section(depth, arc, waist):
    """(N,) y and z at signed arcs from the middle of the upper flat side."""
    _, _, table = _family(waist)
    half = np.pi * RADIUS_MM
    arc = (arc + half) % (2 * half) - half
    side, beyond = np.sign(arc), np.abs(arc) > half / 2
    along = np.where(beyond, half - np.abs(arc), np.abs(arc)) / (half / 2) * (_KNOTS - 1)
    deep = depth / _FLATTEST * (_STEPS - 1)
    i, k = np.minimum(deep.astype(int), _STEPS - 2), np.minimum(along.astype(int), _KNOTS - 2)
    p, q = deep - i, along - k
    y, z = (
        (1 - p) * ((1 - q) * one[i, k] + q * one[i, k + 1])
        + p * ((1 - q) * one[i + 1, k] + q * one[i + 1, k + 1])
        for one in table
    )
    return side * y, np.where(beyond, -z, z)


def _inside(depth, y, z, waist, skin_mm=0.05):
    depths, widths, _ = _family(waist)
    u2 = (y / np.interp(depth, depths, widths)) ** 2
    return np.abs(z) + skin_mm < _height(u2, RADIUS_MM - depth, waist * depth)
