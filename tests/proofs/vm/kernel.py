"""Debian's own kernels: images, the modules that the guest needs, and a first root that mounts the real."""

import lzma
import re
import shutil
from pathlib import Path

from proofs.vm.host import Archive, run

META_PACKAGE = "linux-image-amd64"
MODULE_FOLDERS = (
    "drivers/block",
    "drivers/char",
    "drivers/gpio",
    "drivers/hid",
    "drivers/input",
    "drivers/i2c",
    "drivers/media",
    "drivers/net/net_failover.ko",
    "drivers/net/virtio_net.ko",
    "drivers/usb",
    "drivers/virtio",
    "drivers/watchdog",
    "drivers/video",
    "fs/9p",
    "fs/configfs",
    "fs/ext4",
    "fs/fscache",
    "fs/jbd2",
    "fs/netfs",
    "fs/mbcache.ko",
    "crypto",
    "arch/x86/crypto",
    "lib",
    "net/9p",
    "net/core/failover.ko",
    "sound/core",
    "sound/soundcore.ko",
    "sound/usb",
)
FIRST_MODULES = ("virtio_pci", "virtio_blk", "ext4", "crc32c_generic")
FIRST_PROGRAM = """#!/bin/busybox sh
/bin/busybox mount -t devtmpfs dev /dev
/bin/busybox mount -t proc proc /proc
for module in {modules}; do /bin/busybox insmod /modules/$module; done
while ! /bin/busybox mount -t ext4 -o rw /dev/vda /root; do /bin/busybox sleep .1; done
/bin/busybox umount /proc
/bin/busybox mount --move /dev /root/dev
exec /bin/busybox switch_root /root /sbin/init
"""


def unpack(release: str, folder: Path) -> Path:
    """Fetches and unpacks the newest kernel of a Debian release ("trixie") below a folder."""
    archive = Archive(release, folder / release)
    names = re.findall(r"Depends: (linux-image-\S+)", archive.cache("depends", META_PACKAGE))
    if not names:
        raise RuntimeError(f"Debian's archive has no {META_PACKAGE} for {release}")
    package = archive.download(names[0])
    run("dpkg-deb", "-x", str(package), str(folder / release / "kernel"))
    return folder / release / "kernel"


def install(kernel: Path, root: Path) -> str:
    """Copies the needed modules into the guest's root; returns the kernel's version."""
    (modules,) = [*kernel.glob("lib/modules/*"), *kernel.glob("usr/lib/modules/*")]
    version, target = modules.name, root / "usr" / "lib" / "modules" / modules.name
    for part in MODULE_FOLDERS:
        _copy(modules / "kernel" / part, target / "kernel" / part)
    for index in ("modules.builtin", "modules.builtin.modinfo", "modules.order"):
        shutil.copy(modules / index, target / index)
    run("depmod", "-b", str(root / "usr"), version)
    return version


def write_first_root(root: Path, version: str, folder: Path, archive: Path) -> None:
    """The initrd: busybox, and the modules without which there is no root."""
    base = root / "usr" / "lib" / "modules" / version
    names = _in_order(base / "modules.dep")
    for part in ("bin", "dev", "proc", "root", "modules"):
        (folder / part).mkdir(parents=True)
    shutil.copy(str(shutil.which("busybox")), folder / "bin" / "busybox")
    for name in names:
        shutil.copy(base / name, folder / "modules" / Path(name).name)
    program = FIRST_PROGRAM.format(modules=" ".join(Path(name).name for name in names))
    (folder / "init").write_text(program)
    (folder / "init").chmod(0o755)
    run("sh", "-c", f"find . | busybox cpio -o -H newc 2>/dev/null | gzip -1 > {archive}", cwd=folder)


def _copy(source: Path, target: Path) -> None:
    """A module or a folder of them, unpacked: from Debian 13 on they are compressed."""
    packed = source.with_name(source.name + ".xz")
    for module in source.rglob("*.ko*") if source.is_dir() else filter(Path.exists, (source, packed)):
        there = target / module.relative_to(source) if source.is_dir() else target
        there.parent.mkdir(parents=True, exist_ok=True)
        if module.suffix == ".xz":
            there.with_name(module.stem).write_bytes(lzma.decompress(module.read_bytes()))
        else:
            shutil.copy(module, there)


def _in_order(dependencies: Path) -> list[str]:
    """The first modules and what they need, each after what it needs."""
    lines = (line.split(":") for line in dependencies.read_text().splitlines())
    needs = {path: rest.split() for path, rest in lines}
    by_name = {Path(path).name.removesuffix(".ko").replace("-", "_"): path for path in needs}
    ordered: list[str] = []
    for name in FIRST_MODULES:
        if name in by_name:
            ordered += [*reversed(needs[by_name[name]]), by_name[name]]
    return list(dict.fromkeys(ordered))
