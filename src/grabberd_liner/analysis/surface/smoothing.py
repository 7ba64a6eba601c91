"""Choice of the surface's smoothness from the points of one or several fields.

The length round is fixed; it was tuned on simulated tubes that collapse elliptically (radius 12.5 mm, six
columns 6.5 mm apart). There σ of the curvatures is realistic on average over the targets: squared errors are
.7 to 1.2 of σ², at 8 bits twice σ² at the outermost columns, and up to twice σ² halfway between two columns.
On other tubes (radius 14 mm; deeper, shallower, shorter, longer) the mean ranged from .4 to 1.3. If the
outermost column comes close to the fold of a closed wall (radius 11 mm), bending within a pitch is not
resolved: σ is two to five times too small, which the residuals do not show. The remedy is more columns, or
leaving out the outermost ones.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.surface.modes import FREE, Domain, Modes, modes

ROUND = 1.28
"""Correlation length round, in pitches of the columns. It is not chosen from the points: a few columns leave
it open, and longer ones claim more at the outermost columns than is known there (see above)."""

_LENGTHS = (2.0, 4.0, 8.0, 16.0)
_HALVINGS = 2
"""Candidate correlation lengths along the rows, in pitches, and number of refinements of their ratio."""

# A grid over all plausible amplitudes instead of a search: the likelihood may have two maxima.
_AMPLITUDES_MM = 10.0 ** np.arange(-3.0, 2.01, 0.05)

_SHOWN = 4.0
"""Gain in twice the log likelihood from which a departure counts as real: two σ."""


class Smoothing(NamedTuple):
    """The prior's parameters.

    Attributes:
        along_mm: correlation length along the rows of the departure from the nominal shape.
        round_mm: correlation length round the wall.
        amplitude_mm: σ of the departure's x, y, z, beyond terms linear in u and in v.
        noise_factor: factor on the points' σ: 1 unless chosen by cross-validation.
    """

    along_mm: float
    round_mm: float
    amplitude_mm: tuple[float, ...]
    noise_factor: float = 1.0


class Departures(NamedTuple):
    """Evidence of one field's points about the departure from the nominal shape.

    Attributes:
        u_mm, v_mm: (N,) material coordinates.
        departure_mm: (N, D) departures in D directions; `sigma_mm`: (N, D) their noise.
    """

    u_mm: NDArray[np.float64]
    v_mm: NDArray[np.float64]
    departure_mm: NDArray[np.float64]
    sigma_mm: NDArray[np.float64]


Criterion = Literal["likelihood", "cross-validation"]


def choose(
    domain: Domain,
    fields: Sequence[Departures],
    by: Criterion = "likelihood",
    along_mm: float | None = None,
) -> Smoothing:
    """Choose a common smoothing for fields.

    Either by restricted likelihood, which takes the points' σ as known, or by generalised cross-validation,
    which needs only their ratios and estimates the noise factor, too. The correlation length along the rows
    is chosen as well, unless it is given.
    """
    round_mm = ROUND * domain.v_pitch_mm

    def tried(length: float) -> _Choice:
        candidate = modes(domain, length * domain.u_pitch_mm, round_mm)
        return _best([_spectra(candidate, field) for field in fields], by)

    known = () if along_mm is None else (along_mm / domain.u_pitch_mm,)
    choices = {length: tried(length) for length in known or _LENGTHS}
    for halving in range(1, 1 if known else _HALVINGS + 1):
        best = min(choices, key=lambda length: choices[length].cost)
        step = 2.0 ** (0.5**halving)
        choices |= {length: tried(length) for length in (best / step, best * step)}
    best = min(choices, key=lambda length: choices[length].cost)
    chosen = choices[best]
    return Smoothing(best * domain.u_pitch_mm, round_mm, chosen.amplitude_mm, chosen.noise_factor)


class _Choice(NamedTuple):
    """Cost, amplitude of each direction and noise factor at the best amplitudes."""

    cost: float
    amplitude_mm: tuple[float, ...]
    noise_factor: float


class _Spectrum(NamedTuple):
    """One direction of one field: n values of unit noise, after the free modes are projected out.

    Attributes:
        energy: (K,) squared singular values of the modes at the points; `part2`: (K,) squared parts of the
            departure along their vectors; `number`: n.
    """

    energy: NDArray[np.float64]
    part2: NDArray[np.float64]
    number: int


def _spectra(candidate: Modes, field: Departures) -> list[_Spectrum]:
    places = candidate.jets(field.u_mm, field.v_mm, highest=0)[:, 0]
    return [
        _spectrum(places / sigma[:, np.newaxis], departure / sigma)
        for departure, sigma in zip(field.departure_mm.T, field.sigma_mm.T, strict=True)
    ]


def _spectrum(design: NDArray[np.float64], departure: NDArray[np.float64]) -> _Spectrum:
    basis = np.linalg.qr(design[:, :FREE], mode="complete")[0][:, FREE:]
    penalised, value = basis.T @ design[:, FREE:], basis.T @ departure
    energy, vectors = np.linalg.eigh(penalised @ penalised.T)
    part2 = (vectors.T @ value) ** 2
    return _Spectrum(np.maximum(energy, 0.0), part2, len(value))


def _best(spectra: list[list[_Spectrum]], by: Criterion) -> _Choice:
    directions = list(zip(*spectra, strict=True))
    if by == "likelihood":
        costs = [np.sum([_likelihood(field) for field in direction], axis=0) for direction in directions]
        best = [_shown(cost) for cost in costs]
        total = float(sum(cost[place] for cost, place in zip(costs, best, strict=True)))
        return _Choice(total, tuple(float(_AMPLITUDES_MM[place]) for place in best), 1.0)
    return _cross_validated(directions)


def _shown(cost: NDArray[np.float64]) -> int:
    """Index of the best amplitude; of the least one unless the points show a significant departure."""
    best = int(np.argmin(cost))
    return best if cost[0] - cost[best] > _SHOWN else 0


def _likelihood(spectrum: _Spectrum) -> NDArray[np.float64]:
    """Minus twice the log restricted likelihood, at every amplitude."""
    variance = 1 + np.multiply.outer(_AMPLITUDES_MM**2, spectrum.energy)
    cost: NDArray[np.float64] = (np.log(variance) + spectrum.part2 / variance).sum(axis=1)
    return cost


def _cross_validated(directions: list[tuple[_Spectrum, ...]]) -> _Choice:
    total, ratios, squares, freedom = 0.0, [], 0.0, 0.0
    for direction in directions:
        left = [1 / (1 + np.multiply.outer(_AMPLITUDES_MM**2, field.energy)) for field in direction]
        residual = sum((one**2 * field.part2).sum(axis=1) for one, field in zip(left, direction, strict=True))
        free = sum(one.sum(axis=1) for one in left)
        count = sum(field.number for field in direction)
        score = count * residual / free**2
        place = int(np.argmin(score))
        total += count * float(np.log(score[place]))
        ratios.append(float(_AMPLITUDES_MM[place]))
        squares, freedom = squares + float(residual[place]), freedom + float(free[place])
    factor = float(np.sqrt(squares / freedom))
    return _Choice(total, tuple(ratio * factor for ratio in ratios), factor)
