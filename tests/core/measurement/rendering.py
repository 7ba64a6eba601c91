"""Pictures of blurred discs at known places, for the tests of location."""

import cv2
import numpy as np

from grabberd.core.field import BOTTOM, TOP, Field, quantise
from grabberd.core.measurement import LocationSettings, measure

FINE = 16
HALF_PX = 12
PITCH_PX = 24


def disc(diameter_px, spread_px, squeeze=1.0):
    """A disc of brightness 1 through a Gaussian spread and a square pixel, sampled FINE times a pixel.

    Tilted, its width is `squeeze` times its height.
    """
    size = 2 * (HALF_PX + 2) * FINE + 1
    y, x = np.mgrid[:size, :size] - size // 2
    picture = (np.hypot(x / squeeze, y) <= diameter_px / 2 * FINE).astype(np.float32)
    picture = cv2.GaussianBlur(picture, (0, 0), spread_px * FINE)
    return cv2.blur(picture, (FINE + 1, FINE + 1))


def grid_of_discs(
    rng,
    *,
    diameter_px=5.0,
    spread_px=0.7,
    background=30,
    contrast=180,
    noise=0.0,
    parity=TOP,
    jitter_px=0.0,
    squeeze=1.0,
    beside=None,
):
    """An intact field of discs, each random within a pixel and a row, and their places in frame pixels.

    Beside each, so many columns and frame lines off, there may be another one, whose place is not among them.

    Line jitter shifts every row by a whole number of 1 / FINE pixels.
    """
    fine = disc(diameter_px, spread_px, squeeze)
    frame_lines, columns = 576, 720
    light = np.zeros((frame_lines // 2, columns))
    shift = np.zeros(frame_lines // 2, int)
    if jitter_px:
        shift = np.rint(rng.normal(0, jitter_px * FINE, len(shift))).astype(int)
    places = []
    for top in range(PITCH_PX, frame_lines - 2 * PITCH_PX, PITCH_PX):
        for left in range(PITCH_PX, columns - 2 * PITCH_PX, PITCH_PX):
            dx, dy = rng.integers((FINE, 2 * FINE))
            lines = fine[2 * FINE - dy :: FINE][parity : 2 * HALF_PX : 2]
            across = FINE - dx + FINE * np.arange(2 * HALF_PX)
            rows = slice(top // 2, top // 2 + HALF_PX)
            moved = np.maximum(across - shift[rows, np.newaxis], 0)
            light[rows, left : left + 2 * HALF_PX] += np.take_along_axis(lines, moved, axis=1)
            places.append((left + HALF_PX + 1 + dx / FINE, top + HALF_PX + dy / FINE))
    if beside:
        light = light + np.roll(light, (beside[1] // 2, beside[0]), axis=(0, 1))
    grey = background + contrast * (light + rng.normal(0, noise, light.shape))
    return Field.intact(np.clip(np.round(grey), 0, 255).astype(np.uint8), parity), np.array(places)


def errors_px(blobs, places):
    """(N, 2): of every place that has a blob within 3 px, the located minus the true one."""
    distance = np.hypot(*(blobs.xy_px[:, None] - places[None]).transpose(2, 0, 1))
    blob = distance.argmin(axis=0)
    near = distance.min(axis=0) < 3
    return blobs.xy_px[blob[near]] - places[near], blob[near]


def small_discs():
    """The field of discs, and their places, that the locators of several bits are tried on."""
    return grid_of_discs(np.random.default_rng(2), diameter_px=5.6, spread_px=0.8, noise=0.02)


def located(scene, method, bits=8, threshold=55, **known):
    """(N, 2) errors and their σ of a scene's discs by a method, without line jitter."""
    field, places = scene
    settings = LocationSettings(method=method, line_jitter_px=0.0, **known)
    blobs = measure(quantise(field, bits, threshold), None, settings)
    error, blob = errors_px(blobs, places)
    return error, blobs.sigma_px[blob]


def rms(error):
    return np.sqrt((error**2).mean(axis=0))


__all__ = ["BOTTOM", "TOP", "disc", "errors_px", "grid_of_discs", "located", "rms", "small_discs"]
