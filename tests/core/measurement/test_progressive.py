"""Progressive pictures, drawn by OpenCV's polygons: every line is there, and none shifts."""

import cv2
import numpy as np
import pytest

from grabberd.core.field import PROGRESSIVE, Field, Packing, double_lines, pack
from grabberd.core.measurement import LocationSettings, measure

FINER = 16
"""Steps of a pixel that polygons are drawn in."""
LINES, COLUMNS = 480, 640
PITCH_PX = 22.0


def drawn(seed, diameter_px=5.0, spread_px=0.8, noise=4.0):
    """A picture of discs in a grid that is shaken, and their centres (N, 2)."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(20, COLUMNS - 20, PITCH_PX), np.arange(20, LINES - 20, PITCH_PX))
    places = np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-3, 3, (x.size, 2))
    fine = np.zeros((LINES * FINER, COLUMNS * FINER), np.uint8)
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    edge = diameter_px / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for place in places:
        corners = ((place + edge + 0.5) * FINER - 0.5) * 256
        cv2.fillPoly(fine, [np.round(corners).astype(np.int32)], 255, shift=8)
    light = cv2.resize(fine, (COLUMNS, LINES), interpolation=cv2.INTER_AREA).astype(np.float32)
    light = 20 + cv2.GaussianBlur(light, (0, 0), spread_px) / 255 * 160 + rng.normal(0, noise, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8), places


def errors_of(field, bits, places):
    """Errors (N, 2) of all discs, and the same in units of their sigma."""
    blobs = measure(pack(field, Packing(bits, False, 60)), None, LocationSettings())
    assert len(blobs) == len(places)
    nearest = np.linalg.norm(blobs.xy_px[:, np.newaxis] - places, axis=2).argmin(axis=1)
    error = blobs.xy_px - places[nearest]
    return error, error / blobs.sigma_px


@pytest.mark.parametrize(("bits", "rms_px"), [(1, 0.095), (8, 0.022)])
@pytest.mark.parametrize("diameter_px", [4.2, 5.0, 6.3, 9.0])
def test_targets_are_where_they_were_drawn_as_nearly_as_sigma_says(bits, rms_px, diameter_px):
    found = [
        errors_of(Field.progressive(picture), bits, places)
        for picture, places in (drawn(seed, diameter_px) for seed in range(2))
    ]
    error, share = (np.concatenate(one) for one in zip(*found, strict=True))
    assert np.sqrt((error**2).mean(axis=0)).max() < rms_px
    assert np.abs(error.mean(axis=0)).max() < 0.015
    assert 0.5 < (share**2).mean() < 1.6


@pytest.mark.parametrize("bits", [1, 8])
def test_every_line_counts(bits):
    """As doubled fields, for which half of the lines have been made up, they are located worse."""
    picture, places = drawn(3)
    own = np.sqrt((errors_of(Field.progressive(picture), bits, places)[0] ** 2).mean())
    as_doubled = np.sqrt((errors_of(Field(picture, 0, y0=0, y_step=1), bits, places)[0] ** 2).mean())
    assert own < 0.95 * as_doubled


def test_lines_of_a_progressive_picture_do_not_shift():
    blobs = measure(
        pack(Field.progressive(drawn(4)[0]), Packing(8, False, 60)),
        None,
        LocationSettings(line_jitter_px=0.5),
    )
    assert blobs.line_jitter_px is None
    assert (blobs.common_px == 0).all()


def test_no_line_is_missing_so_none_is_interpolated():
    field = Field.progressive(drawn(5)[0])
    assert double_lines(field) is field
    packed = pack(field, Packing(1, True, 60))
    assert (packed.rows, packed.y_step, packed.parity, packed.is_doubled) == (LINES, 1, PROGRESSIVE, False)
