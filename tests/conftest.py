"""Arithmetic on one thread: beside other work, two that wait for each other take up to ten times as long."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
