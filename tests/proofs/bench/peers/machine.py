"""What a run was made on and from."""

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

from tests.proofs.bench.peers.asking import ROOT

import grabberd
from grabberd.core.kernel import in_use

OURS = ("numpy", "opencv-python-headless", "scipy")


def machine() -> dict[str, Any]:
    """The processor and the system."""
    return {"cpu": cpu(), "cores": os.cpu_count(), "system": f"{platform.system()} {platform.machine()}"}


def cpu() -> str:
    """As the processor calls itself; else the kind of machine."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text().splitlines() if told.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def load() -> list[float]:
    """Of the last minute, five and fifteen."""
    return [round(value, 2) for value in os.getloadavg()]


def commit() -> str:
    """What was measured, with a plus where the source differs from it."""
    head = _git("rev-parse", "--short", "HEAD")
    return (head + "+" * bool(_git("status", "--porcelain", "src"))) if head else "unknown"


def versions() -> dict[str, str]:
    """Of the program and what it uses."""
    used = {name: importlib.metadata.version(name) for name in OURS}
    return {"Python": platform.python_version(), "grabberd": grabberd.__version__, "work": in_use(), **used}


def _git(*words: str) -> str:
    try:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip()
