"""A light as the camera and a logger have seen it, and the one offset at which both tell the same story."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import AnalysisError

Array = NDArray[np.float64]

_STEP_S = 5e-3
"""Grid of the search over all offsets: several steps to each bit of the pattern."""
_LEAST_AGREEMENT = 0.9
_LEAST_LEAD = 0.08
"""Agreement that the right offset has before every other one: of a pattern of chance, others have a half."""
_LEAST_COVERED = 0.6
"""Share of the capture that the logger must cover at an offset that is considered."""


class LightSignal(NamedTuple):
    """A light's state over time, as the camera's fields or a logger's readings tell it.

    Attributes:
        time_s: (K,) ascending; `lit`: (K,) True where it is on.
    """

    time_s: Array
    lit: NDArray[np.bool_]


def coarse_offset(camera: LightSignal, logger: LightSignal) -> tuple[float, float]:
    """The only offset at which both tell the same story, to some milliseconds, and how well they agree.

    Raises:
        AnalysisError: There is none, or more than one.
    """
    grid = _on_grid(camera)
    agreement = _agreement(grid, _on_grid(logger))
    best = int(np.argmax(agreement))
    lead = _lead(agreement, best)
    if agreement[best] < _LEAST_AGREEMENT:
        raise AnalysisError(
            f"at no offset do camera and logger agree on the light: at best in {agreement[best]:.0%} of the"
            " fields",
            "give the log of this capture's own time, and look whether the light in the picture is the one"
            " that the logger records",
        )
    if lead < _LEAST_LEAD:
        raise AnalysisError(
            "several offsets between camera and logger explain the light about equally well",
            "drive the light by a pattern that does not repeat, or record for longer",
        )
    shift = best - (len(grid) - 1)
    offset_s = camera.time_s[0] - logger.time_s[0] - shift * _STEP_S
    return float(offset_s), float(agreement[best])


def agreement_at_best(camera: LightSignal, logger: LightSignal) -> float:
    """Share of the time in which both agree at the best of all offsets; half of it is chance."""
    return float(_agreement(_on_grid(camera), _on_grid(logger)).max(initial=0.0))


def _on_grid(signal: LightSignal) -> Array:
    """States as ± 1 at equal steps from the first time on; 0 in gaps."""
    count = int((signal.time_s[-1] - signal.time_s[0]) / _STEP_S) + 1
    at_s = signal.time_s[0] + np.arange(count) * _STEP_S
    following = np.clip(np.searchsorted(signal.time_s, at_s), 1, len(signal.time_s) - 1)
    sooner = at_s - signal.time_s[following - 1] <= signal.time_s[following] - at_s
    nearest = np.where(sooner, following - 1, following)
    gap_s = max(_STEP_S, 1.5 * float(np.median(np.diff(signal.time_s))))
    known = np.abs(signal.time_s[nearest] - at_s) <= gap_s
    return np.where(known, np.where(signal.lit[nearest], 1.0, -1.0), 0.0)


def _agreement(camera: Array, logger: Array) -> Array:
    """(N,) share of the common time in which both agree, when the camera begins at each step of the logger.

    0 where they have too little time in common.
    """
    common = _correlated(np.abs(camera), np.abs(logger))
    least = _LEAST_COVERED * min(np.abs(camera).sum(), np.abs(logger).sum())
    share = (_correlated(camera, logger) / np.maximum(common, 1.0) + 1) / 2
    agreed: Array = np.where(common >= least, share, 0.0)
    return agreed


def _correlated(first: Array, second: Array) -> Array:
    """(N,) sums of products of `first` and `second`, from its last step over the other's first one on."""
    size = 1 << (len(first) + len(second) - 2).bit_length()
    product: Array = np.fft.irfft(np.fft.rfft(second, size) * np.conj(np.fft.rfft(first, size)), size)
    return np.concatenate([product[size - (len(first) - 1) :], product[: len(second)]])


def _lead(agreement: Array, best: int) -> float:
    """Lead of the best offset over the best one beyond its own peak."""
    left, right = best, best
    while left > 0 and agreement[left - 1] <= agreement[left]:
        left -= 1
    while right < len(agreement) - 1 and agreement[right + 1] <= agreement[right]:
        right += 1
    others = np.concatenate([agreement[:left], agreement[right + 1 :]])
    return float(agreement[best] - others.max(initial=0.0))
