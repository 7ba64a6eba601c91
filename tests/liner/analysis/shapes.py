"""Analytic surfaces as jets, and what can be done to them: the specification's own mathematics."""

from math import comb, factorial

import numpy as np

from grabberd_liner.analysis.surface.jets import ORDERS, index


def sine(angle, radius, order):
    """Derivatives of sin(x / radius)."""
    return np.sin(angle + order * np.pi / 2) / radius**order


def cosine(angle, radius, order):
    return sine(angle + np.pi / 2, radius, order)


def _jets(count, entry):
    jets = np.zeros((count, 15, 3))
    for at, (i, j) in enumerate(ORDERS):
        jets[:, at] = np.stack(np.broadcast_arrays(*entry(i, j)), axis=-1)
    return jets


def _power(value, order):
    """Derivatives of x ↦ x."""
    return value if order == 0 else (np.ones_like(value) if order == 1 else np.zeros_like(value))


def cylinder(radius, u, v, along=1.0, around=1.0):
    """A tube along x through (0, 0); u stretched by `along`, v (arc length from the top) by `around`."""
    u, v = np.broadcast_arrays(np.asarray(u, float), v)
    nothing, bent = np.zeros_like(u), radius / around

    def entry(i, j):
        if i:
            return (along if (i, j) == (1, 0) else 0.0, nothing, nothing)
        angle = v / bent
        return (
            along * u if j == 0 else nothing,
            radius * sine(angle, bent, j),
            radius * cosine(angle, bent, j),
        )

    return _jets(len(u), entry)


def sheet(u, v, along=1.0, around=1.0):
    """A plane, z = 0, stretched by so much."""
    nothing = np.zeros_like(u)
    return _jets(
        len(u),
        lambda i, j: (
            along * _power(u, i) if j == 0 else nothing,
            around * _power(v, j) if i == 0 else nothing,
            nothing,
        ),
    )


def torus(radius, tube, u, v, stretch=1.0):
    """A ring of tubes: u round the tube, v round the ring, outward normals out of the tube."""
    bent, turned = tube / stretch, radius / stretch
    a, b = u / bent, v / turned

    def entry(i, j):
        ring = (radius if i == 0 else 0.0) + tube * cosine(a, bent, i)
        return (
            -tube * sine(a, bent, i) if j == 0 else 0.0 * a,
            ring * sine(b, turned, j),
            ring * cosine(b, turned, j),
        )

    return _mirrored(_jets(len(u), entry))


def _mirrored(jets):
    """x turned round, so that X_u × X_v points outward."""
    return jets * np.array([-1.0, 1.0, 1.0])


def sphere(radius, u, v, stretch=1.0):
    """u along meridians from the equator, v along the equator, both lengths on the unstretched sphere."""
    bent = radius / stretch
    a, b = u / bent, v / bent

    def entry(i, j):
        return (
            radius * sine(a, bent, i) if j == 0 else 0.0 * a,
            radius * cosine(a, bent, i) * sine(b, bent, j),
            radius * cosine(a, bent, i) * cosine(b, bent, j),
        )

    return _jets(len(u), entry)


def moved(jets, rotation, shift):
    """The same surface somewhere else."""
    result = jets @ rotation.T
    result[..., 0, :] += shift
    return result


def renamed(jets, u_of, v_of):
    """The same surface in other coordinates: u and v as polynomials of the new ones, (5, 5) coefficients.

    Constants are not looked at: the new coordinates' origin is each place itself.
    """
    u_of, v_of = (np.where(np.add.outer(np.arange(5), np.arange(5)) > 4, 0.0, p) for p in (u_of, v_of))
    u_of[0, 0] = v_of[0, 0] = 0.0
    total = np.zeros((*jets.shape[:-2], 5, 5, 3))
    for i, j in ORDERS:
        term = _raised(u_of, i, _raised(v_of, j, np.eye(1, 25).reshape(5, 5)))
        coefficient = jets[..., index(i, j), :] / (factorial(i) * factorial(j))
        total += term[:, :, None] * coefficient[..., None, None, :]
    scale = [factorial(i) * factorial(j) for i, j in ORDERS]
    return np.stack([total[..., i, j, :] * s for (i, j), s in zip(ORDERS, scale, strict=True)], axis=-2)


def _raised(base, power, result):
    for _ in range(power):
        product = np.zeros((5, 5))
        for i, j in ORDERS:
            product[i:, j:] += base[i, j] * result[: 5 - i, : 5 - j]
        result = product
    return result


def curve(tangent, curvature, depth):
    """A tube's jets from its middle line in the section, v its arc length; the face lies `depth` outside.

    Args:
        tangent: (N, 2) unit tangents (y, z).
        curvature: (N, 4) the curvature, positive with the centre inside, and three derivatives by v.
        depth: of the middle line under the face.
    """
    outward = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    ahead, out = np.zeros((5, len(tangent))), np.zeros((5, len(tangent)))
    jets = np.zeros((len(tangent), 15, 3))
    jets[:, index(1, 0), 0] = 1.0
    ahead[0], ahead[1], ahead[2], ahead[3] = 1 + depth * curvature[:, 0], *(depth * curvature[:, 1:].T)
    for order in range(1, 5):
        jets[:, index(0, order), 1:] = ahead[0][:, None] * tangent + out[0][:, None] * outward
        ahead, out = _next(ahead, out, curvature)
    return jets


def _next(ahead, out, curvature):
    """d/ds of ahead · t + out · n, each with its derivatives by s: t' = −κ n, n' = κ t."""
    new_ahead, new_out = np.zeros_like(ahead), np.zeros_like(out)
    for order in range(4):
        new_ahead[order] = ahead[order + 1] + _leibniz(curvature, out, order)
        new_out[order] = out[order + 1] - _leibniz(curvature, ahead, order)
    return new_ahead, new_out


def _leibniz(curvature, other, order):
    return sum(comb(order, k) * curvature[:, k] * other[order - k] for k in range(min(order, 3) + 1))
