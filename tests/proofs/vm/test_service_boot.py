"""What the installer leaves, by systemd's own word."""

import re

from proofs.vm.guest import bus, unit
from proofs.vm.installed import Installed
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables


def test_the_installer_ends_with_a_service_that_runs(installed: Installed, service_tables: Tables) -> None:
    said = installed.installed["said"]
    assert "is installed in /opt/grabberd" in said
    assert "does not run yet" not in said, installed.installed["journal"]
    seconds = installed.machine.call(unit.until_ready, timeout_s=600)
    service_tables.add(
        "Starts", what="installed and running", seconds=_s(installed.installed["seconds"] + seconds)
    )


def test_the_service_is_active_and_says_how_its_grabber_fares(service: Machine) -> None:
    status = service.call(unit.status)
    assert re.search(r"Active: active \(running\)", status)
    assert 'Status: "cup is ready"' in status


def test_service_and_socket_are_started_at_boot(service: Machine) -> None:
    for name in ("grabberd.service", "grabberd.socket"):
        shown = service.call(unit.properties, names=["UnitFileState", "LoadState"], unit=name)
        assert shown == {"UnitFileState": "enabled", "LoadState": "loaded"}


def test_the_daemon_runs_as_its_user_without_a_network_of_its_own(service: Machine) -> None:
    names = ["User", "Group", "PrivateNetwork", "PrivateUsers", "TriggeredBy", "NRestarts"]
    shown = service.call(unit.properties, names=names, unit="grabberd.service")
    assert shown == {
        "User": "grabberd",
        "Group": "grabberd",
        "PrivateNetwork": "yes",
        "PrivateUsers": "yes",
        "TriggeredBy": "grabberd.socket",
        "NRestarts": "0",
    }
    assert service.call(unit.networks_of_daemon) == ["lo"]


def test_users_and_folders_are_as_they_are_written_down(service: Machine) -> None:
    assert service.call(unit.groups, user="grabberd") == ["grabberd", "video"]
    assert service.call(unit.rights, path="/var/lib/grabberd") == "750 grabberd grabberd"
    assert service.call(unit.rights, path="/etc/grabberd/grabberd.yaml") == "644 root root"


def test_the_udev_rule_gives_a_grabber_to_the_group_video(service: Machine) -> None:
    service.call(bus.plug_in_easycap)
    assert service.call(unit.rights_of_usb, vendor_product=bus.EASYCAP) == "660 root video"
    service.call(bus.unplug_easycap)


def _s(seconds: float) -> str:
    return f"{seconds:.0f} s"
