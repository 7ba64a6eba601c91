"""Search for targets near their expected positions by the compiled kernel: numpy's sightings, many times
faster.

One call predicts the images, finds the nearest blobs, intersects the rays and keeps those that meet; a second
one checks that these agree with one another.
"""

import ctypes
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import LocalField, Rig
from grabberd.core.kernel import DONE, Kernel
from grabberd.core.reconstruction.correspondence.agreement import Agreement, Sighting
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, Expected
from grabberd.core.reconstruction.points import Miss, Points
from grabberd.core.reconstruction.view_blobs import ImageNoise, ViewBlobs
from grabberd.errors import MeasurementError

_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
# Two views of 18 parameters have no more independent errors.
_MOST_ERRORS = 36
Array = NDArray[np.float64]
Indices = NDArray[np.intp]
_NUMBERS = 36
"""Numbers per target: position, covariance, calibration covariance, image, residual, displacement,
variance, predicted images."""


class _LocalField(ctypes.Structure):
    _fields_ = (
        ("origin_px", _REAL * 2),
        ("step_px", _REAL),
        ("shift_px", _ADDRESS),
        ("sigma_px", _ADDRESS),
        ("rows", _WHOLE),
        ("columns", _WHOLE),
    )


class _Rig(ctypes.Structure):
    _fields_ = (
        ("rotation", _REAL * 18),
        ("rates", _REAL * 54),
        ("center_mm", _REAL * 6),
        ("f_mm", _REAL * 2),
        ("origin_px", _REAL * 4),
        ("pixel_mm", _REAL * 4),
        ("image", _REAL * 240),
        ("factor", _ADDRESS),
        ("errors", _WHOLE),
        ("local", _LocalField * 2),
    )


class World(ctypes.Structure):
    """Data that do not change from field to field; keeps alive the arrays that it points to."""

    _fields_ = (
        ("rig", _Rig),
        ("targets", _WHOLE),
        ("pairs", _WHOLE),
        ("nominal_mm", _ADDRESS),
        ("neighbours", _ADDRESS),
        ("apart_mm", _ADDRESS),
        ("gate", _REAL),
        ("stretch", _REAL),
        ("unmodelled_px", _REAL),
        ("noise_mm", _REAL),
        ("blob_jitter_px", _REAL),
        ("radius_lines", _REAL),
    )
    kept: list[Any]

    @classmethod
    def of(cls, rig: Rig, agreement: Agreement, noise: ImageNoise) -> Self:
        """Fill in what the kernel needs about a rig of two views, the object and the noise."""
        neighbours, apart_mm = agreement.pairs
        arrays = (agreement.model.xyz_mm, neighbours.astype(np.int64), apart_mm)
        kept = [np.ascontiguousarray(values) for values in arrays]
        world = cls(
            _Rig(),
            len(agreement.model),
            len(neighbours),
            *(values.ctypes.data for values in kept),
            agreement.settings.gate,
            agreement.settings.stretch,
            agreement.settings.unmodelled_px,
            agreement.field.noise_mm,
            noise.blob_jitter_px,
            noise.radius_lines,
        )
        world.kept = [*kept, *world._fill(rig)]
        return world

    def _fill(self, rig: Rig) -> list[NDArray[np.float64]]:
        for name in ("rotation", "center_mm", "f_mm", "origin_px", "pixel_mm", "image"):
            values = getattr(rig, name).ravel().tolist()
            setattr(self.rig, name, type(getattr(self.rig, name))(*values))
        self.rig.rates = (_REAL * 54)(*rig.rotation_rates.ravel().tolist())
        kept = []
        if rig.factor is not None:
            kept.append(np.ascontiguousarray(rig.factor))
            self.rig.factor, self.rig.errors = kept[-1].ctypes.data, rig.factor.shape[2]
        for index, one in enumerate(rig.local_fields):
            if one is not None:
                splines = [np.ascontiguousarray(values) for values in (one.shift_px, one.sigma_px)]
                kept += splines
                self.rig.local[index] = _local(one, *splines)
        return kept


def _local(field: LocalField, shift_px: Array, sigma_px: Array) -> _LocalField:
    return _LocalField(
        (_REAL * 2)(*field.origin_px),
        field.step_px,
        shift_px.ctypes.data,
        sigma_px.ctypes.data,
        *sigma_px.shape[:2],
    )


def takes(rig: Rig) -> bool:
    """True if the kernel covers this rig; its polynomials are those of the distortion."""
    return (
        len(rig.views) == 2
        and not rig.corrects.any()
        and (rig.factor is None or rig.factor.shape[2] <= _MOST_ERRORS)
    )


