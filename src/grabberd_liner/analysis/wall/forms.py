"""Fundamental forms of the wall's outer face and of its middle surface, from jets.

Tensors are given by their components in the material coordinates (u, v), as (..., 2, 2); lengths in mm. The
normal points outward, out of the liner, and a curvature is positive if its centre lies inside: a cylinder
of outer radius R has 1/R on its outer face and 1/(R − h) at the depth h.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis.surface.jets import Jets, index

Array = NDArray[np.float64]


class Forms(NamedTuple):
    """First and second fundamental form of a surface at some places.

    Attributes:
        tangents: (..., 2, 3) ∂X/∂u and ∂X/∂v, in the object's frame.
        normal: (..., 3) unit normal, outward, in the object's frame.
        first: (..., 2, 2) covariant components.
        second_per_mm: (..., 2, 2) covariant components, 1/mm.
    """

    tangents: Array
    normal: Array
    first: Array
    second_per_mm: Array


class Principal(NamedTuple):
    """Principal values and directions of a symmetric tensor of a surface.

    Attributes:
        values: (..., 2) the greater one first, in the tensor's unit.
        directions: (..., 2, 3) unit vectors in the object's frame; where both values are equal, any pair.
    """

    values: Array
    directions: Array


def outer_forms(jets: Jets, outward: float = 1.0) -> Forms:
    """The forms of the face that the jets belong to.

    Args:
        jets: (..., 15, 3).
        outward: 1.0 where X_u × X_v points outward, −1.0 where inward (`Grid.outward`).
    """
    tangents = jets[..., [index(1, 0), index(0, 1)], :]
    normal = outward * np.cross(tangents[..., 0, :], tangents[..., 1, :])
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    seconds = jets[..., [index(2, 0), index(1, 1), index(1, 1), index(0, 2)], :]
    second = -(seconds @ normal[..., None])[..., 0]
    first = tangents @ np.swapaxes(tangents, -1, -2)
    return Forms(tangents, normal, first, second.reshape(first.shape))


def middle_forms(jets: Jets, depth_mm: float | Array, outward: float = 1.0) -> Forms:
    """The forms of the parallel surface at a depth below the face: I − 2h II + h² III and II − h III.

    Exact: a parallel surface shares the face's normals, so nothing has to be fitted again.

    Args:
        jets: (..., 15, 3) of the outer (target) face.
        depth_mm: (...) from the face inward; half the wall and the target's thickness for the middle surface.
        outward: as in `outer_forms`.
    """
    outer = outer_forms(jets, outward)
    depth = np.asarray(depth_mm, np.float64)[..., None, None]
    curvature = mixed(outer.first, outer.second_per_mm)
    third = outer.second_per_mm @ curvature
    return Forms(
        tangents=outer.tangents - depth * np.swapaxes(curvature, -1, -2) @ outer.tangents,
        normal=outer.normal,
        first=outer.first - 2 * depth * outer.second_per_mm + depth**2 * third,
        second_per_mm=outer.second_per_mm - depth * third,
    )


def inverse(tensor: Array) -> Array:
    """The inverses of 2 × 2 matrices (..., 2, 2)."""
    a, b, c, d = (tensor[..., i, j] for i in (0, 1) for j in (0, 1))
    adjugate = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)], axis=-2)
    result: Array = adjugate / determinant(tensor)[..., None, None]
    return result


def determinant(tensor: Array) -> Array:
    """(...) the determinants of 2 × 2 matrices (..., 2, 2)."""
    result: Array = tensor[..., 0, 0] * tensor[..., 1, 1] - tensor[..., 0, 1] * tensor[..., 1, 0]
    return result


def trace(tensor: Array) -> Array:
    """(...) the traces of 2 × 2 matrices (..., 2, 2)."""
    result: Array = tensor[..., 0, 0] + tensor[..., 1, 1]
    return result


def mixed(first: Array, covariant: Array) -> Array:
    """(..., 2, 2) the mixed components g^αγ B_γβ of a tensor."""
    result: Array = inverse(first) @ covariant
    return result


def principal(forms: Forms, mixed_components: Array) -> Principal:
    """Principal values and directions of a symmetric tensor given by its mixed components (..., 2, 2)."""
    along = forms.tangents[..., 0, :] / np.sqrt(forms.first[..., 0, 0])[..., None]
    frame = np.stack([along, np.cross(forms.normal, along)], axis=-2)
    to_frame = forms.tangents @ np.swapaxes(frame, -1, -2)
    tensor = inverse(to_frame) @ np.swapaxes(mixed_components, -1, -2) @ to_frame
    values, angle = symmetric_eigen(tensor)
    cosine, sine = np.cos(angle), np.sin(angle)
    rotation = np.stack([np.stack([cosine, sine], axis=-1), np.stack([-sine, cosine], axis=-1)], axis=-2)
    return Principal(values, rotation @ frame)


def principal_values(mixed_components: Array) -> Array:
    """(..., 2) the principal values alone, the greater first: many times faster than with directions."""
    middle = trace(mixed_components) / 2
    half = (mixed_components[..., 0, 0] - mixed_components[..., 1, 1]) / 2
    square = half**2 + mixed_components[..., 0, 1] * mixed_components[..., 1, 0]
    radius = np.sqrt(np.maximum(square, 0.0))
    return np.stack([middle + radius, middle - radius], axis=-1)


def symmetric_eigen(tensor: Array) -> tuple[Array, Array]:
    """Eigenvalues (..., 2) of symmetric 2 × 2 matrices, the greater first, and the angle of its axis."""
    middle = trace(tensor) / 2
    half = (tensor[..., 0, 0] - tensor[..., 1, 1]) / 2
    off = (tensor[..., 0, 1] + tensor[..., 1, 0]) / 2
    radius = np.hypot(half, off)
    return np.stack([middle + radius, middle - radius], axis=-1), np.arctan2(off, half) / 2


def curvature_per_m(forms: Forms) -> Principal:
    """Principal curvatures κ1 ≥ κ2 in 1/m, positive with the centre inside, and their directions."""
    return principal(forms, 1e3 * mixed(forms.first, forms.second_per_mm))
