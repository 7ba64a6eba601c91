"""Truth of the liner: places, strain, contact pressure, load and vacuum at a time."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.liner import in_object_frame, movement, patch_places
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.optics import Array
from grabberd_fake.options import FakeOptions
from grabberd_fake.wall_quantities import TeatLoad, teat_load
from grabberd_fake.wall_states import Patch, unit_normals, wall_states


class WallPlaces(NamedTuple):
    """A grid of material places on the liner.

    Attributes:
        x_mm: (R,) along the mounted liner from half way, away from the mouthpiece: up to ±65 mm.
        theta: (C,) angles round the mounted liner from the line that faces the cameras, towards Y: up to ±π.
    """

    x_mm: Array
    theta: Array


class LinerTruth(NamedTuple):
    """Truth at N material places, row by row, and of the whole liner.

    Vectors are in the object's frame. Tensors are in orthonormal bases of the face: 0 along the tube, 1
    perpendicular to it, towards increasing angle.

    Attributes:
        ids: (N,) int32, from 1; those of the targets if no other places were asked for.
        x_mm: (N,) and `theta`: (N,) the places, as in `WallPlaces`.
        target_mm: (N, 3) centres of targets that stand there; `face_mm`: (N, 3) places of the outer face.
        normal: (N, 3) outward; `basis`: (N, 2, 3) the present basis.
        strain: (N, 2, 2) Green-Lagrange strain of the outer face since the reference, in the basis of then.
        contact_kpa: (N,) contact pressure on the inner face behind the places.
        load_x_mm: (K,) X of the middles of elements of the liner's length; `load_n_per_mm`: (K,) load over
            each on the side that faces the cameras, of teat and opposite wall; `load_n`: all of it.
        teat: load on the teat alone; None for an empty liner.
        difference_kpa: pressure difference of the gases, outside over inside.
        rest_kpa: pressure difference at which the wall would rest where it is; less or more while it is late.
        pulsation_kpa: vacuum in the pulsation chamber; `liner_kpa`: in the liner.
    """

    ids: NDArray[np.int32]
    x_mm: Array
    theta: Array
    target_mm: Array
    face_mm: Array
    normal: Array
    basis: Array
    strain: Array
    contact_kpa: Array
    load_x_mm: Array
    load_n_per_mm: Array
    load_n: float
    teat: TeatLoad | None
    difference_kpa: float
    rest_kpa: float
    pulsation_kpa: float
    liner_kpa: float


def truth_of_liner(
    options: FakeOptions | Mapping[str, Any],
    time_ns: int,
    places: WallPlaces | None = None,
    reference_ns: int | None = None,
) -> LinerTruth:
    """Truth of the liner at a time.

    Args:
        options: options of `FakeGrabber`; the scene has to be `liner`.
        time_ns: time of a field, or any other time on the same clock.
        places: where on the wall; by default under the targets.
        reference_ns: time of the strain's reference; by default the mounted liner, without a pressure
            difference.

    Raises:
        ValueError: the options are invalid, or the scene is another one.
    """
    options = options if isinstance(options, FakeOptions) else FakeOptions.read(options)
    if options.scene != "liner":
        raise ValueError(f"scene: {options.scene!r} is not the solved wall 'liner'")
    liner = options.liner
    moves = movement(liner)
    reference_kpa = 0.0 if reference_ns is None else moves.rest_kpa(reference_ns)
    difference_kpa = moves.difference_kpa(time_ns)
    places = places or WallPlaces(*patch_places(liner))
    return _truth(liner, places, difference_kpa, moves.rest_kpa(time_ns), reference_kpa)


def _truth(
    options: LinerOptions, places: WallPlaces, difference_kpa: float, rest_kpa: float, reference_kpa: float
) -> LinerTruth:
    states = wall_states(options.wall)
    patch = _patch(options.wall, tuple(places.x_mm.tolist()), tuple(places.theta.tolist()))
    face, along, around = patch.frames(states.outer_mm(rest_kpa)).reshape(3, -1, 3)
    normal = unit_normals(along, around)
    borders_mm, force = states.borders_mm(rest_kpa), states.force_n_per_mm(rest_kpa)
    x_mm, theta = np.broadcast_arrays(places.x_mm[:, np.newaxis], places.theta)
    return LinerTruth(
        ids=np.arange(1, x_mm.size + 1, dtype=np.int32),
        x_mm=x_mm.ravel(),
        theta=theta.ravel(),
        target_mm=in_object_frame(options, face + normal * options.target_thickness_mm),
        face_mm=in_object_frame(options, face),
        normal=normal,
        basis=_basis(along, around),
        strain=_strain((along, around), patch.frames(states.outer_mm(reference_kpa)).reshape(3, -1, 3)[1:]),
        contact_kpa=patch.values(states.contact_kpa(rest_kpa)).ravel(),
        load_x_mm=(borders_mm[1:] + borders_mm[:-1]) / 2 - options.patch_x_mm,
        load_n_per_mm=force,
        load_n=float(force @ np.diff(borders_mm)),
        teat=None if states.about["teat"] is None else teat_load(states, rest_kpa),
        difference_kpa=difference_kpa,
        rest_kpa=rest_kpa,
        pulsation_kpa=options.wave.liner_kpa - difference_kpa,
        liner_kpa=options.wave.liner_kpa,
    )


@lru_cache(maxsize=8)
def _patch(wall: str, x_mm: tuple[float, ...], theta: tuple[float, ...]) -> Patch:
    return Patch(wall_states(wall), np.array(x_mm), np.array(theta))


def _basis(along: Array, around: Array) -> Array:
    """(N, 2, 3) orthonormal: along the first tangent, and perpendicular to it in the face."""
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    second = around - (around * first).sum(axis=-1, keepdims=True) * first
    return np.stack([first, second / np.linalg.norm(second, axis=-1, keepdims=True)], axis=-2)


def _strain(present: tuple[Array, Array], reference: Array) -> Array:
    """(N, 2, 2) (FᵀF − 1)/2 of tangents (2, N, 3), in the reference's basis."""
    before = np.moveaxis(reference, 0, 1)  # (N, 2, 3), a tangent a row
    in_basis = before @ np.swapaxes(_basis(*reference), -1, -2)
    gradient = np.linalg.solve(in_basis, np.stack(present, axis=1))
    strain: Array = (gradient @ np.swapaxes(gradient, -1, -2) - np.eye(2)) / 2
    return strain
