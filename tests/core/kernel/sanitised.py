"""The kernel, compiled with sanitisers, in a process that loads their library first."""

import ctypes
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import grabberd.core.kernel

HERE = Path(__file__).parent
SOURCES = Path(grabberd.core.kernel.__file__).parent
_OPTIONS = ["-std=c11", "-O1", "-g", "-fPIC", "-shared", "-Wno-psabi", "-DGRABBERD_PLAIN"]
_CHECKS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
# Its name as a module is that of its first function.
_NAME = "-DPyInit__kernel=PyInit__sanitised"


def runtime() -> str | None:
    """Library of the sanitisers; None if they, a compiler or Python's headers are missing."""
    compiler = shutil.which("gcc")
    if not compiler or not (Path(sysconfig.get_path("include")) / "Python.h").exists():
        return None
    asked = [compiler, "-print-file-name=libasan.so"]
    path = subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    return path if os.path.isabs(path) and ctypes.sizeof(ctypes.c_void_p) == 8 else None


def build(folder: Path) -> None:
    """Compiles it into a folder, as the module `_sanitised`, unless it is there."""
    target = folder / "_sanitised.abi3.so"
    if target.exists():
        return
    folder.mkdir(exist_ok=True)
    include = f"-I{sysconfig.get_path('include')}"
    files = [str(file) for file in sorted(SOURCES.glob("*.c"))]
    words = ["gcc", *_OPTIONS, *_CHECKS, include, _NAME, "-o", str(target), *files, "-lm"]
    subprocess.run(words, check=True)


def run(folder: Path, script: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs a script with the kernel of a folder."""
    environment = {
        **os.environ,
        "LD_PRELOAD": str(runtime()),
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONMALLOC": "malloc",
        "PYTHONPATH": os.pathsep.join([str(folder), str(HERE.parents[1]), *sys.path[1:]]),
    }
    return subprocess.run(
        [sys.executable, str(script), *words], env=environment, capture_output=True, text=True, check=False
    )
