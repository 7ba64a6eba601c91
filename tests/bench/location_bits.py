"""Pointing at 1 bit on discs rendered for the tests: centroid and locale, intact and doubled lines.

Run with `python -m bench.location_bits` from `tests`.
"""

import numpy as np

from grabberd.field import Field, double_lines, quantise
from grabberd.measurement import LocationSettings, ThresholdRule, choose_threshold, measure
from measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs

DIAMETERS_PX = (4.85, 5.0, 5.15)
JITTERS_PX = (0.0, 0.12)
NOISES = (0.02, 0.05, 0.10)
SPREAD_PX = 0.8


def table() -> str:
    """RMS error x / y in frame pixels over random sub-pixel phase; line shifts are not solved for."""
    head = "| lines | line jitter | noise | threshold | centroid | locale | χ² of locale |"
    rows = [
        _row(doubled, jitter_px, noise)
        for doubled in (False, True)
        for jitter_px in JITTERS_PX
        for noise in NOISES
    ]
    return "\n".join([head, "|---|---|---|---|---|---|---|", *rows])


def _row(doubled: bool, jitter_px: float, noise: float) -> str:
    pictures = _pictures(jitter_px, noise)
    rule = ThresholdRule(spread_px=SPREAD_PX, line_jitter_px=jitter_px)
    histogram = np.bincount(pictures[0][0].luma.ravel(), minlength=256)
    threshold = choose_threshold(histogram, rule, 1, 1 if doubled else 2)
    figures = [_located(pictures, doubled, threshold, method, jitter_px) for method in ("centroid", "locale")]
    (centroid, _), (locale, chi2) = figures
    lines = "doubled" if doubled else "288 intact"
    height = (threshold - 30) / 180
    return (
        f"| {lines} | {jitter_px:.2f} px | {noise:.0%} | {height:.0%} | "
        f"{_pair(centroid)} | {_pair(locale)} | {chi2[0]:.2f} / {chi2[1]:.2f} |"
    )


def _pair(rms_px: np.ndarray) -> str:
    return f"{rms_px[0]:.3f} / {rms_px[1]:.3f}"


def _pictures(jitter_px: float, noise: float) -> list[tuple[Field, np.ndarray]]:
    rng = np.random.default_rng(1)
    return [
        grid_of_discs(
            rng, diameter_px=diameter_px, spread_px=SPREAD_PX, noise=noise, parity=parity, jitter_px=jitter_px
        )
        for diameter_px in DIAMETERS_PX
        for parity in (TOP, BOTTOM)
    ]


def _located(
    pictures: list[tuple[Field, np.ndarray]], doubled: bool, threshold: int, method: str, jitter_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """RMS error and mean χ² of x and y."""
    errors, normed = [], []
    settings = LocationSettings(
        method=method, spread_px=SPREAD_PX, line_jitter_px=jitter_px, line_shifts=False
    )
    for field, places in pictures:
        packed = quantise(double_lines(field) if doubled else field, 1, threshold)
        blobs = measure(packed, None, settings)
        error, blob = errors_px(blobs, places)
        variance = blobs.sigma_px[blob] ** 2
        variance[:, 0] += blobs.common_px[blob] ** 2
        errors.append(error**2)
        normed.append(error**2 / variance)
    return np.sqrt(np.concatenate(errors).mean(axis=0)), np.concatenate(normed).mean(axis=0)


if __name__ == "__main__":
    print(table())
