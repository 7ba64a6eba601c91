"""The compiled kernel and numpy find the same forces and the same stiffness of a thick wall."""

import numpy as np
import pytest

from grabberd.core.kernel import KERNEL
from grabberd_liner.analysis.wall.half_tube import HalfTube, MountedTube
from grabberd_liner.analysis.wall.shell import Load, Shell

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

HALF = HalfTube(MountedTube(12.5, 0.01, 60.0, 2.5, 3.0, 60.0), arcs=6, slabs=8)
STATES = {"mounted": 0.0, "bent": 0.05, "bent sharply": 0.3}


@pytest.fixture(params=STATES)
def control(request):
    rng = np.random.default_rng(1)
    return HALF.moved(HALF.mounted, STATES[request.param] * rng.normal(size=HALF.cuts.count))


@pytest.fixture(scope="module")
def load():
    rng, count = np.random.default_rng(2), len(HALF.s_mm)
    return Load(0.03, 0.04 * rng.random(count), 0.005 * rng.normal(size=(2, count)))


@pytest.fixture(scope="module")
def numpy_alone():
    return Shell(HALF.shell.basis, HALF.shell.weights, HALF.shell.wall, kernel=None)


def test_work_of_stress_and_of_unit_loads(control, numpy_alone):
    for ours, theirs in zip(HALF.shell.work(control), numpy_alone.work(control), strict=True):
        assert ours == pytest.approx(theirs, abs=1e-12 * np.abs(theirs).max())


def test_stiffness(control, load, numpy_alone):
    expected = numpy_alone.stiffness(control, load)
    assert HALF.shell.stiffness(control, load) == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())
