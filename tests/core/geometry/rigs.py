"""Views for the tests: the reference rig, and realistic variations of it."""

import math
from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from grabberd.core.geometry import PARAMETERS, Calibration, View, rotation_angles

LENS = (0.003, -0.002, -1.5e-3, 4e-5, -1e-6, 4e-4, -3e-4, 5e-4, -4e-4)
LIMITS = (0.01, 0.01, 2e-3, 5e-5, 1e-6, 8e-4, 8e-4, 8e-4, 8e-4)
HALVES = {"left": (0, 360, -64.0, 179.5), "right": (360, 720, 64.0, 539.5)}


def aimed(name: str, handedness: int = 1, b: tuple[float, ...] = LENS) -> View:
    """One of the two converging views, the origin of the object's frame in the middle of its half."""
    first, end, base_mm, middle_px = HALVES[name]
    aside = math.atan((middle_px - 359.5) * 0.0086 / 8.0)
    turn = math.atan2(-base_mm, 240.0) - handedness * aside
    cosine, sine = math.cos(turn), math.sin(turn)
    rotation = np.array([[0.0, cosine, sine], [-1.0, 0.0, 0.0], [0.0, -sine, cosine]])
    omega, phi, kappa = rotation_angles(rotation)
    return View(
        name,
        first,
        end,
        0.0086,
        0.0083,
        handedness,
        8.0,
        359.5,
        287.5,
        omega,
        phi,
        kappa,
        0.0,
        base_mm,
        240.0,
        b,
    )


def calibration(handedness: int = 1, covariance: np.ndarray | None = None, b=LENS) -> Calibration:
    return Calibration(
        "test", "2026-01-02T03:04:05+00:00", "a test", 720, 576,
        aimed("left", handedness, b), aimed("right", handedness, b),
        np.zeros((36, 36)) if covariance is None else covariance,
    )  # fmt: skip


@st.composite
def views(draw, polynomials=("distortion", "correction")):
    """Any view near the reference rig, of either handedness, with any lens that a rig may have."""
    view = aimed(draw(st.sampled_from(["left", "right"])), draw(st.sampled_from([1, -1])))
    shares = draw(st.lists(st.floats(-1, 1), min_size=18, max_size=18))
    spread = np.array([0.8, 10, 10, 0.1, 0.1, 0.1, 10, 10, 20])
    values = view.vector()
    values[:9] += np.array(shares[:9]) * spread
    values[9:] = np.array(shares[9:]) * np.array(LIMITS)
    assert len(values) == len(PARAMETERS)
    return replace(view.with_vector(values), polynomial=draw(st.sampled_from(polynomials)))


@st.composite
def places(draw, least: int = 1):
    """(N, 3) places in the measuring volume, mm."""
    count = draw(st.integers(least, 6))
    number = st.floats(-1, 1).map(lambda share: round(share, 6))
    shares = draw(st.lists(st.tuples(number, number, number), min_size=count, max_size=count))
    return np.array(shares) * [60.0, 25.0, 15.0]
