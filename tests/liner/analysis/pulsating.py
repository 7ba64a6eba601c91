"""Points of the simulated liner as they would be measured: true places, noise and its covariance, holes."""

import numpy as np

from grabberd.core.reconstruction import Points
from grabberd_fake.liner import EllipseLiner
from grabberd_fake.options import FakeOptions
from grabberd_liner.analysis.pulsation.movement import TimedPoints

FIELD_S = 0.02
LINER = FakeOptions().ellipse
OPEN_HALF_S, CLOSED_HALF_S = 0.0757439, 0.6742561
"""When the ellipse's first principal movement passes half its stroke."""


def liner(**options):
    return FakeOptions.read({"ellipse": options}).ellipse


def capture(times_s, sigma_mm=0.02, missing=0.0, seed=0, **options):
    """Fields of a capture; z is twice as noisy, as it is with this rig."""
    rng, scene = np.random.default_rng(seed), EllipseLiner(liner(**options))
    each = sigma_mm * np.array([1.0, 1.0, 2.0])
    fields = []
    for time_s in times_s:
        places = scene.targets(round(time_s * 1e9)).xyz_mm
        places = places + rng.normal(size=places.shape) * each
        fields.append(TimedPoints(float(time_s), points(scene.ids, places, each, rng, missing)))
    return fields


def points(ids, places, sigma_mm, rng, missing):
    seen = rng.random(len(ids)) >= missing
    count = int(seen.sum())
    return Points(
        ids[seen],
        places[seen],
        np.tile(np.diag(np.square(sigma_mm)), (count, 1, 1)),
        np.tile(np.eye(3) * 1e-4, (count, 1, 1)),
        np.zeros((count, 2, 2)),
        np.zeros(count),
    )


def times(count, start_s=0.123):
    return start_s + np.arange(count) * FIELD_S


def burst_times(starts_s):
    return [times(32, start) for start in starts_s]
