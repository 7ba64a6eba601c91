"""The units and what they are made of agree with the program, and with each other."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from grabberd.archive.capture_contents import LIMITS
from grabberd.cli import EX_CONFIG, EX_IOERR
from grabberd.config import load_config
from grabberd.work.job_runner import MEMORY_BYTES
from systemd.sandbox import allowed_calls, settings_of

ROOT = Path(__file__).parents[2]
SYSTEMD = ROOT / "systemd"
SERVICE = SYSTEMD / "grabberd.service"
DROP_INS = sorted((SYSTEMD / "drop-ins").glob("*.conf"))
UDEV_RULE = ROOT / "drivers" / "grabberd_v4l2" / "udev" / "72-grabberd.rules"

settings = settings_of(SERVICE)


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is missing")
def test_systemd_accepts_the_units_with_every_drop_in_and_finds_them_little_exposed() -> None:
    result = subprocess.run(
        [SYSTEMD / "check-units.sh"], capture_output=True, text=True, timeout=120, check=False
    )
    assert result.returncode == 0, result.stdout
    assert result.stdout.count("of at most 1.0") == 5
    assert result.stdout.count("of at most 1.5") == 2


def test_a_wrong_configuration_is_not_tried_again() -> None:
    assert settings["RestartPreventExitStatus"] == [f"{EX_IOERR} {EX_CONFIG}"]
    assert settings["Restart"] == ["on-failure"]


def test_a_program_that_keeps_failing_is_started_again_for_ever() -> None:
    text = SERVICE.read_text()
    interval_s, burst = (int(re.search(rf"^{key}=(\d+)", text, re.M)[1]) for key in LIMIT_KEYS)  # type: ignore[index]
    assert burst * int(settings["RestartSec"][0]) > interval_s


LIMIT_KEYS = ("StartLimitIntervalSec", "StartLimitBurst")


def test_a_grabber_that_is_plugged_in_wants_this_service_and_that_its_socket() -> None:
    assert re.findall(r'SYSTEMD_WANTS}\+="([^"]+)"', UDEV_RULE.read_text()) == [SERVICE.name]
    assert "Requires=grabberd.socket" in SERVICE.read_text()


def test_the_user_is_made_and_may_open_what_the_udev_rule_gives_to_its_group() -> None:
    (user,) = settings["User"]
    made = (SYSTEMD / "sysusers.conf").read_text()
    assert f"\nu {user} " in made
    assert f"m {user} video" in made
    assert set(re.findall(r'GROUP="(\w+)"', UDEV_RULE.read_text())) == {"video", "root"}  # sound is root's


@pytest.mark.skipif(not shutil.which("systemd-sysusers"), reason="systemd-sysusers is missing")
def test_user_and_state_directory_are_made_as_described(tmp_path: Path) -> None:
    (tmp_path / "etc").mkdir()
    for name, file in (("systemd-sysusers", "sysusers.conf"),):
        command = [name, f"--root={tmp_path}", SYSTEMD / file]
        result = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
        assert result.returncode == 0, result.stderr
    assert re.search(
        r"^grabberd:x?!?\*?:\d+:\d+:.*:/var/lib/grabberd:", (tmp_path / "etc/passwd").read_text(), re.M
    )
    assert re.search(r"^video:.*:grabberd$", (tmp_path / "etc/group").read_text(), re.M)


def test_jobs_and_readings_are_refused_memory_before_the_service_has_none_left() -> None:
    (most,) = settings["MemoryMax"]
    assert most.endswith("G")
    assert int(most[:-1]) * 2**30 - MEMORY_BYTES - LIMITS.data_bytes > OF_DAEMON_BYTES
    assert settings["OOMPolicy"] == ["continue"]


OF_DAEMON_BYTES = 400_000_000
"""Memory that it holds: docs/measured.md."""


def test_the_group_reads_captures_and_others_do_not() -> None:
    assert settings["UMask"] == ["0027"]
    assert settings["StateDirectoryMode"] == ["0750"]
    assert "d /var/lib/grabberd 0750 grabberd grabberd" in (SYSTEMD / "tmpfiles.conf").read_text()


def test_the_installed_configuration_is_right_and_names_the_units_state_directory() -> None:
    config = load_config(ROOT / "configs" / "v4l2.yaml")
    assert [device.driver for device in config.devices.values()] == ["v4l2"]
    assert config.state_directory == Path("/var/lib") / settings["StateDirectory"][0]


def test_the_installed_configuration_listens_where_the_socket_unit_does() -> None:
    http = load_config(ROOT / "configs" / "v4l2.yaml").http
    assert f"ListenStream={http.host}:{http.port}\n" in (SYSTEMD / "grabberd.socket").read_text()


@pytest.mark.parametrize("drop_in", DROP_INS, ids=lambda path: path.stem)
def test_every_drop_in_says_where_it_belongs(drop_in: Path) -> None:
    text = drop_in.read_text()
    place = re.search(r"# Install as /etc/systemd/system/grabberd\.(service|socket)\.d/(\S+)", text)
    assert place
    assert place[2] == drop_in.name
    assert f"[{place[1].capitalize()}]" in text


def test_every_drop_in_is_checked_and_described() -> None:
    checked = (SYSTEMD / "check-units.sh").read_text()
    described = (ROOT / "docs" / "howto" / "install.md").read_text()
    for drop_in in DROP_INS:
        assert re.search(rf"^check .*\b{drop_in.stem}\b", checked, re.M), drop_in.name
        assert f"{drop_in.name}" in described, drop_in.name


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is missing")
def test_calls_that_change_the_machine_are_not_let_through() -> None:
    allowed = allowed_calls(settings)
    assert {"setpriority", "openat", "mmap", "sendto"} <= allowed
    assert not {"mount", "setuid", "chown", "reboot", "ptrace", "bpf", "init_module"} & allowed


def test_the_sandbox_of_these_tests_forbids() -> None:
    tried = (
        "import ctypes, mmap, socket\n"
        "def fails(call):\n"
        "    try: call()\n"
        "    except OSError as error: return error.errno\n"
        "print(fails(lambda: mmap.mmap(-1, 4096, prot=7)), fails(lambda: socket.socket(socket.AF_INET)),\n"
        "    ctypes.CDLL(None).unshare(0x40000000), fails(lambda: mmap.mmap(-1, 4096, prot=3)))\n"
    )
    command = [sys.executable, ROOT / "tests/systemd/sandbox.py", SERVICE, sys.executable, "-c", tried]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert result.stdout.split() == ["1", "97", "-1", "None"]
