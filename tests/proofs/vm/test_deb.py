"""The Debian package: installed by dpkg it runs as the installer's does; purged, it leaves captures."""

import os
import shutil
import subprocess
import sysconfig
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from proofs.vm.guest import bus, client, package, unit
from proofs.vm.image import CHECKOUT, cached_image
from proofs.vm.installed import bundle_of_grabberd, new_disks
from proofs.vm.machine import Machine, counted

PYTHON = "/usr/bin/python3"
LONG_S = 1500
"""Of the host's time: dpkg starts Python half a dozen times, and the daemon twice."""


@pytest.fixture(scope="module")
def packaged() -> Iterator[Machine]:
    """A machine on which dpkg has installed the package, and whose service is ready."""
    folder = Path(tempfile.mkdtemp(prefix="grabberd-vm-deb-"))
    machine = None
    try:
        deb = _package(folder)
        image = cached_image()
        machine = Machine(image, counted(0), disks=new_disks(image, folder))
        shutil.copy(deb, machine.share / "grabberd.deb")
        done = machine.call(package.install, deb="/share/grabberd.deb", timeout_s=LONG_S - 300)
        assert done["exit"] == 0, done["said"] + done["journal"]
        machine.call(unit.until_ready, timeout_s=600)
        yield machine
    finally:
        if machine is not None:
            machine.stop()
        shutil.rmtree(folder, ignore_errors=True)


def _package(folder: Path) -> Path:
    """Of grabberd alone: the image has the other packages."""
    bundle = bundle_of_grabberd(folder / "bundle")
    command = ["bash", str(CHECKOUT / "systemd" / "deb.sh"), str(bundle), PYTHON, str(folder / "made")]
    environment = {**os.environ, "PACKAGES": sysconfig.get_path("purelib"), "COMPRESSION": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (made,) = (folder / "made").glob("*.deb")
    return made


@pytest.mark.timeout(LONG_S)
def test_dpkg_finds_it_installed_and_whole(packaged: Machine) -> None:
    assert packaged.call(package.status) == "install ok installed"


@pytest.mark.timeout(LONG_S)
def test_the_service_runs_from_the_package_and_at_boot(packaged: Machine) -> None:
    assert 'Status: "cup is ready"' in packaged.call(unit.status)
    names = ["User", "FragmentPath", "UnitFileState", "ActiveState", "PrivateNetwork"]
    shown = packaged.call(unit.properties, names=names, unit="grabberd.service")
    assert shown.pop("FragmentPath").endswith("/lib/systemd/system/grabberd.service")
    assert shown == {
        "User": "grabberd",
        "UnitFileState": "enabled",
        "ActiveState": "active",
        "PrivateNetwork": "yes",
    }
    assert packaged.call(unit.rights, path="/var/lib/grabberd") == "750 grabberd grabberd"
    assert packaged.call(unit.groups, user="grabberd") == ["grabberd", "video"]


@pytest.mark.timeout(LONG_S)
def test_its_udev_rule_gives_a_grabber_to_the_group_video(packaged: Machine) -> None:
    packaged.call(bus.plug_in_easycap)
    assert packaged.call(unit.rights_of_usb, vendor_product=bus.EASYCAP) == "660 root video"
    packaged.call(bus.unplug_easycap)


@pytest.mark.timeout(LONG_S)
def test_installed_again_it_has_its_captures(packaged: Machine, request: pytest.FixtureRequest) -> None:
    if not request.config.getoption("--write-tables"):
        pytest.skip(
            "takes minutes, and tests/systemd upgrades a small package in a scratch root: WRITE=1 runs it"
        )
    capture = packaged.call(client.capture, fields=25)
    again = packaged.call(package.dpkg, words="--install /share/grabberd.deb", timeout_s=LONG_S - 300)
    assert again["exit"] == 0, again["said"] + again["journal"]
    packaged.call(unit.until_ready, timeout_s=600)
    assert capture["id"] in packaged.call(client.listed)


@pytest.mark.timeout(LONG_S)
def test_purged_it_leaves_its_captures(packaged: Machine) -> None:
    capture = packaged.call(client.capture, fields=25)
    assert capture["verdict"] == "complete"
    purged = packaged.call(package.dpkg, words="--purge grabberd", timeout_s=300)
    assert purged["exit"] == 0, purged["said"]
    assert packaged.call(package.unit_state) == "not-found"
    assert packaged.call(package.left, folder="/usr/lib/grabberd") == []
    assert packaged.call(package.left, folder="/etc/grabberd") == []
    kept = packaged.call(package.left, folder="/var/lib/grabberd/captures")
    assert any(capture["id"] in name for name in kept), kept
