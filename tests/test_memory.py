import re
import subprocess
import sys
from pathlib import Path

import pytest

from grabberd.config import shipped_configs
from proofs.faults.daemon import running

FIELDS = """
import resource, sys
import numpy as np
from grabberd.core.field import Field, double_lines, quantise
from grabberd.memory import keep_freed_memory

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


LOADED = """
import gc
import grabberd.server.api, grabberd.server.daemon.service
from grabberd.memory import freeze_loaded

before = len(gc.get_objects())
freeze_loaded()
print(before, len(gc.get_objects()))
"""


def test_what_is_loaded_is_collected_no_more() -> None:
    out = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True, check=True)
    before, afterwards = map(int, out.stdout.split())
    assert before > 50_000
    assert afterwards < 1_000


UNUSED = {
    *("rich", "cv2", "scipy", "matplotlib", "pyarrow", "h5py", "jinja2"),
    *("numpy.fft", "numpy.polynomial", "numpy.testing"),
    *("grabberd.cli.storage", "grabberd.cli.capture", "grabberd_liner.analysis", "grabberd.core.calibration"),
    *("grabberd.reports", "grabberd_liner.render"),
}
"""Modules that a daemon has no use for while nobody asks, each half a megabyte or more with what it loads."""


def test_an_idle_daemon_has_loaded_nothing_that_it_does_not_use(tmp_path: Path) -> None:
    device = {
        "driver": "fake",
        "options": {"scene": "liner"},
        "calibration": str(shipped_configs() / "fake.calibration.json"),
        "object": str(shipped_configs() / "objects" / "liner.yaml"),
    }
    command = (sys.executable, "-X", "importtime", "-c", "from grabberd.cli import main; main()")
    with running(tmp_path, {"devices": {"cup": device}}, command) as daemon:
        daemon.wait_until_ready()
        daemon.wait_for("/api/v1/state", lambda state: state["devices"]["cup"]["live"])
        daemon.get("/api/v1/devices/cup/points")
        daemon.get("/api/v1/state")
        loaded = set(re.findall(r"^import time:.*\| +(\S+)$", daemon.journal.read_text(), re.MULTILINE))
    assert "grabberd.instrument.device.worker" in loaded
    assert loaded & UNUSED == set()
