"""What tests need on computers that do other work as well: no test may fail because its computer is busy.

Arithmetic runs on one thread: beside other work, two that wait for each other take up to ten times as long.
Hypothesis does not judge by the clock how long examples take to draw and to run. Whoever is started in the
background by a script is told to ignore Ctrl-C, and passes that on: tests that press it have it heard again.
"""

import os
import signal

from hypothesis import HealthCheck, settings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
settings.register_profile("shared", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("shared")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
