"""Ellipses of one constant perimeter: the liner's cross-sections as it flattens."""

import numpy as np

from grabberd_fake.optics import Array

# The trapezoidal rule over a period of a smooth function converges exponentially: exact to rounding.
_SAMPLES = 128
_ANGLES = np.arange(_SAMPLES) * (2 * np.pi / _SAMPLES)


def perimeter(p: Array, q: Array) -> Array:
    """(N,) perimeters of ellipses with semi-axes p, q (N,), exact to rounding."""
    around: Array = _speed(p, q).mean(axis=1) * (2 * np.pi)
    return around


def widened(p: Array) -> Array:
    """(N,) second semi-axis of ellipses of perimeter 2π with first semi-axis p (N,), 0.25 < p <= 1."""
    q = 2.0 - p  # first guess: near the circle the semi-axes' mean stays 1; Newton's method does the rest
    for _ in range(8):
        step = (perimeter(p, q) - 2 * np.pi) / _perimeter_by_q(p, q)
        q = q - step
        if np.abs(step).max() < 1e-13:
            break
    return q


def eccentric_angle(p: Array, q: Array, arc: Array) -> Array:
    """(N,) eccentric angle θ of the point (q sin θ, p cos θ) at arc length `arc` (N,) from θ = 0.

    The speed ds/dθ is a cosine series in 2θ, so the arc length is known term by term; Newton inverts it.
    """
    orders = np.arange(1, _SAMPLES // 4)
    speed = _speed(p, q)
    spectrum = np.fft.rfft(speed, axis=1).real / _SAMPLES
    mean, cosines = spectrum[:, 0], 2 * spectrum[:, 2 * orders]
    theta = arc / mean
    for _ in range(8):
        phase = 2 * np.multiply.outer(theta, orders)
        length = mean * theta + (cosines / (2 * orders) * np.sin(phase)).sum(axis=1)
        theta = theta - (length - arc) / np.hypot(q * np.cos(theta), p * np.sin(theta))
    return theta


def _speed(p: Array, q: Array) -> Array:
    speed: Array = np.hypot(np.multiply.outer(q, np.cos(_ANGLES)), np.multiply.outer(p, np.sin(_ANGLES)))
    return speed


def _perimeter_by_q(p: Array, q: Array) -> Array:
    rate = np.multiply.outer(q, np.cos(_ANGLES) ** 2) / _speed(p, q)
    mean: Array = rate.mean(axis=1) * (2 * np.pi)
    return mean
