"""Offset and drift of a logger's clock from the camera's, from a light that both have seen: first the one
offset at which both tell the same story, then their relation by every switching.

Of every switching the camera knows only between which two fields it was, the logger only between which two
readings: each one bounds the offset from both sides. Because the pattern never repeats and does not keep
step with the fields, the bounds of many lie close together where all hold. A field counts as lit from some
share of its exposure on, which delays switching on and off in opposite ways; so does a logger's input. That
asymmetry is an unknown beside offset and drift, and so is how far fields' times scatter.

The offset of a logger's clock, found through a light that is in the picture and in its readings.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from grabberd.core.arrays import Array, Mask
from grabberd.core.field import NumberedField
from grabberd.core.measurement.noise import FlashingPlace, Levels, flashing_places, tile_levels
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.vacuum.vacuum import ChannelCurve

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
    lit: Mask


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
    return np.where(common >= least, share, 0.0)


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


LEAST_EDGES = 12
"""Switchings in each direction together, below which the offset is not determined to a millisecond."""
DRIFT_SIGMA = 1e-4
"""Quartz clocks differ by some tens of parts in a million."""
ASYMMETRY_SIGMA_S = 2e-3
"""Half of the longest exposure that freezes a liner, and a slow logger's input."""

_MATCH_S = 0.04
"""Room about the coarse offset in which a switching of the log is taken for one in the picture.

Two fields, and less than half a bit of the pattern.
"""
_STRAY = 1e-3
"""Share of switchings that may be anywhere within the bounds of a match."""
_SCATTERS_S = (2e-5, 1e-4, 3e-4, 1e-3, 3e-3)
"""Standard deviations of a field's time that are weighed against each other."""
_NODES = 13
"""Nodes on each axis of the grid over offset, asymmetry and drift, over ± 4 σ of what is known of them."""
_MOST_ROUNDS = 14
_SETTLED = 0.8
"""Of the variances on whose scale a round's grid lies: where they shrink no further, it lies right."""


class LightClock(NamedTuple):
    """Relation of two clocks: camera's time = logger's time + offset + drift · (camera's time − middle).

    Attributes:
        offset_s: In the capture's middle, with `offset_sigma_s`.
        middle_s: That middle, in the camera's time.
        drift: Seconds that a second differs by, with `drift_sigma`.
        asymmetry_s: By which the camera sees the light go on later than the logger, and off sooner.
        edges: Number of switchings that it comes from.
        agreement: Share of fields in which camera and logger agree on the light's state.
        scatter_s: Scatter of the fields' times that explains the switchings best.
    """

    offset_s: float
    offset_sigma_s: float
    middle_s: float
    drift: float
    drift_sigma: float
    asymmetry_s: float
    edges: int
    agreement: float
    scatter_s: float

    def camera_s(self, logger_s: Array) -> Array:
        """(K,) times of the logger's clock on the camera's."""
        return (logger_s + self.offset_s - self.drift * self.middle_s) / (1 - self.drift)

    def sigma_s(self, camera_s: Array) -> float:
        """σ of the relation at times (F,) of the camera, root mean square: of the offset, and of the drift.

        A long capture goes on far beyond the fields that the light was followed in.
        """
        drifted_s = self.drift_sigma * np.sqrt(np.mean((camera_s - self.middle_s) ** 2))
        return float(np.hypot(self.offset_sigma_s, drifted_s))


class _Edges(NamedTuple):
    """Switchings: each happened after `after_s` and not after `until_s`."""

    after_s: Array
    until_s: Array
    rising: Mask


