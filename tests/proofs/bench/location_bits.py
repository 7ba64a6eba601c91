"""Pointing at 1 bit on rendered discs: noise and line jitter, and what becomes of the missing lines."""

from collections.abc import Callable

import numpy as np
from tests.core.measurement.rendering import BOTTOM, TOP, errors_px, grid_of_discs

from grabberd.core.field import Field, PackedField, double_lines, quantise, unpack
from grabberd.core.measurement import LocationSettings, ThresholdRule, choose_threshold, measure

DIAMETERS_PX = (4.85, 5.0, 5.15)
JITTERS_PX = (0.0, 0.12)
NOISES = (0.02, 0.05, 0.10)
SPREAD_PX = 0.8


def _after(field: Field, threshold: int, interpolation: str) -> PackedField:
    """Interpolate the bits themselves, and threshold once more at half the greatest weight."""
    return quantise(double_lines(unpack(quantise(field, 1, threshold)), interpolation), 1, 127)


LINES: dict[str, Callable[[Field, int], PackedField]] = {
    "intact": lambda field, threshold: quantise(field, 1, threshold),
    "linear, before the threshold": lambda field, threshold: quantise(double_lines(field), 1, threshold),
    "3×3 kernel, before": lambda field, threshold: quantise(double_lines(field, "kernel3x3"), 1, threshold),
    "linear, after": lambda field, threshold: _after(field, threshold, "linear"),
    "3×3 kernel, after": lambda field, threshold: _after(field, threshold, "kernel3x3"),
}
"""What may become of the lines that a field lacks (paper 3.3)."""


def table_of_lines() -> str:
    """RMS error x / y without line jitter at 2 % noise, for every way to treat the missing lines."""
    pictures = _pictures(0.0, NOISES[0])
    rows = []
    for name, pack in LINES.items():
        threshold = _threshold(pictures, 0.0, doubled="before" in name)
        packed = [(pack(field, threshold), places) for field, places in pictures]
        figures = [_errors(packed, method, 0.0)[0] for method in ("centroid", "locale")]
        rows.append(f"| {name} | " + " | ".join(_pair(figure) for figure in figures) + " |")
    return "\n".join(["| missing lines | centroid | locale |", "|---|---|---|", *rows])


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
    threshold = _threshold(pictures, jitter_px, doubled)
    pack = LINES["linear, before the threshold" if doubled else "intact"]
    packed = [(pack(field, threshold), places) for field, places in pictures]
    figures = [_errors(packed, method, jitter_px) for method in ("centroid", "locale")]
    (centroid, _), (locale, chi2) = figures
    lines = "doubled" if doubled else "288 intact"
    height = (threshold - 30) / 180
    return (
        f"| {lines} | {jitter_px:.2f} px | {noise:.0%} | {height:.0%} | "
        f"{_pair(centroid)} | {_pair(locale)} | {chi2[0]:.2f} / {chi2[1]:.2f} |"
    )


def _threshold(pictures: list[tuple[Field, np.ndarray]], jitter_px: float, doubled: bool) -> int:
    rule = ThresholdRule(spread_px=SPREAD_PX, line_jitter_px=jitter_px)
    histogram = np.bincount(pictures[0][0].luma.ravel(), minlength=256)
    return choose_threshold(histogram, rule, 1, (1 if doubled else 2, 2))


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


def _errors(
    packed: list[tuple[PackedField, np.ndarray]], method: str, jitter_px: float
) -> tuple[np.ndarray, np.ndarray]:
    """RMS error and mean χ² of x and y."""
    errors, normed = [], []
    settings = LocationSettings(
        method=method, spread_px=SPREAD_PX, line_jitter_px=jitter_px, line_shifts=False
    )
    for field, places in packed:
        blobs = measure(field, None, settings)
        error, blob = errors_px(blobs, places)
        variance = blobs.sigma_px[blob] ** 2
        variance[:, 0] += blobs.common_px[blob] ** 2
        errors.append(error**2)
        normed.append(error**2 / variance)
    return np.sqrt(np.concatenate(errors).mean(axis=0)), np.concatenate(normed).mean(axis=0)
