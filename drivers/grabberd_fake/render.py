"""Rendering: ellipses into light, and light into the grey values of a field.

An ellipse is a stack of chords. At the height h sin t over its centre a chord is 2 w cos t wide, so with dy =
h cos t dt the integral over the stack is that of a smooth function of period π, for which a few equidistant t
are exact to rounding. A chord's profile along the line is the difference of two edges, spread and integrated
over the pixel; its weights down the rows are the spread integrated over the lines that a row collects. Both
are looked up in tables. The sensor adds background, uneven light and noise, then applies gain, gamma,
clipping.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.optics import COLUMNS, HALF, LINES, Array, Ellipses
from grabberd_fake.options import PictureOptions

ROWS = LINES // 2
SCALE = 32
"""Canvas units per grey value: 16 bits then hold 1000 grey values, and rounding stays far below the noise."""
LARGEST_PX = 20.0
"""Half the width of the largest disc that is drawn; the padding of the canvas has to hold it."""
# Tables in steps of 1/256 px; a Gaussian beyond four σ is below 1e-4; Lagrange's weights reach two columns.
_PER_PX = 256
_REACH = 4.0
_PAD = 40
_TAPS = 2

Single = NDArray[np.float32]
Canvas = NDArray[np.int16]


class _Windows(NamedTuple):
    """Pieces of the canvas that M ellipses touch: `row`, `column` (M,) of their corners, and their size."""

    row: NDArray[np.intp]
    column: NDArray[np.intp]
    rows: int
    columns: int


class Renderer:
    """Draws ellipses of both halves on a canvas of 288 rows."""

    def __init__(self, picture: PictureOptions) -> None:
        self._picture = picture
        self._lines_a_row = 2.0 if picture.field_integration else 1.0
        self._margin_x = _REACH * picture.spread_x_px + 0.5
        self._margin_y = _REACH * picture.spread_y_px + self._lines_a_row / 2
        self._padded = np.zeros((ROWS + 2 * _PAD, 2 * (HALF + 2 * _PAD)), np.int16)

    def draw(self, halves: tuple[Ellipses, Ellipses], parity: int, shift_px: Array) -> Canvas:
        """(288, 2, 360) int16 in units of 1/32 grey value above the background; valid until the next call.

        Args:
            halves: left and right ellipses, frame pixels; each is clipped to its half.
            parity: parity of the field.
            shift_px: (288,) shift of each row to the right, in both halves: line jitter.
        """
        self._padded[:] = 0
        both = Ellipses.joined(halves)
        half = np.repeat(np.arange(2), [len(ellipses) for ellipses in halves])
        drawable = np.hypot(both.a, both.b).max(axis=1) < LARGEST_PX  # False also for NaN: no image
        self._add(both.select(drawable), half[drawable], parity, _shift_taps(shift_px))
        return self._padded.reshape(-1, 2, HALF + 2 * _PAD)[_PAD:-_PAD, :, _PAD:-_PAD]

    def _add(self, ellipses: Ellipses, half: NDArray[np.intp], parity: int, taps: Single) -> None:
        rows, columns = self._window_size(ellipses)
        near = _near_their_half(ellipses.center, half, rows, columns)
        if not near.any():
            return
        ellipses, half = ellipses.select(near), half[near]
        x = ellipses.center[:, 0] + half * (2 * _PAD) + _PAD
        row = (ellipses.center[:, 1] - parity) / 2 + _PAD
        corner_row, corner_column = np.floor(row) + (1 - rows // 2), np.floor(x) + (1 - columns // 2)
        windows = _Windows(corner_row.astype(np.intp), corner_column.astype(np.intp), rows, columns)
        values = self._values(ellipses, (x - corner_column, (row - corner_row) * 2), windows)
        if taps.any():
            values = _jittered(values, taps[windows.row[:, np.newaxis] + np.arange(rows)])
        _add_windows(self._padded, values, windows)

    def _window_size(self, ellipses: Ellipses) -> tuple[int, int]:
        """Rows and columns that the largest ellipse can touch at any position."""
        wide, high = np.hypot(ellipses.a, ellipses.b).max(axis=0, initial=0.0)
        return 2 * math.ceil((high + self._margin_y) / 2), 2 * math.ceil(wide + self._margin_x + _TAPS)

    def _values(self, ellipses: Ellipses, across: tuple[Array, Array], windows: _Windows) -> Single:
        """(M, rows, columns) grey values; `across`: centres from the windows' corners, y in lines."""
        (ax, ay), (bx, by) = ellipses.a.T, ellipses.b.T
        height2 = ay * ay + by * by
        height, lean = np.sqrt(height2), (ax * ay + bx * by) / height2
        width = np.abs(ax * by - ay * bx) / height
        sine, cosine = _nodes(self._node_count(float(height.max(initial=0.0))))
        up = np.multiply.outer(height, sine)
        middle = across[0][:, np.newaxis] + lean[:, np.newaxis] * up
        reach = np.multiply.outer(width, cosine)
        edges = _edge_table(self._picture.spread_x_px, windows.columns)
        profile = _looked_up(edges, middle - reach) - _looked_up(edges, middle + reach)
        rows = _row_table(self._picture.spread_y_px, self._lines_a_row, windows.rows)
        down = _looked_up(rows, across[1][:, np.newaxis] + up)
        amount = ellipses.weight * height * (self._picture.contrast * SCALE * np.pi / len(sine))
        down *= np.multiply.outer(amount, cosine).astype(np.float32)[:, :, np.newaxis]
        return np.matmul(down.transpose(0, 2, 1), profile)

    def _node_count(self, height: float) -> int:
        return max(8, math.ceil(2.2 * height / min(self._picture.spread_y_px, self._picture.spread_x_px)))