def relate_clocks(camera: LightSignal, logger: LightSignal) -> LightClock:
    """Finds the offset of the logger's clock from the camera's.

    Args:
        camera: The light's state in each field, at the middle of its exposure.
        logger: The light's state in each reading.

    Raises:
        AnalysisError: The signals do not belong together, several offsets explain them, or there are too few
            switchings.
    """
    coarse_s, agreement = coarse_offset(camera, logger)
    seen, logged = _edges(camera), _edges(logger)
    bounds = _matched(seen, logged, coarse_s)
    if len(bounds.rising) < LEAST_EDGES or min(bounds.rising.sum(), (~bounds.rising).sum()) < LEAST_EDGES / 3:
        raise AnalysisError(
            f"the light switches {len(bounds.rising)} times while both the camera and the logger see it",
            f"record for longer, so that it switches at least {LEAST_EDGES} times",
        )
    middle_s = float(camera.time_s[[0, -1]].mean())
    return _posterior(bounds, coarse_s, middle_s, agreement)


def _edges(signal: LightSignal) -> _Edges:
    at = np.flatnonzero(signal.lit[1:] != signal.lit[:-1])
    return _Edges(signal.time_s[at], signal.time_s[at + 1], signal.lit[at + 1])


def _matched(seen: _Edges, logged: _Edges, coarse_s: float) -> "_Bounds":
    """Each switching that the camera saw with the one that the logger recorded nearest to it."""
    if not len(logged.rising):
        return _Bounds(*(np.zeros(0),) * 4, np.zeros(0, bool))
    seen_s = (seen.after_s + seen.until_s) / 2 - coarse_s
    logged_s = (logged.after_s + logged.until_s) / 2
    after = np.clip(np.searchsorted(logged_s, seen_s), 1, max(len(logged_s) - 1, 1))
    nearest = np.where(
        np.abs(logged_s[after - 1] - seen_s)
        <= np.abs(logged_s[np.minimum(after, len(logged_s) - 1)] - seen_s),
        after - 1,
        np.minimum(after, len(logged_s) - 1),
    )
    room_s = _MATCH_S + (seen.until_s - seen.after_s) / 2
    fits = (np.abs(logged_s[nearest] - seen_s) <= room_s) & (logged.rising[nearest] == seen.rising)
    pairs = np.flatnonzero(fits)
    return _Bounds(
        seen.after_s[pairs],
        seen.until_s[pairs],
        logged.after_s[nearest[pairs]],
        logged.until_s[nearest[pairs]],
        seen.rising[pairs],
    )


class _Bounds(NamedTuple):
    """Switchings that both have seen: between which fields, and between which readings."""

    field_after_s: Array
    field_until_s: Array
    reading_after_s: Array
    reading_until_s: Array
    rising: Mask


def _posterior(bounds: _Bounds, coarse_s: float, middle_s: float, agreement: float) -> LightClock:
    """Mean and σ of offset and drift, over all scatters of the fields' times by their weights."""
    found: list[_Found] = []
    # From the widest on: the density given less scatter lies within that given more.
    for scatter_s in reversed(_SCATTERS_S):
        found.append(_given_scatter(bounds, (coarse_s, middle_s, scatter_s), found[-1] if found else None))
    evidence = np.array([one.evidence for one in found])
    weight = np.exp(evidence - evidence.max())
    weight /= weight.sum()
    means = np.array([one.mean for one in found])
    mean = weight @ means
    within = np.einsum("s,sij->ij", weight, np.array([one.covariance for one in found]))
    sigma = np.sqrt(np.diagonal(within + (means - mean).T @ ((means - mean) * weight[:, np.newaxis])))
    return LightClock(
        offset_s=float(coarse_s + mean[0]),
        offset_sigma_s=float(sigma[0]),
        middle_s=middle_s,
        drift=float(mean[2]),
        drift_sigma=float(sigma[2]),
        asymmetry_s=float(mean[1]),
        edges=len(bounds.rising),
        agreement=agreement,
        scatter_s=_SCATTERS_S[::-1][int(np.argmax(weight))],
    )


class _Found(NamedTuple):
    """Mean (3,) and covariance (3, 3) of offset − coarse, asymmetry and drift; logarithm of the evidence."""

    mean: Array
    covariance: Array
    evidence: float


