import subprocess
import sys

import pytest

FIELDS = """
import resource, sys
import numpy as np
from grabberd.field import Field, double_lines, quantise
from grabberd.service.memory import keep_freed_memory

kept = sys.argv[1] == "kept" and keep_freed_memory()
field = Field.intact(np.zeros((288, 720), np.uint8), 0)
for _ in range(20):
    quantise(double_lines(field), 1, 60)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(100):
    quantise(double_lines(field), 1, 60)
print(kept, resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def pages_of_a_hundred_fields(how):
    out = subprocess.run([sys.executable, "-c", FIELDS, how], capture_output=True, text=True, check=True)
    kept, pages = out.stdout.split()
    return kept == "True", int(pages)


def test_a_field_uses_the_memory_of_the_one_before():
    kept, pages = pages_of_a_hundred_fields("kept")
    if not kept:
        pytest.skip("this C library cannot be told so")
    assert pages < 100
    assert pages_of_a_hundred_fields("given back")[1] > 1000
