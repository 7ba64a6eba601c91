"""Worlds in a minute: a handful of seeds, what they have found before, and that a seed plays again."""

import os
import random
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from .weather import FAULTS, faults_of

REPOSITORY = Path(__file__).parents[3]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("cc") is None, reason="a world's disk is logged by a compiled library"),
]

SEEDS = (4, 14, 47), (66, 70, 198), (200, 8, 2)
"""The fewest of the first thousands whose weather has every fault; `make world` plays every pair of them."""
FOUND = {
    "a capture that could not begin left its file": (14, "disk fails to synchronise"),
    "a disk that fails to read was taken for a damaged file": (102, "disk fails to read"),
    "a power cut undid what had been answered for": (111, None),
}
"""What worlds have found, each with a seed and a fault that showed it, or with the seed's own weather."""


def played(*options):
    """The lies and the traces of worlds, each as it is printed."""
    command = [sys.executable, "-m", "tests.proofs.world", "--processes", "1", "--traces", *options]
    environment = {**os.environ, "PYTHONPATH": f"{REPOSITORY}:{REPOSITORY / 'tests'}"}
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False
    )
    assert "Made by `make world`" in done.stdout, done.stdout + done.stderr
    return [line for line in done.stdout.splitlines() if line.startswith(("seed", "trace"))]


def lies(lines):
    """Those of the numbering have an audit of their own."""
    return [line for line in lines if line.startswith("seed") and ": numbering: " not in line]


@cache
def weathered(seeds):
    """What is printed of the worlds of these seeds."""
    return played("--seeds", ",".join(map(str, seeds)))


def test_the_weather_has_every_fault():
    met = [faults_of(seed, random.Random(f"weather {seed}")) for seeds in SEEDS for seed in seeds]
    assert {fault for faults in met for fault in faults} == set(FAULTS)


@pytest.mark.parametrize("seeds", SEEDS)
def test_nothing_that_is_promised_is_broken(seeds):
    assert lies(weathered(seeds)) == []


@pytest.mark.parametrize(("seed", "fault"), FOUND.values(), ids=FOUND)
def test_what_was_found_stays_mended(seed, fault):
    only = ["--fault", fault] if fault else []
    assert lies(played("--seeds", f"{seed}:{seed + 1}", *only)) == []


def test_a_seed_plays_again_to_the_letter():
    """After others and alone."""
    [first] = [line for line in weathered(SEEDS[0]) if line.startswith("trace 14 ")]
    assert re.fullmatch(r"trace 14 [0-9a-f]{16}", first)
    assert first in played("--seeds", "14:15")
