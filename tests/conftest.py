"""What tests need on computers that do other work as well: no test may fail because its computer is busy.

Arithmetic runs on one thread: beside other work, two that wait for each other take up to ten times as long.
Hypothesis does not judge by the clock how long examples take to draw and to run.
"""

import os

from hypothesis import HealthCheck, settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
settings.register_profile("shared", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared")