def _given_scatter(bounds: _Bounds, given_s: tuple[float, float, float], near: _Found | None) -> _Found:
    """Knowledge of offset, asymmetry and drift, given coarse offset, middle and scatter.

    The density is no normal one, but its logarithm is concave: a grid that follows its mean and spread
    from round to round finds it from anywhere.
    """
    prior = np.array([_MATCH_S / 2, ASYMMETRY_SIGMA_S, DRIFT_SIGMA])
    axis = np.linspace(-4, 4, _NODES)
    step = axis[1] - axis[0]
    unit = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    found = near or _Found(np.zeros(3), np.diag(prior**2), 0.0)
    around = found.covariance
    for _ in range(_MOST_ROUNDS):
        root = np.linalg.cholesky(around)
        at = found.mean + unit @ root.T
        log_density = _log_density(bounds, given_s, at) - 0.5 * ((at / prior) ** 2).sum(axis=1)
        top = log_density.max()
        weight = np.exp(log_density - top)
        evidence = float(top + np.log(weight.sum() * np.prod(np.diagonal(root)) * step**3))
        weight /= weight.sum()
        mean = weight @ at
        found = _Found(mean, (at - mean).T @ ((at - mean) * weight[:, np.newaxis]), evidence)
        # Never narrower than a node: what lies between two of them would be lost.
        around = found.covariance + around * step**2 / 12
        if np.all(np.diagonal(around) > _SETTLED * np.diagonal(root @ root.T)):
            break
    return found


def _log_density(bounds: _Bounds, given_s: tuple[float, float, float], at: Array) -> Array:
    """(G,) logarithm of the likelihood at G triples of offset, asymmetry and drift."""
    coarse_s, middle_s, scatter_s = given_s
    when_s = (bounds.field_after_s + bounds.field_until_s) / 2 - middle_s
    total = np.zeros(len(at))
    columns = zip(
        when_s,
        bounds.field_after_s - bounds.reading_until_s - coarse_s,
        bounds.field_until_s - bounds.field_after_s,
        np.maximum(bounds.reading_until_s - bounds.reading_after_s, 1e-9),
        np.where(bounds.rising, 1.0, -1.0),
        strict=True,
    )
    for since_s, first_s, field_s, reading_s, way in columns:
        shift_s = at[:, 0] + way * at[:, 1] + at[:, 2] * since_s - first_s
        density = _trapezoid(shift_s, field_s, reading_s, scatter_s)
        total += np.log((1 - _STRAY) * density + _STRAY / (2 * _MATCH_S))
    return total


def _trapezoid(x: Array, first: float, second: float, scatter: float) -> Array:
    """(G,) density at x of the sum of numbers that are uniform up to `first` and `second`, and a normal."""
    if second < scatter / 10:  # the difference quotients below would cancel
        return (ndtr((x - second / 2) / scatter) - ndtr((x - first - second / 2) / scatter)) / first

    def integral(y: Array) -> Array:
        z = y / scatter
        return scatter * (z * ndtr(z) + np.exp(-0.5 * z * z) / np.sqrt(2 * np.pi))

    high = integral(x) - integral(x - second) - integral(x - first) + integral(x - first - second)
    return np.maximum(high, 0.0) / (first * second)


MOST_FIELDS = 3000
"""Fields that are looked at, those of a minute at 50 a second and of 25 s at 120: they give the offset to a
tenth of a millisecond. Each takes up to 26 kB, and several times that while they are searched.
"""
_LEAST_FIELDS, _FITS = 50, 4
_MOST_SCATTER_S = 3e-3
"""Median departure from equal steps that stamps may have, far below what a missing field makes."""
_LEAST_SWING = 0.8
"""Share of the readings that lie near one of both states of a light's input."""


