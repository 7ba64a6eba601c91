"""The virtual machine's disk: a minimal Debian with Python and what grabberd needs, built once and kept.

It boots with the kernel of either Debian release.

The image does not hold the checkout: that comes through a share, so a change of the source needs no new
image. It is kept below `$GRABBERD_VM_CACHE` (or the user's cache folder) under a name made of its recipe.

    PYTHONPATH=tests python -m proofs.vm.image      builds it, or says where it is
"""

import fcntl
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from proofs.vm import host, kernel

CHECKOUT = Path(__file__).parents[3]
PACKAGES = (
    "systemd-sysv",
    "udev",
    "kmod",
    "python3",
    "python3-venv",
    "v4l-utils",
    "libusb-1.0-0",
    "procps",
    "e2fsprogs",
    "iproute2",
    "curl",
)
SITE = "opt/site"
"""Where the Python packages are in the guest."""
SIZE_MB = 2600
RELEASES = ("bookworm", "trixie")
"""Debian 12 and 13, whose kernels it has; the rest is of the host's own release."""

AGENT_UNIT = """[Unit]
Description=Runs what the host asks for
After=systemd-udev-settle.service
Wants=systemd-udev-settle.service
RequiresMountsFor=/checkout /share
[Service]
# While the guest waits for a busy host's files it is idle, and its counted time leaps from timer to timer:
# minutes of it pass in a second.
TimeoutStartSec=infinity
Environment=PYTHONPATH=/run/metadata:/run/copy/src:/run/copy/drivers:/run/copy/tests:/opt/site
Environment=OPENBLAS_NUM_THREADS=1 HOME=/root PYTHONUNBUFFERED=1 PYTHONDONTWRITEBYTECODE=1
# What is read from the host while a test runs would take of the guest's time what it takes of the host's.
ExecStartPre=/usr/bin/mkdir -p /run/copy/tests/proofs
ExecStartPre=/usr/bin/cp -a /checkout/src /checkout/drivers /checkout/configs /run/copy
ExecStartPre=/usr/bin/cp -a /checkout/tests/proofs/vm /run/copy/tests/proofs
ExecStart=/usr/bin/python3 -m proofs.vm.guest.agent
StandardOutput=journal+console
StandardError=journal+console
[Install]
WantedBy=multi-user.target
"""
FSTAB = """/dev/vda / ext4 defaults 0 0
checkout /checkout 9p trans=virtio,ro,cache=loose,msize=524288 0 0
share /share 9p trans=virtio,rw,msize=524288 0 0
"""
MASKED = (
    "apt-daily.timer",
    "apt-daily-upgrade.timer",
    "dpkg-db-backup.timer",
    "fstrim.timer",
    "e2scrub_all.timer",
    "systemd-timesyncd.service",
    "getty@tty1.service",
    "0.service",
    "e2scrub_reap.service",
    "systemd-update-utmp.service",
    "systemd-networkd.service",
    "systemd-pstore.service",
    "motd-news.timer",
)


@dataclass(frozen=True)
class Image:
    """Where its parts are."""

    folder: Path

    @property
    def disk(self) -> Path:
        """The root, ext4 without a partition table."""
        return self.folder / "root.ext4"

    def kernel(self, release: str) -> Path:
        """Of a Debian release, compressed."""
        return self.folder / f"vmlinuz-{release}"

    def initrd(self, release: str) -> Path:
        """Mounts the disk, by that kernel."""
        return self.folder / f"initrd-{release}.gz"


def cached_image() -> Image:
    """The image of this recipe, built when it is not there; with the programs that it needs to run.

    Raises:
        MissingPackages: the rights do not suffice to install them, or to build.
    """
    cache = cache_folder()
    cache.mkdir(parents=True, exist_ok=True)
    image = Image(cache / stamp())
    with _alone(cache):
        host.provide_packages()
        if not image.disk.exists():
            _build(cache, image)
            _forget_others(cache, image)
    return image


def cache_folder() -> Path:
    """Outside of the checkout."""
    chosen = os.environ.get("GRABBERD_VM_CACHE")
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(chosen) if chosen else Path(base) / "grabberd-vm"


def stamp() -> str:
    """Names the recipe: these files, the Python packages that the project names and their versions."""
    recipe = hashlib.sha256()
    for file in (__file__, kernel.__file__, host.__file__):
        recipe.update(Path(file).read_bytes())
    recipe.update("\n".join(python_packages() + _constraints()).encode())
    return recipe.hexdigest()[:16]


def python_packages() -> list[str]:
    """What the project needs at run time, by its own word."""
    return sorted(tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["dependencies"])


def _constraints() -> list[str]:
    """The versions of those; others in the file are of no concern here."""
    names = {re.split("[^a-z0-9._-]", package.lower())[0] for package in python_packages()}
    lines = (CHECKOUT / "constraints.txt").read_text().splitlines()
    return [line for line in lines if line.partition("==")[0].lower() in names]


