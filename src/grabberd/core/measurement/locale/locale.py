"""Locale decoding at 1 bit: the mean of all positions that explain a blob's bits (Havelock's locales).

The positions that produce the same pattern of bits are its locale. Each position of a fine grid is weighted
by the likelihood of the pattern, given size, spread, noise and line jitter; the weighted mean is the estimate
of least error, and the weighted variance is its variance.
"""

import math

import numpy as np
from numpy.typing import NDArray

from grabberd.core.measurement.locale.locale_model import Appearance
from grabberd.core.measurement.locale.locale_patterns import Patterns, patterns_of
from grabberd.core.measurement.locale.locale_posterior import Entries, Posterior, evidence_of, likelihoods
from grabberd.core.measurement.locale.locale_table import Grid, table
from grabberd.core.measurement.locators.locator import Located, Seen, meant_for
from grabberd.core.measurement.sigma import binary_sigma_px

Array = NDArray[np.float64]

NOISES = (0.03, 0.05, 0.1)
"""Candidates for a pixel's standard deviation, in contrasts; the field's own bits decide between them."""
NOISE_BLOBS = 24
"""Number of blobs that decide the noise."""
JITTER_OF_CENTRE = 0.54
"""Variance of a centroid's x per variance of a line's shift, times the lines that its radius spans."""
JITTER_OF_ENDS, JITTER_OF_DOUBLED_ENDS = 0.5, 0.25
"""Share of that in the posterior: it models a row's ends, and interpolated rows, as independent."""
SHARED_NOISE = 1.15
"""Factor on the variance of x of doubled fields: interpolated rows have no noise of their own but are counted
as if they had."""
MOST_JITTER = 0.7
"""Greatest share of the variance of x attributed to line jitter; the rest is the blob's own."""
UNEXPLAINED = 20.0
"""Log likelihood below the median blob's at which a blob is no target: three pixels are wrong (see SURE)."""


def locate_by_locale(seen: Seen) -> Located:
    """Locate by posterior means; a blob that no target explains keeps its centroid and the centroid's σ.

    Size, lean, threshold height and noise come from the field's own blobs, spread and line jitter from the
    settings.

    Raises:
        InputError: The field has more than 1 bit.
    """
    meant_for(seen, "locale", (1,))
    centres = seen.centroids.copy()
    sigma_px = binary_sigma_px(seen.area_px, seen.packed.y_step, doubled=seen.packed.is_doubled)
    patterns = patterns_of(seen, centres)
    if not patterns.kinds:
        return Located(centres, sigma_px)
    spread_px, jitter_px = seen.settings.spread_px, seen.settings.line_jitter_px
    packed = seen.packed
    look = Appearance(
        1.0, 1.0, patterns.fraction, NOISES[0], spread_px, jitter_px, packed.y_step, packed.lines_apart
    )
    posterior = _posterior(patterns, look)
    explained = posterior.evidence > np.median(posterior.evidence) - UNEXPLAINED
    blob = patterns.blob[explained]
    stretched = patterns.stretched[explained]
    from_middle_px = posterior.from_middle_px[explained] / stretched
    centres[blob] = patterns.middle[explained] + from_middle_px / (1, seen.packed.y_step)
    variance = posterior.variance_px2[explained] / stretched**2
    variance[:, 0] *= SHARED_NOISE if packed.is_doubled else 1.0
    variance[:, 0] -= np.minimum(_jitter_px2(seen, blob), MOST_JITTER * variance[:, 0])
    sigma_px[blob] = np.sqrt(variance)
    return Located(centres, sigma_px)


def _jitter_px2(seen: Seen, blob: NDArray[np.int64]) -> Array:
    """(M,) variance of x from line jitter, which is reported separately as the common error."""
    lines = math.sqrt(4 / math.pi) / 2 * np.sqrt(seen.area_px[blob]) / seen.packed.lines_apart
    common: Array = JITTER_OF_CENTRE * seen.settings.line_jitter_px**2 / lines
    return common * (JITTER_OF_DOUBLED_ENDS if seen.packed.is_doubled else JITTER_OF_ENDS)


def _posterior(patterns: Patterns, look: Appearance) -> Posterior:
    """Posterior with the noise that explains the field's blobs best."""
    grids = [Grid.of(*kind, look.y_step) for kind in patterns.kinds]
    entries = Entries.of(patterns.cuts, grids, patterns.blobs)
    blobs = min(patterns.blobs[0], NOISE_BLOBS)
    noise = _likeliest_noise(look.of_size(*patterns.kinds[0]), blobs, entries.first(blobs))
    look = look._replace(noise=noise)
    tables = [table(look.of_size(*kind)) for kind in patterns.kinds]
    return Posterior.of(likelihoods(tables, patterns.blobs, entries), look.y_step)


def _likeliest_noise(look: Appearance, blobs: int, entries: Entries) -> float:
    """The value of `NOISES` that explains blobs of the most frequent kind best."""
    tables = (table(look._replace(noise=noise)) for noise in NOISES)
    evidence = np.array([evidence_of(likelihoods([one], [blobs], entries)) for one in tables])
    # Blobs that are no targets must not decide.
    least = np.array([[np.median(one)] for one in evidence]) - UNEXPLAINED
    return NOISES[int(np.maximum(evidence, least).sum(axis=1).argmax())]
