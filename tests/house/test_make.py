"""What `make` offers beside the tests can be started: each command finds its modules."""

import subprocess

import pytest

from house.drawing import ROOT

TARGETS = (
    "measured",
    "soak-clients",
    "soak-faults",
    "armour",
    "hostile",
    "faults",
    "fuzz",
    "setups",
    "footage",
    "audit",
    "world",
    "profile",
)


@pytest.mark.parametrize("target", TARGETS)
def test_a_command_starts(target: str) -> None:
    shown = subprocess.run(
        ["make", "--dry-run", "--no-print-directory", target],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    (command,) = [line for line in shown.stdout.splitlines() if " -m tests." in line or " -m " in line][-1:]
    asked = subprocess.run(
        ["bash", "-c", f"{command} --help"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert asked.returncode == 0, asked.stderr
    assert "usage:" in asked.stdout
