"""Debian packages of small releases, and a machine in a folder whose dpkg installs them."""

import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

from .rehearsed import PYTHON, Done, Rehearsed
from .small_release import SYSTEMD, write_wheel

RELEASE = "usr/lib/grabberd"
_DPKG = (
    "--force-depends",
    "--force-script-chrootless",
    "--force-confold",
    "--force-not-root",
    "--no-triggers",
)


def write_bundle(folder: Path, version: str, schema: int = 1) -> Path:
    """Packs a release that knows the state up to a schema."""
    bundle = folder / f"grabberd-{version}"
    (bundle / "wheels").mkdir(parents=True)
    write_wheel(bundle / "wheels", version, schema)
    (bundle / "constraints.txt").touch()
    packed = folder / "bundle.tar.gz"
    with tarfile.open(packed, "w:gz") as archive:
        archive.add(bundle, bundle.name)
    return packed


def write_package(bundle: Path, folder: Path) -> Path:
    """Makes a package of a bundle, as `make deb` does."""
    command = ["bash", SYSTEMD / "deb.sh", bundle, PYTHON, folder]
    environment = {**os.environ, "COMPRESSION": "1", "SOURCE_DATE_EPOCH": "1700000000", "PACKAGES": ""}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (made,) = folder.glob("*.deb")
    return made


class Packaged(Rehearsed):
    """The machine, with a dpkg of its own."""

    def __init__(self, machine: Path, root: Path) -> None:
        super().__init__(machine, root)
        self._database = root / "var/lib/dpkg"
        for name in ("updates", "info", "triggers"):
            (self._database / name).mkdir(parents=True, exist_ok=True)
        for name in ("status", "available"):
            (self._database / name).touch()

    def dpkg(self, *words: str | Path, **variables: str) -> Done:
        """Runs dpkg on the root, with the packages' scripts; systemd is the machine's."""
        programs = {"RELEASE": RELEASE, "HEALTH_S": "10", **variables}
        done = subprocess.run(
            ["dpkg", f"--root={self.root}", *_DPKG, *map(str, words)],
            env=self.environment(**programs),
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        return Done(done.returncode, done.stdout + done.stderr)

    @property
    def status(self) -> str:
        """How dpkg has the package, such as `install ok installed`."""
        blocks = (self._database / "status").read_text().split("\n\n")
        ours = next((block for block in blocks if block.startswith("Package: grabberd\n")), "")
        return next((line[8:] for line in ours.splitlines() if line.startswith("Status: ")), "unknown")

    @property
    def left(self) -> set[str]:
        """Every file and link of the root, dpkg's own apart."""
        return {name for name in self.everything() if not name.startswith("var/lib/dpkg/")}


def why_not() -> str | None:
    """Why no package can be made or installed on this computer."""
    if sys.platform != "linux" or not shutil.which("dpkg-deb"):
        return "dpkg is missing: apt-get install dpkg"
    return None
