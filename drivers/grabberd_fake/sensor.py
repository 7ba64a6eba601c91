"""Light into the grey values of a field: background, uneven light, noise, gain, gamma, clipping."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.optics import COLUMNS, HALF
from grabberd_fake.options import PictureOptions
from grabberd_fake.render import ROWS, SCALE, Canvas, normal_quantiles

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