def _near_their_half(center: Array, half: NDArray[np.intp], rows: int, columns: int) -> NDArray[np.bool_]:
    """(N,) True for ellipses whose windows lie on the padded canvas; the others are out of sight."""
    x, row = center[:, 0] - HALF * half, center[:, 1] / 2
    beyond_x, beyond_row = _PAD - columns // 2 - 1, _PAD - rows // 2 - 1
    inside = (x > -beyond_x) & (x < HALF + beyond_x - 1)
    return inside & (row > -beyond_row) & (row < ROWS + beyond_row - 1)


@lru_cache(maxsize=64)
def _nodes(count: int) -> tuple[Array, Array]:
    angle = (np.arange(count) + 0.5) * (np.pi / count) - np.pi / 2
    return np.sin(angle), np.cos(angle)


def _looked_up(table: Single, place: Array) -> Single:
    """(M, Q, columns of the table): its rows for places (M, Q) from the window's corner."""
    return table.take((place * _PER_PX + 0.5).astype(np.intp), axis=0, mode="clip")


@lru_cache(maxsize=64)
def _edge_table(spread: float, columns: int) -> Single:
    """(columns · 256 + 1, columns): light that pixel j collects from right of an edge at i/256 px."""
    edge = np.arange(columns * _PER_PX + 1)[:, np.newaxis] / _PER_PX
    left = np.arange(columns) - 0.5 - edge
    collected = normal_integral((left + 1) / spread) - normal_integral(left / spread)
    return (collected * spread).astype(np.float32)


@lru_cache(maxsize=64)
def _row_table(spread: float, lines_a_row: float, rows: int) -> Single:
    """(2 · rows · 256 + 1, rows): share of light at i/256 frame lines that row k (at 2k) collects."""
    light = np.arange(2 * rows * _PER_PX + 1)[:, np.newaxis] / _PER_PX
    above = 2.0 * np.arange(rows) - lines_a_row / 2 - light
    share = normal_distribution((above + lines_a_row) / spread) - normal_distribution(above / spread)
    return (share / lines_a_row).astype(np.float32)


def _shift_taps(shift_px: Array) -> Single:
    """(padded rows, 5): Lagrange weights of the columns −2 … 2 that shift a row to the right."""
    s = np.zeros(ROWS + 2 * _PAD)
    s[_PAD:-_PAD] = np.clip(-shift_px, -_TAPS, _TAPS)
    if not s.any():
        return np.zeros((len(s), 0), np.float32)
    minus, plus = (s - 1) * s, (s + 1) * s
    outer, inner = (s * s - 1), (s * s - 4)
    weights = [
        s * (s - 2) * outer / 24,
        -minus * inner / 6,
        outer * inner / 4,
        -plus * inner / 6,
        s * (s + 2) * outer / 24,
    ]
    return np.stack(weights, axis=1).astype(np.float32)


def _jittered(values: Single, taps: Single) -> Single:
    """(M, rows, columns) with every row shifted; taps (M, rows, 5). The outer columns are empty."""
    columns = values.shape[2] - 2 * _TAPS
    shifted = np.zeros_like(values)
    inner = shifted[:, :, _TAPS:-_TAPS]
    for k in range(2 * _TAPS + 1):
        inner += taps[:, :, k, np.newaxis] * values[:, :, k : k + columns]
    return shifted


