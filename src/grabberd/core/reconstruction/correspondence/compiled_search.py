"""Search for targets near their expected positions by the compiled kernel: numpy's sightings, many times
faster.

One call predicts the images, finds the nearest blobs, intersects the rays and keeps those that meet; a second
one checks that these agree with one another.

Identification by the compiled kernel: numpy's hypotheses and their largest agreement, many times faster.

The kernel does not invert a matrix for every set of targets seen, but adds targets to the displacement field
and takes them away, one by one; it keeps the predictors that it has made in memory of ours.
"""

import ctypes
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices
from grabberd.core.geometry import LocalField, Rig
from grabberd.core.kernel import DONE, MORE_ROOM, Kernel
from grabberd.core.reconstruction.correspondence.agreement import Agreement, Hypotheses, Sighting, line_mm
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, Expected
from grabberd.core.reconstruction.correspondence.facing import Facing
from grabberd.core.reconstruction.points import ImageNoise, Miss, Points, ViewBlobs
from grabberd.errors import MeasurementError

_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
# Two views of 18 parameters have no more independent errors.
_MOST_ERRORS = 36
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
        ("correlation", _REAL * 2),
    )


class _Wall(ctypes.Structure):
    _fields_ = (
        ("slope_of", _ADDRESS),
        ("slope_weight", _ADDRESS),
        ("side", _REAL),
        ("half_pitch_px", _REAL),
        ("lines", _WHOLE),
        ("line_begin", _ADDRESS),
        ("line", _ADDRESS),
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
        ("wall", _Wall),
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
        world.kept = [
            *kept,
            *world._fill(rig),
            *world._build(Facing(rig, agreement.model, noise.radius_lines)),
        ]
        return world

    def _build(self, facing: Facing) -> list[NDArray[Any]]:
        ends = np.cumsum([0, *(len(line) for line in facing.lines)])
        kept: list[NDArray[Any]] = [
            np.ascontiguousarray([slope.target for slope in facing.slopes], np.int64),
            np.ascontiguousarray([slope.weight for slope in facing.slopes], np.float64),
            np.ascontiguousarray(ends, np.int64),
            np.concatenate([np.zeros(0, np.int64), *facing.lines]),
        ]
        of, weight, begin, line = (values.ctypes.data for values in kept)
        self.wall = _Wall(of, weight, facing.side, facing.half_pitch_px, len(facing.lines), begin, line)
        return kept

    def _fill(self, rig: Rig) -> list[Array]:
        for name in ("rotation", "center_mm", "f_mm", "origin_px", "pixel_mm", "image"):
            values = getattr(rig, name).ravel().tolist()
            setattr(self.rig, name, type(getattr(self.rig, name))(*values))
        self.rig.rates = (_REAL * 54)(*rig.rotation_rates.ravel().tolist())
        self.rig.correlation = (_REAL * 2)(*rig.local_correlation)
        kept = []
        if rig.factor is not None:
            kept.append(np.ascontiguousarray(rig.factor))
            self.rig.factor, self.rig.errors = kept[-1].ctypes.data, rig.factor.shape[2]
        for index, one in enumerate(rig.local_fields[:2]):
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


MOST_PREDICTORS = 32
MOST_BYTES = 16 << 20
"""Size of the predictors kept at most; at least two are, whatever their size."""


class Predictors(ctypes.Structure):
    """Predictors of one displacement field; keeps alive the arrays that it points to.

    From field to field mostly the same targets are seen, so that few have to be made.
    """

    _fields_ = (
        ("targets", _WHOLE),
        ("noise_mm2", _REAL),
        ("covariance_mm2", _ADDRESS),
        ("precision", _ADDRESS),
        ("room", _WHOLE),
        ("next", _WHOLE),
        ("count", _ADDRESS),
        ("seen", _ADDRESS),
        ("weights", _ADDRESS),
        ("sigma_mm", _ADDRESS),
    )
    kept: list[Any]

    @classmethod
    def of(cls, field: DisplacementField) -> Self:
        """Make room for some; none has been made yet."""
        targets = len(field.precision)
        room = min(max(MOST_BYTES // (8 * targets * targets), 2), MOST_PREDICTORS)
        made = [
            np.full(room, -1, np.int64),
            np.empty((room, targets), np.int64),
            np.empty((room, targets, targets)),
            np.empty((room, targets)),
        ]
        given = [np.ascontiguousarray(one) for one in (field.covariance_mm2, field.precision)]
        own = cls(
            targets,
            field.noise_mm**2,
            *(one.ctypes.data for one in given),
            room,
            0,
            *(one.ctypes.data for one in made),
        )
        own.kept = [*given, *made]
        return own


_ROOM = 2048
"""Number of hypotheses that most fields have room in."""


class Identifying(ctypes.Structure):
    """Inputs of identification by the kernel alone; keeps alive what it points to."""

    _fields_ = (
        ("world", _ADDRESS),
        ("predictors", _ADDRESS),
        ("trust", _REAL),
        ("margin", _REAL),
        ("pitch_mm", _REAL),
        ("covariance_mm2", _ADDRESS),
        ("gate_mm", _REAL),
        ("farthest_mm", _REAL),
    )
    kept: "tuple[Identification, Predictors]"


class Identification:
    """Identification of one object of few enough targets for a `DisplacementField`, as seen by one rig."""

    def __init__(self, kernel: Kernel, rig: Rig, agreement: Agreement, noise: ImageNoise) -> None:
        if not isinstance(agreement.field, DisplacementField):
            raise TypeError("the kernel does not identify by parts")
        self._kernel = kernel
        self._agreement = agreement
        self._world = World.of(rig, agreement, noise)
        self._gate_mm = agreement.settings.gate * line_mm(agreement.model, noise)
        self._displacements = agreement.field
        self._covariance_mm2 = np.ascontiguousarray(agreement.field.covariance_mm2)

    def in_c(self) -> "Identifying":
        """All of it, for the kernel's own use by one thread at a time: it writes into the predictors."""
        predictors = Predictors.of(self._displacements)
        settings = self._agreement.settings
        own = Identifying(
            ctypes.addressof(self._world),
            ctypes.addressof(predictors),
            settings.trust,
            settings.margin,
            self._agreement.pitch_mm,
            self._covariance_mm2.ctypes.data,
            self._gate_mm,
            settings.farthest_mm,
        )
        own.kept = self, predictors
        return own

    def expected(self, left: ViewBlobs, right: ViewBlobs) -> Expected | None:
        """Predict as `Correspondence.expected`.

        Raises:
            MeasurementError: There is not enough memory.
        """
        known = self.hypotheses(left, right)
        chosen, expected = self.largest(known, len(left), len(right))
        return expected if len(chosen) else None

    def hypotheses(self, left: ViewBlobs, right: ViewBlobs) -> Hypotheses:
        """List as `hypotheses.hypotheses`.

        Raises:
            MeasurementError: There is not enough memory.
        """
        room, status, count = _ROOM, MORE_ROOM, 0
        while status == MORE_ROOM:
            index, number = np.empty((3, room), np.int64), np.empty(6 * room)
            status, count = self._kernel.hypotheses(
                self._world,
                *buffers(left),
                *buffers(right),
                left.common_reach_px,
                self._gate_mm,
                self._agreement.settings.farthest_mm,
                index,
                number,
            )
            room, had = max(room, count), room
        _check(status, f"{len(left)} and {len(right)} blobs")
        target, of_left, of_right = index[:, :count]
        apart_mm, variance_mm2 = number.reshape(2, had, 3)[:, :count]
        return Hypotheses(target, of_left, of_right, apart_mm, variance_mm2)

    def largest(self, known: Hypotheses, left: int, right: int) -> tuple[Indices, Expected]:
        """Find as `Agreement.largest`, and what the set found says of all targets.

        Args:
            known: Hypotheses.
            left: Number of blobs in the left view.
            right: Number of blobs in the right view.

        Raises:
            MeasurementError: There is not enough memory.
        """
        targets, settings = len(self._agreement.model), self._agreement.settings
        chosen, expected_mm = np.empty(targets, np.int64), np.zeros((targets, 3))
        sigma_mm = np.zeros(targets)
        status, count = self._kernel.largest(
            self._world,
            self._covariance_mm2,
            settings.trust,
            settings.margin,
            self._agreement.pitch_mm,
            known.target,
            known.left,
            known.right,
            known.displacement_mm,
            known.variance_mm2,
            left,
            right,
            chosen,
            expected_mm,
            sigma_mm,
        )
        _check(status, f"{len(known)} hypotheses")
        return chosen[:count], Expected(expected_mm, sigma_mm)


def _check(status: int, of_what: str) -> None:
    if status != DONE:
        raise MeasurementError(f"not enough memory for {of_what}", "free some memory, or add more")
