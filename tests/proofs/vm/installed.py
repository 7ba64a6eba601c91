"""A machine on which the service is installed, from a bundle, with a disk of its own for captures."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from proofs.vm import host
from proofs.vm.guest import unit
from proofs.vm.image import CHECKOUT, Image
from proofs.vm.machine import Disks, Machine, counted

STATE_MB = 1000


class Installed:
    """Installed once; its disks stay through power cuts.

    Attributes:
        machine: as it was booted last.
        installed: what `unit.install` returned.
    """

    def __init__(self, image: Image) -> None:
        self._image = image
        self._folder = Path(tempfile.mkdtemp(prefix="grabberd-vm-disks-"))
        try:
            self._disks = new_disks(image, self._folder)
            bundle = bundle_of_grabberd(self._folder / "bundle")
            self.machine = self._boot()
            shutil.copy(bundle, self.machine.share)
            self.installed: dict[str, Any] = self.machine.call(
                unit.install, bundle=f"/share/{bundle.name}", timeout_s=800
            )
            self.machine.pause()
        except BaseException:
            self.close()
            raise

    def power_cut(self) -> str:
        """The machine is gone from one instant to the next; what it last wrote into `/share/clock`."""
        self.machine.kill()
        clock = (self.machine.share / "clock").read_text()
        self.machine.stop()
        return clock

    def boot(self) -> float:
        """Boots it again from its disks; seconds of the host's."""
        self.machine = self._boot()
        return self.machine.boot_s

    def close(self) -> None:
        """Nothing of it stays."""
        if hasattr(self, "machine"):
            self.machine.stop()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _boot(self) -> Machine:
        return Machine(self._image, counted(0), disks=self._disks)


def new_disks(image: Image, folder: Path) -> Disks:
    """A copy of the image's disk, and an empty one for captures."""
    disks = Disks(folder / "root", folder / "state")
    host.run("cp", "--sparse=always", str(image.disk), str(disks.root))
    host.run("mkfs.ext4", "-q", str(disks.state), f"{STATE_MB}M")
    return disks


def bundle_of_grabberd(folder: Path) -> Path:
    """A bundle without the other packages: the image has them."""
    command = ["bash", str(CHECKOUT / "systemd" / "bundle.sh"), sys.executable, str(folder), "--no-deps"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (bundle,) = folder.glob("*.tar.gz")
    return bundle
