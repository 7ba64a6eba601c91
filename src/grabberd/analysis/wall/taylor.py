"""Truncated Taylor series of two variables with reverse-mode differentiation.

A series describes how a quantity varies round a position, to the second degree; arithmetic with series gives
the second derivatives of a result exactly, without a stencil. Each series keeps its parents, so the
derivatives of a result by all inputs come from one backward sweep (`gradients`): a few milliseconds for the
pressure at every target, where differences would take ten times as long.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LINEAR = 3


class Taylor:
    """The series of one quantity at many places.

    Attributes:
        values: (6, ...) coefficients of 1, u, v, u², uv, v², or the first (3, ...) or (1, ...) of them.
        parents: the series that it was made of, each with the map from the gradient by this series to that by
            the parent.
    """

    __slots__ = ("parents", "values")

    def __init__(
        self, values: Array, parents: Sequence[tuple["Taylor", Callable[[Array], Array]]] = ()
    ) -> None:
        self.values = values
        self.parents = parents

    def __add__(self, other: "Taylor") -> "Taylor":
        return Taylor(self.values + other.values, ((self, _same), (other, _same)))

    def __sub__(self, other: "Taylor") -> "Taylor":
        return Taylor(self.values - other.values, ((self, _same), (other, np.negative)))

    def __mul__(self, other: "Taylor") -> "Taylor":
        a, b = self.values, other.values
        return Taylor(
            _product(a, b), ((self, lambda bar: _adjoint(b, bar)), (other, lambda bar: _adjoint(a, bar)))
        )

    def times(self, factor: float | Array) -> "Taylor":
        """The series times a number, or times one number for each place."""
        return Taylor(self.values * factor, ((self, lambda bar: bar * factor),))

    def plus(self, constant: float) -> "Taylor":
        """The series plus a number."""
        values = self.values.copy()
        values[0] += constant
        return Taylor(values, ((self, _same),))

    def power(self, exponent: float) -> "Taylor":
        """The series to a real power."""
        values = _power(self.values, exponent)
        slope = exponent * _product(values, _power(self.values, -1.0))
        return Taylor(values, ((self, lambda bar: _adjoint(slope, bar)),))

    def linear(self) -> "Taylor":
        """The same without its second degree."""
        return self._read((0, 1, 2), (1, 1, 1))

    def constant(self) -> "Taylor":
        """The value at the place itself."""
        return self._read((0,), (1,))

    def by_u(self) -> "Taylor":
        """The derivative by u: of one degree less."""
        return self._read((1, 3, 4), (1, 2, 1)) if len(self.values) > LINEAR else self._read((1,), (1,))

    def by_v(self) -> "Taylor":
        """The derivative by v: of one degree less."""
        return self._read((2, 4, 5), (1, 1, 2)) if len(self.values) > LINEAR else self._read((2,), (1,))

    def _read(self, places: tuple[int, ...], weights: tuple[int, ...]) -> "Taylor":
        size = len(self.values)
        values = np.stack([self.values[p] * w for p, w in zip(places, weights, strict=True)])
        return Taylor(values, ((self, lambda bar: _spread(bar, size, places, weights)),))


def total(terms: Iterable[Taylor]) -> Taylor:
    """The sum of series."""
    terms = tuple(terms)
    return Taylor(sum(term.values for term in terms), tuple((term, _same) for term in terms))  # type: ignore[arg-type]


def gradients(seeds: Sequence[tuple[Taylor, Array]], wanted: Sequence[Taylor]) -> list[Array]:
    """The derivatives of a result, place by place.

    Args:
        seeds: series that the result depends on, each with the result's derivative by that series' values.
        wanted: series by whose values the derivatives are computed.
    """
    bars: dict[Taylor, Array] = {}
    for series, bar in seeds:
        _enter(bars, series, bar)
    for series in _latest_first([series for series, _ in seeds]):
        bar = bars[series]
        for parent, back in series.parents:
            _enter(bars, parent, back(bar))
    return [bars.get(series, np.zeros_like(series.values)) for series in wanted]


def _enter(bars: dict[Taylor, Array], series: Taylor, bar: Array) -> None:
    bars[series] = bars[series] + bar if series in bars else bar


def _latest_first(ends: Sequence[Taylor]) -> list[Taylor]:
    """All ancestors of the ends, each before its parents."""
    order: list[Taylor] = []
    seen: set[Taylor] = set()
    stack = [(series, False) for series in ends]
    while stack:
        series, done = stack.pop()
        if done:
            order.append(series)
        elif series not in seen:
            seen.add(series)
            stack.append((series, True))
            stack.extend((parent, False) for parent, _ in series.parents)
    return order[::-1]


def _same(bar: Array) -> Array:
    return bar


def _spread(bar: Array, size: int, places: tuple[int, ...], weights: tuple[int, ...]) -> Array:
    result = np.zeros((size, *bar.shape[1:]))
    for row, place, weight in zip(bar, places, weights, strict=True):
        result[place] = row * weight
    return result


def _product(a: Array, b: Array) -> Array:
    a, b = _aligned(a, b)
    result: Array = np.empty((len(a), *np.broadcast_shapes(a.shape[1:], b.shape[1:])))
    np.multiply(a[0], b, out=result)
    result[1:] += a[1:] * b[0]
    if len(a) > LINEAR:
        result[3:5] += a[1] * b[1:3]
        result[4:6] += a[2] * b[1:3]
    return result


def _adjoint(factor: Array, bar: Array) -> Array:
    """The transpose of the product with a factor."""
    factor, bar = _aligned(factor, bar)
    result: Array = factor[0] * bar
    result[0] += np.einsum("k...,k...->...", factor[1:], bar[1:])
    if len(factor) > LINEAR:
        result[1:3] += factor[1] * bar[3:5]
        result[1:3] += factor[2] * bar[4:6]
    return result


def _aligned(a: Array, b: Array) -> tuple[Array, Array]:
    """Align the axes of two series: coefficients first, trailing axes matched."""
    more = b.ndim - a.ndim
    if more > 0:
        a = a.reshape(len(a), *[1] * more, *a.shape[1:])
    elif more < 0:
        b = b.reshape(len(b), *[1] * -more, *b.shape[1:])
    return a, b


def _power(values: Array, exponent: float) -> Array:
    part = values[1:] / values[0]
    result = np.empty_like(values)
    result[0] = values[0] ** exponent
    result[1:] = exponent * part
    if len(values) > LINEAR:
        second = exponent * (exponent - 1) / 2
        result[3] += second * part[0] ** 2
        result[4] += 2 * second * part[0] * part[1]
        result[5] += second * part[1] ** 2
    result[1:] *= result[0]
    return result