def _build(cache: Path, image: Image) -> None:
    if os.geteuid() != 0:
        raise host.MissingPackages("the image is built by root: sudo make test-vm (once)")
    host.refresh()
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="build-", dir=cache) as name:
        folder, made = Path(name), Image(Path(name) / "image")
        made.folder.mkdir()
        _say("Debian …")
        root = _bootstrap(folder)
        _say("Python packages …")
        _install_python_packages(root)
        for release in RELEASES:
            _say(f"{release}'s kernel …")
            unpacked = kernel.unpack(release, folder)
            version = kernel.install(unpacked, root)
            shutil.copy(unpacked / "boot" / f"vmlinuz-{version}", made.kernel(release))
            kernel.write_first_root(root, version, folder / f"first-{release}", made.initrd(release))
        _set_up(root)
        _make_disk(root, made.disk)
        shutil.rmtree(image.folder, ignore_errors=True)
        made.folder.rename(image.folder)
    _say(f"built in {time.monotonic() - started:.0f} s: {image.folder}")


def _bootstrap(folder: Path) -> Path:
    root = folder / "root"
    command = ("mmdebstrap", "--quiet", "--mode=root", "--variant=apt", "--format=directory")
    slim = ("/usr/share/doc/*", "/usr/share/man/*", "/usr/share/locale/*", "/usr/share/i18n/*")
    excluded = [f"--dpkgopt=path-exclude={pattern}" for pattern in slim]
    include = f"--include={','.join(PACKAGES)}"
    for left in (2, 1, 0):
        try:
            host.run(
                *command,
                include,
                *excluded,
                *host.apt_options(),
                host.own_release(),
                str(root),
                "-",
                stdin=host.apt_sources(),
            )
            break
        except RuntimeError as error:
            if not left:
                raise
            _say(f"trying again: {error}")
            shutil.rmtree(root, ignore_errors=True)
    return root


def _install_python_packages(root: Path) -> None:
    (python,) = {path.name for path in (root / "usr/bin").glob("python3.*") if path.name[8:].isdigit()}
    platforms = [f"--platform=manylinux_2_{minor}_x86_64" for minor in (28, 27, 17)]
    host.run_retried(
        *(sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--only-binary=:all:"),
        *(f"--python-version={python.removeprefix('python')}", "--implementation=cp", *platforms),
        *("--platform=manylinux2014_x86_64", "--constraint", str(CHECKOUT / "constraints.txt")),
        *("--target", str(root / SITE), *python_packages()),
    )
    for tests in (root / SITE).glob("*/**/tests"):
        shutil.rmtree(tests, ignore_errors=True)
    host.run("chroot", str(root), "/usr/bin/python3", "-m", "compileall", "-q", f"/{SITE}")


def _set_up(root: Path) -> None:
    (root / "etc/systemd/system/agent.service").write_text(AGENT_UNIT)
    wants = root / "etc/systemd/system/multi-user.target.wants"
    wants.mkdir(exist_ok=True)
    (wants / "agent.service").symlink_to("/etc/systemd/system/agent.service")
    for unit in MASKED:
        masked = root / "etc/systemd/system" / unit
        masked.unlink(missing_ok=True)
        masked.symlink_to("/dev/null")
    (root / "etc/fstab").write_text(FSTAB)
    (root / "etc/hostname").write_text("grabberd-vm\n")
    (root / "etc/machine-id").write_text("0123456789abcdef0123456789abcdef\n")
    (root / "etc/systemd/system.conf.d").mkdir(exist_ok=True)
    (root / "etc/systemd/system.conf.d/patience.conf").write_text(
        "[Manager]\nDefaultTimeoutStartSec=infinity\nDefaultTimeoutStopSec=300\n"
        "DefaultDeviceTimeoutSec=infinity\n"
    )
    for folder in ("checkout", "share"):
        (root / folder).mkdir(exist_ok=True)


def _make_disk(root: Path, disk: Path) -> None:
    for waste in ("var/cache/apt", "var/lib/apt/lists", "usr/share/doc"):
        shutil.rmtree(root / waste, ignore_errors=True)
    part = disk.with_suffix(".part")
    host.run(
        "mkfs.ext4",
        "-q",
        "-d",
        str(root),
        "-O",
        "^has_journal",
        "-E",
        "root_owner=0:0",
        str(part),
        f"{SIZE_MB}M",
    )
    part.rename(disk)


@contextmanager
def _alone(cache: Path) -> Iterator[None]:
    with (cache / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _forget_others(cache: Path, image: Image) -> None:
    for other in cache.iterdir():
        if other.is_dir() and other != image.folder:
            shutil.rmtree(other, ignore_errors=True)


def _say(text: str) -> None:
    print(f"test machine: {text}", flush=True)


if __name__ == "__main__":
    print(cached_image().folder)
