"""Liners that close within one to eight fields, by a prescribed law of time: rendered, measured, and judged.

The shapes are the simulator's: the prescribed ellipse, and walls solved in equilibrium. How far they have
closed is prescribed here, so that the time and stroke of a closure are known, and so that neither tracker nor
smoother knows the law.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import yaml

from grabberd.field import Field, NumberedField, quantise
from grabberd.geometry import Calibration
from grabberd.processes.accuracy import Investigation, InvestigationSettings, investigate, requantised
from grabberd.processes.measure import MeasureSetup, measure_fields
from grabberd.reconstruction import ObjectModel
from grabberd.reconstruction.accuracy.ground_truth import Truth
from grabberd_fake import FakeOptions
from grabberd_fake.documents import calibration_document, object_document
from grabberd_fake.ellipse_liner import EllipseLiner
from grabberd_fake.liner import Liner, _travel
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
    """A pulsation: how fast it closes, how far, and what else differs from seed to seed."""

    seconds: float
    stroke_mm: float
    seed: int
    exposure_ms: float = 1.0

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
            "rig": {"seed": self.seed + 1, "mirror_error_px": 0},
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
        world.scene = ClosingScene(closure)
        count = round(periods / 0.02)
        self.fields = [_grey(world, n) for n in range(count)]
        self._truths = [world.truth(n * FIELD_NS) for n in range(count)]
        known = closure.options
        document = yaml.safe_load(object_document(known))
        if closure.shape == "ellipse":
            document = _with_places(document, world.scene.nominal().xyz_mm)
        calibration = Calibration.from_document(calibration_document(known))
        self.setup = MeasureSetup(calibration, ObjectModel.from_document(document))
        self._rng = np.random.default_rng((closure.seed, 78))

    def kept(self, lost: float) -> list[NumberedField]:
        """The fields without some that are lost at random."""
        return [one for one in self.fields if self._rng.random() >= lost]

    def investigated(self, bits: int, lost: float = 0.0) -> Investigation:
        """Measure with 1 bit and doubled lines, or with 8 bits, and compare with the truth."""
        fields = self.kept(lost)
        packed = requantised(fields, bits, doubled=bits == 1)
        points = ((one.n, one.time_ns, one.points) for one in measure_fields(packed, self.setup))
        return investigate(points, self._truth(fields), InvestigationSettings(bits=bits))

    def _truth(self, fields):
        truths = [self._truths[one.n] for one in fields]
        return Truth(
            n=np.repeat([one.n for one in fields], len(truths[0].ids)).astype(np.int64),
            target=np.concatenate([truth.ids for truth in truths]),
            xyz_mm=np.concatenate([truth.xyz_mm for truth in truths]),
            expected=np.concatenate([truth.visible_left & truth.visible_right for truth in truths]),
        )


def _grey(world, n):
    luma = np.empty((288, 720), np.uint8)
    world.picture(n, luma)
    return NumberedField(n, n * FIELD_NS, n, quantise(Field.intact(luma, n % 2), 8, 76))


def _with_places(document, places_mm):
    for one, (x, y, z) in zip(document["targets"], places_mm.tolist(), strict=True):
        one.update(x_mm=x, y_mm=y, z_mm=z)
    return document