class Nearby:
    """Search for one object's targets near their expected positions, as seen by one rig."""

    def __init__(self, kernel: Kernel, rig: Rig, agreement: Agreement, noise: ImageNoise) -> None:
        self._kernel = kernel
        self._agreement = agreement
        self._world = World.of(rig, agreement, noise)

    def near(self, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs) -> Sighting:
        """Search as `Correspondence.near`.

        Raises:
            MeasurementError: There is not enough memory.
        """
        return self._agreeing(*self._met(places_mm, sigma_mm, left, right))

    def meeting(
        self, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs
    ) -> tuple[Indices, Array]:
        """Find as `Correspondence.meeting`.

        Raises:
            MeasurementError: There is not enough memory.
        """
        found, _ = self._met(places_mm, sigma_mm, left, right)
        return found.target, found.xyz_mm

    def _met(
        self, places_mm: Array, sigma_mm: Array, left: ViewBlobs, right: ViewBlobs
    ) -> tuple["_Found", float]:
        """Targets whose blobs' rays meet, and the surprise."""
        room = len(self._agreement.model)
        index, number = np.empty((4, room), np.int64), np.empty(_NUMBERS * room)
        status, count, surprise = self._kernel.near(
            self._world,
            np.ascontiguousarray(places_mm),
            np.ascontiguousarray(sigma_mm),
            *buffers(left),
            *buffers(right),
            left.common_reach_px,
            index,
            number,
        )
        if status != DONE:
            raise MeasurementError(
                f"not enough memory for {len(left)} and {len(right)} blobs and {room} targets",
                "free some memory, or add more",
            )
        return _Found.of(index, number, count, room), surprise

    def _agreeing(self, found: "_Found", surprise: float) -> Sighting:
        """Drop targets that the others contradict, the worst first (as `Agreement.consistent`)."""
        model, all_stay = self._agreement.model, True
        count = len(model)
        expected, settled = np.empty((count, 3)), np.empty(10 * count)
        while True:
            weights, sigma_mm = self._say(found, expected)
            worst = self._kernel.agree(self._world, weights, sigma_mm, *found.agreeing(), expected, settled)
            if worst < 0:
                break
            found.misses[found.target[worst]] = Miss.OFF_PLACE
            found, all_stay = found.without(worst), False
        settled_mm = settled[: 3 * count].reshape(count, 3), settled[9 * count :]
        return Sighting(
            found.points(model.target),
            found.target,
            found.left,
            found.right,
            Expected(expected, sigma_mm),
            settled_mm,
            surprise if all_stay else None,
            found.misses,
            found.predicted_px,
        )

    def _say(self, found: "_Found", expected: Array) -> tuple[Array | bytes, Array]:
        """Weights of the targets found; empty if a field by parts has already computed the expectation."""
        field = self._agreement.field
        if isinstance(field, DisplacementField):
            say = field.say(found.target)
            return say.weights.T, say.sigma_mm
        expected[:], sigma_mm = field.expect(found.target, found.displacement_mm)
        return b"", sigma_mm


class _Found(NamedTuple):
    """K targets, before they agree; and of all M of the model, their misses and predicted images."""

    target: Indices
    left: Indices
    right: Indices
    xyz_mm: Array
    covariance_mm2: Array
    calibration_covariance_mm2: Array
    image_px: Array
    residual_px: Array
    displacement_mm: Array
    variance_mm2: Array
    misses: Indices
    predicted_px: Array

    @classmethod
    def of(cls, index: Indices, number: Array, count: int, room: int) -> "_Found":
        target, left, right = index[:3, :count]
        return cls(
            target,
            left,
            right,
            number[: 3 * count].reshape(count, 3),
            number[3 * room :][: 9 * count].reshape(count, 3, 3),
            number[12 * room :][: 9 * count].reshape(count, 3, 3),
            number[21 * room :][: 4 * count].reshape(count, 2, 2),
            number[25 * room :][:count],
            number[26 * room :][: 3 * count].reshape(count, 3),
            number[29 * room :][: 3 * count].reshape(count, 3),
            index[3],
            number[32 * room :].reshape(2, room, 2),
        )

    def agreeing(self) -> tuple[Indices, Array, Array, Array]:
        return self.target, self.displacement_mm, self.variance_mm2, self.covariance_mm2

    def without(self, worst: int) -> "_Found":
        fewer: Any = [np.delete(one, worst, axis=0) for one in self[:-2]]
        return _Found._make([*fewer, self.misses, self.predicted_px])

    def points(self, ids: NDArray[np.int32]) -> Points:
        return Points(ids[self.target], *self[3:8])


def buffers(blobs: ViewBlobs) -> tuple[Array, Array, Array | bytes]:
    """Positions, σ and the common error of blobs as the kernel reads them; empty if they carry none."""
    common = b"" if blobs.common_px is None else np.ascontiguousarray(blobs.common_px)
    return np.ascontiguousarray(blobs.xy_px), np.ascontiguousarray(blobs.sigma_px), common
