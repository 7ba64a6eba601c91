"""The compiled kernel and numpy predict the same from the same targets; the kernel's bits are the same with
any number of threads.
"""

import subprocess
import sys

import numpy as np
import pytest
from numpy._core._multiarray_umath import __cpu_features__

from core.reconstruction.liners import model
from grabberd.core.kernel import KERNEL
from grabberd.core.reconstruction import Smoothness
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

NOMINAL_MM = model().xyz_mm
SMOOTHNESS = Smoothness(sigma_mm=3.0, reach_mm=30.0, noise_mm=0.15)


def fields(variance_mm2=0.0):
    return [
        DisplacementField.of(NOMINAL_MM, SMOOTHNESS, variance_mm2=variance_mm2, kernel=kernel)
        for kernel in (KERNEL, None)
    ]


@pytest.mark.parametrize("count", [0, 1, 2, 53, 54, 55, 83, 107, 108])
def test_the_predictors_are_numpys(count):
    rng = np.random.default_rng(count)
    ours, theirs = fields(rng.uniform(0, 0.5, len(NOMINAL_MM)))
    assert np.allclose(ours.precision, theirs.precision, rtol=0, atol=1e-9 * theirs.precision.max())
    for _ in range(5):
        seen = np.sort(rng.permutation(len(NOMINAL_MM))[:count])
        one, other = ours.say(seen), theirs.say(seen)
        assert one.weights.shape == other.weights.shape == (len(NOMINAL_MM), count)
        assert np.allclose(one.weights, other.weights, rtol=0, atol=1e-9)
        assert np.allclose(one.sigma_mm, other.sigma_mm, rtol=0, atol=1e-7)


BITS = """
import hashlib
import numpy as np
from core.kernel.test_predictor_equality import fields

ours, _ = fields()
rng, digest = np.random.default_rng(1), hashlib.sha256(ours.precision)
for count in (20, 60, 83, 107):
    say = ours.say(np.sort(rng.permutation(108)[:count]))
    digest.update(say.weights.tobytes() + say.sigma_mm.tobytes())
print(digest.hexdigest())
"""


def test_the_bits_do_not_depend_on_the_number_of_processors_or_their_vector_units():
    """Numpy's do: its linear algebra rounds otherwise with every number of threads, its exp with AVX-512."""

    def bits(threads, without=""):
        variables = {"OPENBLAS_NUM_THREADS": threads, "NPY_DISABLE_CPU_FEATURES": without}
        variables["PYTHONPATH"] = ":".join(sys.path)
        return subprocess.check_output([sys.executable, "-W", "ignore", "-c", BITS], env=variables)

    wide = [name for name in ("X86_V4", "AVX512_ICL", "AVX512_SPR") if __cpu_features__.get(name)]
    assert bits("1") == bits("2") == bits("4") == bits("1", without=" ".join(wide))


@pytest.mark.parametrize("wrong", range(5))
def test_arrays_that_do_not_belong_together_are_refused(wrong):
    square, numbers = np.eye(6), np.empty(6)
    given = [square, square, np.ones(6, np.bool_), np.empty((6, 6)), numbers]
    given[wrong] = given[wrong].ravel()[:-1].copy()
    with pytest.raises(ValueError, match="do not belong together"):
        KERNEL.predictor(*given[:2], 0.1, *given[2:])
