"""Debian packages that the host needs to build and run the virtual machine."""

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

PROGRAMS = {
    "qemu-system-x86_64": "qemu-system-x86",
    "mmdebstrap": "mmdebstrap",
    "busybox": "busybox-static",
    "mkfs.ext4": "e2fsprogs",
    "depmod": "kmod",
    "dpkg-deb": "dpkg",
}
"""Program → package that holds it."""

_APT = ("apt-get", "-qq", "-o", "DPkg::Lock::Timeout=300", "-o", "Acquire::Retries=3")


class MissingPackages(Exception):
    """What the host lacks, and how to install it."""


def refresh() -> None:
    """Fetches the lists of packages anew: those that a machine was delivered with name what is gone."""
    run_retried(*_APT, "update")


def missing_packages() -> list[str]:
    """Packages whose programs are not found, also outside an ordinary user's PATH."""
    path = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
    return sorted({package for program, package in PROGRAMS.items() if not shutil.which(program, path=path)})


def provide_packages() -> None:
    """Installs what is missing.

    Raises:
        MissingPackages: these rights do not suffice for that.
    """
    missing = missing_packages()
    if not missing:
        return
    if os.geteuid() != 0:
        raise MissingPackages(f"missing: sudo apt-get install --no-install-recommends {' '.join(missing)}")
    print(f"installing {' '.join(missing)}", flush=True)
    refresh()
    run_retried(*_APT, "install", "-y", "--no-install-recommends", *missing)


def run(*command: str, stdin: str | None = None, cwd: os.PathLike[str] | None = None) -> str:
    """A command's output.

    Raises:
        RuntimeError: it failed; with the end of what it said.
    """
    done = subprocess.run(
        command, input=stdin, text=True, capture_output=True, check=False, cwd=cwd, env=_environment()
    )
    if done.returncode:
        raise RuntimeError(
            f"{' '.join(command)}: exit {done.returncode}\n{(done.stdout + done.stderr)[-3000:]}"
        )
    return done.stdout


def run_retried(*command: str, tries: int = 3, cwd: os.PathLike[str] | None = None) -> str:
    """A command that uses the network; tried again when it fails."""
    for _ in range(tries - 1):
        try:
            return run(*command, cwd=cwd)
        except RuntimeError as error:
            print(f"trying again: {error}", flush=True)
    return run(*command, cwd=cwd)


class Archive:
    """Debian's packages of a release, without a word to the host's own lists of packages.

    Args:
        release: Its code name ("trixie").
        folder: Lists and packages go there.

    Raises:
        RuntimeError: apt says no.
    """

    def __init__(self, release: str, folder: Path) -> None:
        self._folder = folder
        (folder / "lists" / "partial").mkdir(parents=True)
        (folder / "sources.list").write_text(apt_sources().replace(own_release(), release))
        run_retried("apt-get", *self._options, "update")

    @property
    def _options(self) -> Sequence[str]:
        own = {
            "Etc::sourcelist": self._folder / "sources.list",
            "Etc::sourceparts": "-",
            "State::Lists": self._folder / "lists",
            "Cache": self._folder / "cache",
        }
        return ["-qq", *(f"-oDir::{name}={value}" for name, value in own.items())]

    def cache(self, *words: str) -> str:
        """What `apt-cache` knows."""
        return run("apt-cache", *self._options, *words)

    def download(self, package: str) -> Path:
        """The package's file."""
        run_retried("apt-get", *self._options, "download", package, cwd=self._folder)
        (file,) = self._folder.glob(f"{package}_*.deb")
        return file


def own_release() -> str:
    """The code name of the host's Debian."""
    return next(
        line.partition("=")[2].strip('"')
        for line in Path("/etc/os-release").read_text().splitlines()
        if line.startswith("VERSION_CODENAME=")
    )


def apt_sources() -> str:
    """The host's own Debian sources, in one-line form."""
    form = "$(REPO_URI) $(RELEASE) $(COMPONENT)"
    targets = run("apt-get", "indextargets", "--format", form, "Created-By: Packages", "Origin: Debian")
    keyring = "/usr/share/keyrings/debian-archive-keyring.gpg"
    signed = f"[signed-by={keyring}] " if os.path.exists(keyring) else ""
    return "".join(f"deb {signed}{line}\n" for line in sorted(set(targets.splitlines())))


def apt_options() -> Sequence[str]:
    """The host's way to the network (proxies, retries, validity), as options of mmdebstrap."""
    lines = run("apt-config", "dump", "Acquire").splitlines()
    wanted = ("Acquire::http", "Acquire::ftp", "Acquire::Retries", "Acquire::Check-")
    return [f"--aptopt={line.removesuffix(';')}" for line in lines if line.startswith(wanted)]


def _environment() -> dict[str, str]:
    path = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/sbin"])
    return {**os.environ, "PATH": path, "DEBIAN_FRONTEND": "noninteractive", "LC_ALL": "C.UTF-8"}
