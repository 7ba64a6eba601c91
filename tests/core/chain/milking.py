"""Captures of the flattening ellipse as points: true places, noise with its covariance, and what is true."""

from functools import cache

import numpy as np

from grabberd.core.reconstruction import ObjectModel, Points
from grabberd_fake import FakeOptions, truth_of_wall
from grabberd_fake.liner import EllipseLiner
from grabberd_fake.vacuum import vacuum_log
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.analyse import analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.wall_state import FieldPoints

FIELD_S, PERIOD_S, SIGMA_MM = 0.02, 0.6, np.array([0.01, 0.01, 0.02])
SHAPE = {"rows": 7, "columns": 5, "length_mm": 60.0, "deflection_mm": 3.0, "period_s": PERIOD_S}
OPTIONS = {"scene": "ellipse", "ellipse": SHAPE}
FAKE = FakeOptions.read(OPTIONS)
MATERIAL = {
    "law": "neo_hookean",
    "E_mpa": 3.0,
    "wall_mm": 2.5,
    "poisson": 0.5,
    "F0_n": 60.0,
    "radius_mm": 12.5,
    "target_mm": 0.0,
}
CONSTANT = {"pulsation": {"kpa": 42, "sigma_kpa": 0.5}, "liner": {"kpa": 42, "sigma_kpa": 0.5}}
"""As it is while the liner is open."""
OPEN_S, CLOSED_S = 0.2, 0.52
"""Moments at which the wall rests."""


@cache
def model():
    scene = EllipseLiner(FAKE.ellipse)
    places = scene.nominal().xyz_mm
    row, column = (part.astype(np.int32) for part in (scene.row, scene.column))
    return ObjectModel("liner", scene.ids, places, row, column, 1.5, 0.3)


@cache
def grid():
    return Grid.of(model())


def field(n, time_s=None, seed=0, sigma_mm=SIGMA_MM):
    """Points of field n."""
    time_s = n * FIELD_S if time_s is None else time_s
    rng = np.random.default_rng((seed, n))
    places = EllipseLiner(FAKE.ellipse).targets(round(time_s * 1e9)).xyz_mm
    places = places + rng.normal(size=places.shape) * sigma_mm
    return FieldPoints(n, TimedPoints(time_s, as_points(grid().target, places, sigma_mm)))


def as_points(target, places, sigma_mm=SIGMA_MM):
    count = len(target)
    return Points(
        np.asarray(target, np.int32),
        places,
        np.tile(np.diag(np.square(sigma_mm)), (count, 1, 1)),
        np.tile(np.eye(3) * 1e-6, (count, 1, 1)),
        np.zeros((count, 2, 2)),
        np.zeros(count),
    )


def changed(one, target=None, keep=None, places=None):
    """The same field with other ids, fewer targets or other places."""
    points = one.timed.points
    keep = np.ones(len(points), bool) if keep is None else keep
    target = points.target if target is None else target
    places = points.xyz_mm if places is None else places
    order = np.argsort(target[keep])
    points = as_points(target[keep][order], places[keep][order])
    return FieldPoints(one.n, TimedPoints(one.timed.time_s, points))


def still(count, time_s=OPEN_S):
    """Fields of a wall that rests."""
    return [FieldPoints(n, TimedPoints(n * FIELD_S, field(n, time_s).timed.points)) for n in range(count)]


def inputs(**document):
    return read_inputs(document, grid())


def analysed(fields, progress=None, **document):
    return analyse([fields], grid(), inputs(**document), progress)


@cache
def whole():
    """One analysis with all that there is: fields 20 and 21 are missing."""
    return analysed(
        [field(n) for n in range(52) if n not in {20, 21}],
        reference="nominal",
        material=MATERIAL,
        vacuum={
            "pulsation": "log",
            "liner": "log",
            "log": log(1.6, start_s=-0.3),
            "offset": {"s": -0.3, "sigma_s": 0.001},
        },
        plane="symmetry",
        heights_mm=[-10, 0, 10],
        phases=4,
        sought_kpa=1.0,
    )


def truth(time_s):
    """Of the wall at the targets."""
    return truth_of_wall(FAKE, round(time_s * 1e9))


def log(seconds=2.0, start_s=0.0, offset_s=0.0):
    lines = vacuum_log(FAKE.ellipse, round(start_s * 1e9), round((start_s + seconds) * 1e9), offset_s)
    return "\n".join(lines)
