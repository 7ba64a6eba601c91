"""The picture before an emulated grabber: each row says which of the camera's fields it belongs to."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

COLUMNS, ROW_BYTES = 720, 1440
_BITS, _SQUARE = 16, 4
STAMPED = _BITS * _SQUARE
"""Columns that hold the number, most significant bit first, white is 1."""
_DARK, _WHITE, _GREY, _DISC = 0x10, 0xEB, 0x80, 0xE0
_DISCS = ((250, 150), (450, 250), (350, 400))
_RADIUS = 14.0
_MOVES, _RESTS = 100, 50
"""Fields for which the discs move, and rest."""
_NOISE_STEP = 7

Rows = NDArray[np.uint8]


class Standard(NamedTuple):
    """What a camera sends.

    Attributes:
        lines: Of a field, or of a progressive picture.
        rate_hz: Fields or pictures per second.
        lines_apart: Lines of the frame from row to row.
    """

    lines: int
    rate_hz: float
    lines_apart: int = 2


PAL, NTSC, WEBCAM = Standard(288, 50.0), Standard(240, 60000 / 1001), Standard(480, 30.0, 1)


class Camera:
    """Draws fields and pictures in YUYV or UYVY: faint noise, moving discs, and the number in every row.

    Args:
        luma_first: True for YUYV.

    Attributes:
        standard: Of its signal.
        is_stamped: False leaves out the numbers, which do not move.
        film: Frames (n, lines, columns) that it sees instead, round and round, the top field older.
    """

    def __init__(self, *, luma_first: bool = True, standard: Standard = PAL) -> None:
        self.standard = standard
        self.is_stamped = True
        self.film: Rows | None = None
        self._luma = 0 if luma_first else 1
        noise = np.full((2 * WEBCAM.lines, ROW_BYTES), _GREY, np.uint8)
        # Noise enough for rows to differ, and from a seed: what is seen can be seen again.
        noise[:, self._luma :: 2] = np.random.default_rng(1).integers(24, 32, noise[:, ::2].shape)
        self._noise: Rows = noise

    def field(self, number: int, first_line: int = 0) -> Rows:
        """(lines, 1440) bytes of a field, given the line of the frame that is its first, or of a picture."""
        lines = self.standard.lines
        if self.film is not None:
            return self._film_field(self.film, number, first_line)
        first = number * _NOISE_STEP % lines
        rows = self._noise[first : first + lines].copy()
        if self.is_stamped:
            rows[:, self._luma : 2 * STAMPED : 2] = _stamp(number)
        swing = 60 * math.sin((number // (_MOVES + _RESTS) * _MOVES + min(number % 150, _MOVES)) / 12)
        for x, y in _DISCS:
            self._draw_disc(rows, first_line, x + swing, y + swing / 2)
        return rows

    def see(self, film: Path) -> None:
        """A film of PAL frames, in luma alone."""
        self.film = np.memmap(film, np.uint8, "r").reshape(-1, 2 * PAL.lines, COLUMNS)

    def _film_field(self, film: Rows, number: int, first_line: int) -> Rows:
        # Where the bottom field is the older one, the film runs a field ahead.
        frame = (number + (number + first_line) % 2) // 2 % len(film)
        rows = np.full((self.standard.lines, ROW_BYTES), _GREY, np.uint8)
        rows[:, self._luma :: 2] = film[frame, first_line::2]
        return rows

    def _draw_disc(self, rows: Rows, first_line: int, x: float, y: float) -> None:
        apart = self.standard.lines_apart
        top, bottom = int(y - _RADIUS) // apart, int(y + _RADIUS) // apart + 1
        for row in range(max(top, 0), min(bottom, len(rows))):
            half = _RADIUS**2 - (apart * row + first_line - y) ** 2
            if half > 0:
                left, right = round(x - math.sqrt(half)), round(x + math.sqrt(half))
                rows[row, 2 * left + self._luma : 2 * right : 2] = _DISC


def _stamp(number: int) -> Rows:
    bits = np.arange(_BITS - 1, -1, -1)
    return np.where(number >> bits & 1, _WHITE, _DARK).astype(np.uint8).repeat(_SQUARE)


def numbers_in(luma: Rows) -> list[int]:
    """The number in each row of a field's luma (rows, columns)."""
    ones = luma[:, 1:STAMPED:_SQUARE] > (_DARK + _WHITE) // 2
    return (ones @ (1 << np.arange(_BITS - 1, -1, -1))).tolist()
