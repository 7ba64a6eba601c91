"""The Debian package as its administrator has it: dpkg, and what it leaves."""

import subprocess
import time
from typing import Any

from proofs.vm.guest.shell import run
from proofs.vm.guest.unit import as_administrator, journal, prepare


def install(deb: str) -> dict[str, Any]:
    """Installs the package on a machine that has what the service needs.

    Returns:
        its seconds, what dpkg said, and what the service has said since.
    """
    prepare()
    return dpkg(f"--install {deb}")


def dpkg(words: str) -> dict[str, Any]:
    """Runs dpkg; its exit code, what it said, its seconds, and what the service said last."""
    started = time.monotonic()
    line = f"{as_administrator()} HEALTH_S=300 dpkg {words} 2>&1"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=1200, check=False)
    seconds = time.monotonic() - started
    return {"exit": done.returncode, "said": done.stdout, "seconds": seconds, "journal": journal(100)}


def status() -> str:
    """How dpkg has the package, and what it finds wrong with its files; the image keeps no /usr/share/doc."""
    verify = "dpkg --verify grabberd | grep -v /usr/share/doc/ || true"
    return run(f"dpkg-query --show --showformat='${{Status}}\\n' grabberd; {verify}").strip()


def left(folder: str) -> list[str]:
    """Files below a folder, sorted; none if there is no such folder."""
    return run(f"test ! -d {folder} || find {folder} -type f | sort").split()


def unit_state() -> str:
    """Whether systemd still knows the service."""
    return run("systemctl show grabberd.service -p LoadState --value").strip()
