"""Locale decoding at 1 bit: the mean of all places that explain a blob's bits (Havelock's locales).

The places that give one and the same pattern of bits are its locale. Each place of a fine grid is weighed by
how likely it makes the pattern, given size, spread, noise and line jitter; the weighted mean is the estimate
with the least error, and the weighted variance is its own.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.measurement.locale_model import Appearance
from grabberd.measurement.locale_patterns import Kind, Patterns, patterns_of
from grabberd.measurement.locale_table import places, table
from grabberd.measurement.locator import Located, Seen, meant_for
from grabberd.measurement.shapes import binary_centres
from grabberd.measurement.sigma import binary_sigma_px

Array = NDArray[np.float64]
Single = NDArray[np.float32]

NOISES = (0.025, 0.05, 0.1)
"""Standard deviation of a pixel, in contrasts; the field's own bits say which."""
NOISE_BLOBS = 24
"""So many blobs are asked for it."""
LINES_APART = 2
JITTER_OF_CENTRE = 0.54
"""Variance of a centroid's x per variance of a line's shift, times the lines that its radius spans."""
JITTER_OF_ENDS = {1: 0.25, 2: 0.5}
"""How much of that the posterior has: it takes a row's ends, and interpolated rows, to shift by themselves."""
MOST_JITTER = 0.7
"""Of the variance of x: what is left is the blob's own."""
UNEXPLAINED = 20.0
"""A blob so much less likely (natural logarithm) than the median one is no target: three pixels are wrong."""


def locate_by_locale(seen: Seen) -> Located:
    """Posterior means; a blob that no target explains keeps its centroid and the centroid's σ.

    Raises:
        InputError: a field of more than 1 bit.
    """
    meant_for(seen, "locale", (1,))
    centres = binary_centres(seen.runs, seen.label, len(seen.shapes))
    sigma_px = binary_sigma_px(seen.area_px, seen.packed.y_step)
    patterns = patterns_of(seen, centres)
    if not patterns.alike:
        return Located(centres, sigma_px)
    found = _decoded(patterns, seen)
    explained = patterns.fits & (found.evidence > np.median(found.evidence) - UNEXPLAINED)
    blob = patterns.blob[explained]
    centres[blob] = patterns.anchor[explained] + found.from_anchor_px[explained] / (1, seen.packed.y_step)
    variance = found.variance_px2[explained]
    variance[:, 0] -= np.minimum(_jitter_px2(seen, blob), MOST_JITTER * variance[:, 0])
    sigma_px[blob] = np.sqrt(variance)
    return Located(centres, sigma_px)


def _jitter_px2(seen: Seen, blob: NDArray[np.int64]) -> Array:
    """(M,) what line jitter has added to the variances of x, which later rooms add as a whole."""
    lines = math.sqrt(4 / math.pi) / 2 * np.sqrt(seen.area_px[blob]) / LINES_APART
    common: Array = JITTER_OF_CENTRE * seen.settings.line_jitter_px**2 / lines
    return JITTER_OF_ENDS[seen.packed.y_step] * common


class Posterior(NamedTuple):
    """What the bits of M blobs say.

    Attributes:
        from_anchor_px: (M, 2) mean place, frame pixels; `variance_px2`: (M, 2) its variance.
        evidence: (M,) logarithm of how likely the pattern is at all, up to a constant.
    """

    from_anchor_px: Array
    variance_px2: Array
    evidence: Array


def _decoded(patterns: Patterns, seen: Seen) -> Posterior:
    found = posterior_of(_likelihoods(patterns, seen, NOISES[0]), seen.packed.y_step)
    noise = _likeliest_noise(_thinned(patterns), seen)
    if noise == NOISES[0]:
        return found
    return posterior_of(_likelihoods(patterns, seen, noise), seen.packed.y_step)


def _likeliest_noise(patterns: Patterns, seen: Seen) -> float:
    """The one of `NOISES` after which it gets worse."""
    evidence = _evidence(patterns, seen, NOISES[0])
    for noise, louder in pairwise(NOISES):
        of_louder = _evidence(patterns, seen, louder)
        if of_louder <= evidence:
            return noise
        evidence = of_louder
    return NOISES[-1]


def _evidence(patterns: Patterns, seen: Seen, noise: float) -> float:
    """Of these blobs together; what is no target counts for little."""
    each = posterior_of(_likelihoods(patterns, seen, noise), seen.packed.y_step).evidence
    return float(np.maximum(each, np.median(each) - UNEXPLAINED).sum())


def _thinned(patterns: Patterns) -> Patterns:
    """Those of the most frequent kinds, so that few tables are needed for them."""
    frequent = sorted(patterns.alike, key=lambda some: -len(some.ends))
    count = np.cumsum([len(some.ends) for some in frequent])
    enough = int(np.searchsorted(count, NOISE_BLOBS)) + 1
    return patterns._replace(alike=tuple(frequent[:enough]))


def _likelihoods(patterns: Patterns, seen: Seen, noise: float) -> Single:
    """(M, G) log likelihood of every blob at every place, in the order of `Patterns.alike`."""
    count = sum(len(some.ends) for some in patterns.alike)
    found = np.empty((count, len(places(seen.packed.y_step).x_px)), np.float32)
    end = 0
    for some in patterns.alike:
        one = table(_appearance(some.kind, patterns, seen, noise), some.window, some.kind.interpolated)
        first, end = end, end + len(some.ends)
        np.matmul(some.ends, one.cumulated, out=found[first:end])
        found[first:end] += one.empty
    return found


def _appearance(kind: Kind, patterns: Patterns, seen: Seen, noise: float) -> Appearance:
    return Appearance(
        kind.half_width_px,
        kind.half_height_px,
        kind.lean,
        patterns.fraction,
        noise,
        seen.settings.spread_px,
        seen.settings.line_jitter_px,
        seen.packed.y_step,
    )


def posterior_of(likelihood: Single, y_step: int) -> Posterior:
    """From the log likelihoods (M, G) of all `places`, each as likely as any other before."""
    x, y = places(y_step)
    greatest = likelihood.max(axis=1, keepdims=True)
    weight = np.exp(likelihood - greatest)
    sums = (weight @ np.stack([np.ones_like(x), x, y, x * x, y * y], axis=1)).astype(np.float64)
    mean = sums[:, 1:3] / sums[:, :1]
    variance = sums[:, 3:] / sums[:, :1] - mean * mean
    evidence = greatest[:, 0] + np.log(sums[:, 0] / len(x))
    return Posterior(mean, variance, evidence)
