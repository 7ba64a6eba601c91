"""Builds the compiled kernel with the wheel, where a C compiler and Python's headers are at hand.

Without them the wheel is the pure one, for any computer, and numpy does the kernel's work.
GRABBERD_KERNEL=no asks for the pure wheel; GRABBERD_KERNEL=must lets the build fail where there is no kernel.
"""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NAME = "_kernel.abi3.so"
TAG = "cp311-abi3"
FLAGS = (
    "-std=c11 -O3 -ffp-contract=off -fno-math-errno -fno-trapping-math -fvisibility=hidden -fPIC -shared "
    "-Wno-psabi"
)


class KernelHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds the kernel to a wheel; in an editable one it lies beside its sources."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before the wheel is packed."""
        wanted = os.environ.get("GRABBERD_KERNEL", "")
        if wanted == "no":
            return
        sources = Path(self.root, "src/grabberd/core/kernel")
        # Removed with this hook, once the wheel is packed.
        self._folder = tempfile.TemporaryDirectory(prefix="grabberd-kernel-")
        made = Path(self._folder.name, NAME)
        if problem := build(sources, made):
            if wanted == "must":
                raise RuntimeError(problem)
            self.app.display_warning(
                f"no compiled kernel: {problem}; numpy will take fields in at a quarter of its speed, and "
                "measure and analyse them at a tenth"
            )
            return
        build_data["pure_python"] = False
        build_data["tag"] = f"{TAG}-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
        if version == "editable":
            beside = sources / (NAME + ".new")
            shutil.copy(made, beside)
            beside.replace(sources / NAME)
        else:
            build_data["force_include"][str(made)] = f"grabberd/core/kernel/{NAME}"


def build(sources: Path, target: Path) -> str:
    """Compiles the kernel; what stood in the way, or nothing."""
    compiler = shlex.split(os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or "")
    headers = Path(sysconfig.get_path("include"))
    if not sys.platform.startswith("linux"):
        return f"it is built on Linux only, not on {sys.platform}"
    if not compiler:
        return "there is no C compiler (Debian: apt-get install gcc libc6-dev)"
    if not (headers / "Python.h").exists():
        return f"{headers / 'Python.h'} is missing (Debian: apt-get install python3-dev)"
    files = [str(file) for file in sorted(sources.glob("*.c"))]
    options = [*shlex.split(FLAGS), f"-I{headers}"]
    try:
        done = subprocess.run(  # noqa: S603
            [*compiler, *options, "-o", str(target), *files, "-lm"],
            capture_output=True,
            text=True,
            check=False,
        )
    except OSError as error:
        return str(error)
    return "" if done.returncode == 0 else f"{' '.join(compiler)} failed:\n{done.stderr}"
