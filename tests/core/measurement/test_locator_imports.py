"""Which locators a program imports: those that it uses."""

import subprocess
import sys

import pytest

COMPARED = ("edge", "correlation", "interpolation")
PROGRAM = """
import sys
import numpy as np
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.location import measure_by_numpy

luma = np.full((24, 40), 20, np.uint8)
luma[8:12, 10:17] = 200
settings = LocationSettings({settings})
for bits in (1, 8):
    assert len(measure_by_numpy(quantise(Field.intact(luma, 0), bits, 100), settings)) == 1
start = "grabberd.core.measurement.locators."
print(*(name.rpartition(".")[2] for name in sys.modules if name.startswith(start)))
"""


def imported(settings):
    program = PROGRAM.format(settings=settings)
    return subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    ).stdout.split()


def test_the_default_locators_do_not_import_those_kept_for_comparison():
    assert not set(COMPARED) & set(imported(""))


@pytest.mark.parametrize(
    ("method", "module"), [("vernier", "interpolation"), ("tian-huhns", "interpolation")]
)
def test_a_locator_is_imported_when_it_is_asked_for(method, module):
    found = set(imported(f"method={method!r}"))
    assert module in found
    assert "correlation" not in found