def _add_windows(canvas: Canvas, values: Single, windows: _Windows) -> None:
    # One by one: windows of neighbouring discs overlap, which a single fancy-indexed += would not add up.
    rounded = np.rint(values).astype(np.int16)
    rows, columns = windows.rows, windows.columns
    for window, row, column in zip(rounded, windows.row.tolist(), windows.column.tolist(), strict=True):
        piece = canvas[row : row + rows, column : column + columns]
        piece += window


# The standard library has the normal distribution for single numbers only; tables serve whole arrays.
_END = 6.0
_GRID = np.linspace(-_END, _END, 6145)
_DISTRIBUTION = np.array([0.5 * math.erfc(-z / math.sqrt(2)) for z in _GRID])


def normal_distribution(z: Array) -> Array:
    """Φ(z), to 1e-7."""
    return np.interp(z, _GRID, _DISTRIBUTION)


def normal_integral(z: Array) -> Array:
    """∫ Φ from −∞ to z, to 1e-6: z Φ(z) + φ(z)."""
    return z * normal_distribution(z) + np.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)


@lru_cache(maxsize=1)
def normal_quantiles() -> NDArray[np.float64]:
    """(65536,) the quantiles of (i + ½)/65536: indexed by random 16-bit numbers, normal noise."""
    return np.interp((np.arange(65536) + 0.5) / 65536, _DISTRIBUTION, _GRID)


# Gains in steps of 1/64, so that the cached response tables are reused.
_GAIN_STEPS = 64


class Sensor:
    """The camera's electronics. Fields are independent of each other except with automatic gain."""

    def __init__(self, picture: PictureOptions) -> None:
        self._picture = picture
        self._light = _light(picture.uneven_light)
        amplitude = picture.noise * picture.contrast * SCALE
        noise = np.rint(normal_quantiles() * amplitude)
        self._noise: NDArray[np.int16] = (noise + picture.background * SCALE).astype(np.int16)
        self._drawn = np.empty((ROWS, COLUMNS), np.int16)
        self._gain = 1.0

    def expose(self, canvas: Canvas, rng: np.random.Generator, out: NDArray[np.uint8]) -> None:
        """Writes the field's luma into `out` (288, 720); `canvas` (288, 2, 360) is `Renderer.draw`'s."""
        # 16 random bits per pixel index a table of normal quantiles: faster than drawing normal numbers.
        random = rng.bit_generator.random_raw(ROWS * COLUMNS // 4).view(np.uint16)
        np.take(self._noise, random.reshape(ROWS, COLUMNS), out=self._drawn, mode="clip")
        self._add_light(canvas)
        gain = round(self._gain * _GAIN_STEPS) / _GAIN_STEPS
        np.take(_response(gain, self._picture.gamma), self._drawn.view(np.uint16), out=out, mode="clip")
        self._follow(out)

    def _add_light(self, canvas: Canvas) -> None:
        halves = self._drawn.reshape(ROWS, 2, HALF)
        if self._light is None:
            halves += canvas
            return
        import cv2  # noqa: PLC0415 - 16 MB, for uneven light alone

        background = np.int16(self._picture.background * SCALE)
        even = canvas.reshape(ROWS, COLUMNS) + background
        lit = np.asarray(cv2.multiply(even, self._light, dtype=cv2.CV_16S), np.int16)
        halves += (lit - background).reshape(ROWS, 2, HALF)

    def _follow(self, luma: NDArray[np.uint8]) -> None:
        if self._picture.agc_level is None:
            return
        import cv2  # noqa: PLC0415 - 16 MB, for automatic gain alone

        wanted = self._gain * self._picture.agc_level / max(float(cv2.mean(luma)[0]), 1.0)
        self._gain += (min(max(wanted, 0.25), 4.0) - self._gain) / self._picture.agc_fields


def _light(uneven: float) -> NDArray[np.float32] | None:
    """(288, 720) factors between 1 − uneven and 1 + uneven: brightest at the top left."""
    if uneven == 0:
        return None
    down = np.cos(np.linspace(0, np.pi, ROWS))[:, np.newaxis]
    along = np.cos(np.linspace(0, np.pi, COLUMNS))
    return (1 + uneven / 2 * (down + along)).astype(np.float32)


@lru_cache(maxsize=512)
def _response(gain: float, gamma: float) -> NDArray[np.uint8]:
    """(65536,) grey value of every canvas value, which is indexed as an unsigned 16-bit number."""
    light = np.arange(65536, dtype=np.uint16).view(np.int16).astype(np.float64) / SCALE
    relative = np.maximum(light * gain, 0.0) / 255
    return np.clip(np.rint(255 * relative**gamma), 0, 255).astype(np.uint8)
