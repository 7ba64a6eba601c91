"""Series of repeated measurements for the tests: white errors, and errors locked to the place."""

import numpy as np

from grabberd.core.reconstruction.points import PointSeries

PX_PER_MM = 4.0


def series_of(xyz_mm, sigma_mm=(0.05, 0.04, 0.12), target=None, first_n=0, calibration_mm=0.02, rate_hz=50):
    """A series of places (F, T, 3), NaN where a target was not seen; fields 20 ms apart by default."""
    xyz = np.array(xyz_mm, float)
    fields, targets = xyz.shape[:2]
    covariance = np.broadcast_to(np.diag(np.square(sigma_mm)), (fields, targets, 3, 3))
    seen = np.isfinite(xyz[..., :1])[..., np.newaxis]
    return PointSeries(
        n=np.arange(first_n, first_n + fields),
        time_s=np.arange(fields) / rate_hz,
        target=np.arange(1, targets + 1, dtype=np.int32) if target is None else np.array(target, np.int32),
        xyz_mm=xyz,
        covariance_mm2=np.where(seen, covariance, np.nan),
        calibration_covariance_mm2=np.where(seen, calibration_mm**2 * np.eye(3), np.nan),
        image_px=np.stack([xyz[..., :2] * PX_PER_MM] * 2, axis=2),
    )


def grid(targets=60, seed=0):
    """(T, 3) places at random phases between the pixels."""
    return np.random.default_rng(seed).uniform((-50, -20, -8), (50, 20, 0), (targets, 3))


def measured(true_mm, rng, white_mm, locked_mm, common=0.2):
    """Places with white noise, and errors that depend on the place between the pixels and on the parity.

    Of the locked variance the share `common` is the same for both parities; the rest has opposite signs.
    """
    phase = 2 * np.pi * true_mm * PX_PER_MM
    sign = np.where(np.arange(len(true_mm)) % 2, -1.0, 1.0)[:, np.newaxis, np.newaxis]
    wave = np.sqrt(2 * common) * np.sin(phase) + sign * np.sqrt(2 * (1 - common)) * np.sin(phase + 1.0)
    return true_mm + rng.normal(size=true_mm.shape) * white_mm + wave * locked_mm