class FoundLight(NamedTuple):
    """The light in the picture, and the clocks' relation that it tells.

    Attributes:
        clock: Relation of the clocks.
        x_px: Column of the light's middle, frame pixels; `y_px`: its frame line.
        logger: Name of the logger that recorded it with the capture; None for that of a log.
        delay_sigma_s: σ of what all of that one's readings are late by.
    """

    clock: LightClock
    x_px: float
    y_px: float
    logger: str | None = None
    delay_sigma_s: float = 0.0

    def sigma_s(self, curve: ChannelCurve, camera_s: Array) -> float:
        """σ of a recorded channel's times on the camera's clock, at times (F,) of the camera.

        What all readings of one logger are late by, its light has seen as well.
        """
        delays_s = 0.0 if curve.logger == self.logger else np.hypot(curve.delay_sigma_s, self.delay_sigma_s)
        scatter_s = np.sqrt(max(curve.time_sigma_s**2 - curve.delay_sigma_s**2, 0.0))
        return float(np.sqrt(self.clock.sigma_s(camera_s) ** 2 + delays_s**2 + scatter_s**2))


def find_light(fields: Iterable[NumberedField], first_ns: int, logged: LightSignal) -> FoundLight:
    """Finds the light in the fields and the offset between the camera's clock and the logger's.

    Args:
        fields: Fields of a capture.
        first_ns: Time from which the camera's seconds count.
        logged: The light's state in each reading of the logger.

    Raises:
        AnalysisError: There is no light in the picture that goes by the log, or it does not determine the
            offset.
    """
    time_s, levels, y_step = _levels(fields, first_ns)
    places = flashing_places(levels, y_step)
    if not places:
        raise AnalysisError(
            "no place in the picture goes on and off",
            "look at the picture for the light: it has to be in view, brighter than the threshold, and"
            " switched several times during the capture",
        )
    agreement = [agreement_at_best(LightSignal(time_s, place.lit), logged) for place in places]
    best: FlashingPlace = places[int(np.argmax(agreement))]
    return FoundLight(relate_clocks(LightSignal(time_s, best.lit), logged), best.x_px, best.y_px)


def _levels(fields: Iterable[NumberedField], first_ns: int) -> tuple[Array, Levels, int]:
    """Times in s, tile levels and the lines from row to row of the first fields."""
    numbers, times, levels, y_step = [], [], [], 1
    for field in fields:
        numbers.append(field.n)
        times.append((field.time_ns - first_ns) / 1e9)
        levels.append(tile_levels(field.packed))
        y_step = field.packed.y_step
        if len(times) == MOST_FIELDS:
            break
    if not times:
        raise AnalysisError("the capture has no fields", "choose a capture with fields")
    return steady_times(np.array(numbers), np.array(times)), np.stack(levels), y_step


def steady_times(number: NDArray[np.int64], time_s: Array) -> Array:
    """(F,) times of fields without the scatter of their stamps: a camera's fields come at equal steps.

    They stay as they are where they do not, as in a film that was cut.
    """
    if len(number) < _LEAST_FIELDS:
        return time_s
    kept = np.ones(len(number), np.bool_)
    for _ in range(_FITS):
        slope, start = np.polyfit(number[kept], time_s[kept], 1)
        departure = np.abs(time_s - start - slope * number)
        # Stamps are late now and then, by tens of milliseconds; those of half of the fields are not.
        kept = departure <= 4 * np.median(departure) + 1e-6
    fitted: Array = start + slope * number
    return fitted if np.median(departure) < _MOST_SCATTER_S else time_s


def logged_light(time_s: Array, level: Array, source: str = "the vacuum log's light") -> LightSignal:
    """The light's states in a log or a channel, from levels in any unit.

    Args:
        time_s: (K,) times of the readings.
        level: (K,) levels.
        source: What they are called for people.

    Raises:
        InputError: It has not two states.
    """
    low, high = np.percentile(level, (1, 99))
    near = np.minimum(np.abs(level - low), np.abs(level - high)) <= 0.25 * (high - low)
    if not high > low or near.mean() < _LEAST_SWING:
        raise InputError(
            f"{source} goes from {low:g} to {high:g} without two states",
            "record the voltage at the light, or 1 while it is on and 0 while it is off",
        )
    return LightSignal(time_s, level > (low + high) / 2)
