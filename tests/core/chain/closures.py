"""Liners that close within one to eight fields, by a prescribed law of time: rendered, measured, and judged.

The shapes are the simulator's: the prescribed ellipse, and walls solved in equilibrium. How far they have
closed is prescribed here, so that the time and stroke of a closure are known, and so that neither tracker nor
smoother knows the law.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np
from tests.core.chain.averaging import NOMINAL
from tests.core.chain.fake_scene import take_scene

from grabberd.bounded_documents import parse_yaml
from grabberd.core.chain.accuracy import Investigation, InvestigationSettings, investigate, requantised
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.measure import MeasuredField, MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, quantise
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.accuracy import Truth
from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import calibration_document, object_document
from grabberd_fake.liner import EllipseLiner, Liner, _travel
from grabberd_fake.wall_states import wall_states
from grabberd_fake.world import World

FIELD_NS = 20_000_000
PERIODS = 2.5
SHAPES = ("ellipse", "reference-round", "thin-blunt", "stiffening-pointed", "wide-empty", "tapered-round")
"""Shapes by seed, in turn: the ellipse, and solved walls."""
LAWS = {
    "half cosine": lambda part: 0.5 - 0.5 * np.cos(np.pi * part),
    "smoothstep": lambda part: part * part * (3.0 - 2.0 * part),
    "uniform": lambda part: part,
    "snap": lambda part: part * part,
}
"""How far a closure has come after part of its time; the last two stop at once, as on a teat."""


@dataclass(frozen=True)
class Closure:
    """A pulsation: how fast it closes, how far, and what else differs from seed to seed.

    Behind mirrors uneven by so many px (rms), the rig is calibrated; otherwise its calibration is exact. One
    reflection a view makes its cameras left-handed.
    """

    seconds: float
    stroke_mm: float
    seed: int
    exposure_ms: float = 1.0
    uneven_px: float = 0.0
    reflections: int = 2

    @property
    def shape(self) -> str:
        return SHAPES[self.seed % len(SHAPES)]

    @property
    def law(self) -> str:
        return list(LAWS)[self.seed % len(LAWS)]

    @property
    def options(self) -> FakeOptions:
        """The camera, its noise, and the rig; the liner is open where its object model says."""
        options = {
            "seed": self.seed,
            "rig": {
                "seed": self.seed + 1,
                "mirror_error_px": self.uneven_px,
                "reflections": self.reflections,
            },
            "picture": {"exposure_ms": self.exposure_ms},
        }
        if self.shape == "ellipse":
            return FakeOptions.read(options | {"scene": "ellipse", "ellipse": {"radius_mm": 14.4}})
        return FakeOptions.read(options | {"scene": "liner", "liner": {"wall": self.shape}})


class ClosingScene:
    """A scene of the simulator that closes by a `Closure`."""

    moves = True

    def __init__(self, closure: Closure) -> None:
        self._closure = closure
        self._shape = _Ellipse(closure) if closure.shape == "ellipse" else _Wall(closure)
        rng = np.random.default_rng((closure.seed, 77))
        self._period_s = rng.uniform(0.9, 1.05)
        self._start_s, self._open_s = rng.uniform(0.15, 0.35), rng.uniform(0.6, 0.75)
        self._opening_s = closure.seconds * rng.uniform(1.0, 2.0)

    def __getattr__(self, name):
        return getattr(self._shape.liner, name)

    def targets(self, time_ns):
        return self._shape.targets(self.share(time_ns))

    def nominal(self):
        return self._shape.targets(0.0)

    @property
    def period_s(self):
        """Length of the cycle."""
        return self._period_s

    @property
    def closed_s(self):
        """A time within its first cycle at which it is closed and at rest."""
        return (self._start_s + self._closure.seconds + self._open_s) / 2

    def share(self, time_ns):
        """How far it has closed, 0 to 1."""
        after_s = (time_ns / 1e9) % self._period_s
        closing = np.clip((after_s - self._start_s) / self._closure.seconds, 0.0, 1.0)
        opening = np.clip((after_s - self._open_s) / self._opening_s, 0.0, 1.0)
        law = LAWS[self._closure.law]
        return float(law(closing) - law(opening))


class _Ellipse:
    def __init__(self, closure):
        self.liner = EllipseLiner(replace(closure.options.ellipse, deflection_mm=closure.stroke_mm))

    def targets(self, share):
        wall = self.liner._wall(share)
        return type(self.liner.nominal())(wall.xyz_mm + wall.normal * 1.25, wall.normal)


class _Wall:
    def __init__(self, closure):
        self.liner = Liner(closure.options.liner)
        self._kpa, travel_mm = _travels(closure.shape)
        self._travel_mm = travel_mm - np.interp(0.0, self._kpa, travel_mm)
        self._stroke_mm = closure.stroke_mm

    def targets(self, share):
        return self.liner._at(float(np.interp(share * self._stroke_mm, self._travel_mm, self._kpa)))


@lru_cache
def _travels(name):
    return _travel(wall_states(name))


class Film:
    """The grey fields of a closure, and what is true in them."""

    def __init__(self, closure: Closure, periods: float = PERIODS) -> None:
        world = World(closure.options)
        world.scene = self._scene = ClosingScene(closure)
        count = round(periods / 0.02)
        self.fields = [_grey(world, n) for n in range(count)]
        self._truths = [world.truth(n * FIELD_NS) for n in range(count)]
        known = closure.options
        document = parse_yaml(object_document(known), fast=True)
        if closure.shape == "ellipse":
            document = _with_places(document, self._scene.nominal().xyz_mm)
        if closure.uneven_px:
            calibration = _calibrated(closure.seed, closure.uneven_px)
        else:
            calibration = Calibration.from_document(calibration_document(known))
        self.setup = MeasureSetup(calibration, ObjectModel.from_document(document))
        self._rng = np.random.default_rng((closure.seed, 78))

    def kept(self, lost: float) -> list[NumberedField]:
        """The fields without some that are lost at random."""
        return [one for one in self.fields if self._rng.random() >= lost]

    def measured(self, bits: int, fields: Iterable[NumberedField]) -> Iterator[MeasuredField]:
        """Measure with 1 bit and doubled lines, or with 8 bits."""
        return measure_fields(requantised(fields, bits, doubled=bits == 1), self.setup)

    def investigated(self, bits: int, lost: float = 0.0) -> Investigation:
        """Measure, and compare with the truth."""
        fields = self.kept(lost)
        points = ((one.n, one.time_ns, one.points) for one in self.measured(bits, fields))
        return investigate(points, self._truth(fields), InvestigationSettings(bits=bits))

    def wall_phases_s(self, target: np.ndarray) -> np.ndarray:
        """(4,) true durations of a, b, c, d by the movement of some targets, given by their ids."""
        time_s = np.linspace(0.0, self._scene.period_s, 4001)
        chosen = np.isin(self._truths[0].ids, target)
        at_ns = 1e9 * (self._scene.closed_s + time_s)
        return wall_phases_of(time_s, np.stack([self._scene.targets(t).xyz_mm[chosen] for t in at_ns]))

    def _truth(self, fields):
        truths = [self._truths[one.n] for one in fields]
        return Truth(
            n=np.repeat([one.n for one in fields], len(truths[0].ids)).astype(np.int64),
            target=np.concatenate([truth.ids for truth in truths]),
            xyz_mm=np.concatenate([truth.xyz_mm for truth in truths]),
            expected=np.concatenate([truth.visible_left & truth.visible_right for truth in truths]),
        )


def wall_phases_of(time_s: np.ndarray, places_mm: np.ndarray) -> np.ndarray:
    """Durations of the wall phases a, b, c, d by their definition: from 10 to 90 % of the stroke.

    Args:
        time_s: (T,) over one cycle that begins with the wall closed; the last time is the first once more.
        places_mm: (T, N, 3) of the targets.
    """
    moved = places_mm.reshape(len(time_s), -1)
    moved = moved - moved.mean(axis=0)
    amount = moved @ np.linalg.svd(moved, full_matrices=False)[2][0]
    share = (amount - amount[0]) / (amount[np.abs(amount - amount[0]).argmax()] - amount[0])
    turns = [np.flatnonzero(np.diff((share > level).astype(int))) for level in (0.1, 0.9)]
    (a, d), (b, c) = (time_s[one] for one in turns)
    return np.array([b - a, c - b, d - c, time_s[-1] - (d - a)])


@cache
def _calibrated(seed, uneven_px, fields=64):
    """Calibrate the rig of a closure from pictures of the calibration frame behind the same mirrors."""
    rig = Closure(0.0, 0.0, seed, uneven_px=uneven_px).options.rig
    frame = take_scene(
        fields,
        scene="calibration_frame",
        seed=seed + 5000,
        rig={"seed": rig.seed, "mirror_error_px": rig.mirror_error_px},
    )
    made = calibrate([frame.packed(8, "field")], NOMINAL, frame.setup.object_model)
    return made.calibration("closures", "2026-01-01T00:00:00+00:00", "closures", None, {})


def _grey(world, n):
    luma = np.empty((288, 720), np.uint8)
    world.picture(n, luma)
    return NumberedField(n, n * FIELD_NS, n, quantise(Field.intact(luma, n % 2), 8, 76))


def _with_places(document, places_mm):
    for one, (x, y, z) in zip(document["targets"], places_mm.tolist(), strict=True):
        one.update(x_mm=x, y_mm=y, z_mm=z)
    return document
