"""The installed service as its administrator has it: the installer, the unit, its processes, its disk."""

import hashlib
import os
import signal
import stat
import subprocess
import time
from pathlib import Path
from typing import Any

from grabberd_v4l2.devices import usb_places
from proofs.vm.guest.shell import run, wait_for

SERVICE = "grabberd.service"
STATE = Path("/var/lib/grabberd")
CONFIG = Path("/etc/grabberd/grabberd.yaml")
SITE = "/opt/site"
VIVID = "n_devs=1 node_types=0x1 num_inputs=2 input_types=0x9 ccs_cap_mode=0"
PATIENCE_S = 600.0
"""Of the guest's time: a start takes it half a minute."""

_PACKAGES = f"[Service]\nEnvironment=PYTHONPATH={SITE}\n"
"""The packages are the image's: to unpack a bundle's would take this processor ten minutes."""


def install(bundle: str) -> dict[str, Any]:
    """Runs the installer of a bundle on a machine that has what the service needs.

    Returns:
        its seconds, what it said, and what the service has said since.
    """
    prepare()
    started = time.monotonic()
    said = run(f"cd /opt && tar xzf {bundle} && {as_administrator()} sh grabberd-*/installer.sh 2>&1", 1200)
    return {"seconds": time.monotonic() - started, "said": said, "journal": journal(100)}


def prepare() -> None:
    """Gives the machine a grabber and a disk for captures, as at every later boot."""
    _write("/etc/modules-load.d/grabber.conf", "vivid\n")
    _write("/etc/modprobe.d/grabber.conf", f"options vivid {VIVID}\n")
    _write("/etc/systemd/system/grabberd.service.d/packages.conf", _PACKAGES)
    with open("/etc/fstab", "a") as fstab:
        fstab.write(f"/dev/vdb {STATE} ext4 errors=remount-ro 0 2\n")
    STATE.mkdir(parents=True, exist_ok=True)
    run(f"systemctl daemon-reload; mount {STATE}; modprobe vivid; udevadm settle")


def upgrade(fail_at: str = "") -> dict[str, Any]:
    """Runs the bundle's installer once more; a step may be told to fail."""
    return _installer(f"/opt/{_bundle()}/installer.sh install", fail_at)


def roll_back() -> dict[str, Any]:
    """Runs the installed installer, which goes back to the release before."""
    return _installer("/opt/grabberd/current/share/grabberd/systemd/installer.sh rollback", "")


def _bundle() -> str:
    return next(path.name for path in Path("/opt").glob("grabberd-*") if path.is_dir())


def _installer(words: str, fail_at: str) -> dict[str, Any]:
    """Its exit code, what it said, its seconds; which release is installed then, and which is kept."""
    started = time.monotonic()
    line = f"{as_administrator()} FAIL_AT={fail_at} HEALTH_S=300 sh {words} 2>&1"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=1200, check=False)
    seconds = time.monotonic() - started
    return {"exit": done.returncode, "said": done.stdout, "seconds": seconds, **releases()}


def releases() -> dict[str, Any]:
    """Which release is installed, which is kept, and all that are there."""
    folder = Path("/opt/grabberd")
    links = {name: os.readlink(folder / name) for name in ("current", "previous") if (folder / name).exists()}
    return {**links, "all": sorted(path.name for path in (folder / "releases").iterdir())}


def digests(folder: str) -> dict[str, str]:
    """SHA-256 of every file below a folder of the state directory."""
    files = sorted(path for path in (STATE / folder).rglob("*") if path.is_file())
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def as_administrator() -> str:
    """Without what the agent's own environment has; the packages that are there already count."""
    return f"env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root PIP_NO_DEPS=1 PYTHONPATH={SITE}"


def command(words: str) -> dict[str, Any]:
    """Runs `grabberd` as its user, as the documentation has it."""
    line = f"runuser -u grabberd -- env PYTHONPATH={SITE} grabberd {words}"
    done = subprocess.run(["sh", "-c", line], capture_output=True, text=True, timeout=600, check=False)
    return {"exit": done.returncode, "out": done.stdout, "err": done.stderr}


def shown(*names: str, unit: str = SERVICE) -> dict[str, str]:
    """Properties of a unit."""
    said = run(f"systemctl show {unit} {' '.join(f'-p {name}' for name in names)}")
    return dict(line.split("=", 1) for line in said.splitlines())


def properties(names: list[str], unit: str) -> dict[str, str]:
    """Properties of a unit."""
    return shown(*names, unit=unit)


def status() -> str:
    """What an administrator is shown."""
    return run(f"systemctl status {SERVICE} --no-pager --lines=0 || true")


def journal(lines: int = 30) -> str:
    """What the service said last."""
    return run(f"journalctl -u {SERVICE} -n {lines} -o cat --no-pager")


def until_ready(but_pid: int = 0) -> float:
    """Seconds until the service runs, by systemd's word, and its grabber delivers."""
    return wait_for(lambda: _is_ready(but_pid), PATIENCE_S, 0.1)


def _is_ready(but_pid: int) -> bool:
    now = shown("ActiveState", "MainPID", "StatusText")
    is_other = int(now["MainPID"]) != but_pid
    return now["ActiveState"] == "active" and now["StatusText"] == "cup is ready" and is_other


def until_failed() -> dict[str, str]:
    """Waits until the service has ended by itself; how systemd saw it."""
    wait_for(lambda: shown("ActiveState")["ActiveState"] == "failed", PATIENCE_S, 0.1)
    return shown("ActiveState", "Result", "ExecMainStatus", "NRestarts")


def main_pid() -> int:
    """The daemon's process."""
    return int(shown("MainPID")["MainPID"])


def struck(name: str) -> dict[str, Any]:
    """Sends the daemon a signal and waits until another has taken its place and is ready.

    Returns:
        `at_ns`: when it was sent, by CLOCK_MONOTONIC; `gone_s`: until the process had ended; `back_s`: until
        the next one was ready; `result` and `restarts` as systemd counts them.
    """
    pid, at_ns = main_pid(), time.monotonic_ns()
    os.kill(pid, signal.Signals[name])
    gone_s = wait_for(lambda: not os.path.exists(f"/proc/{pid}"), PATIENCE_S)
    until_ready(but_pid=pid)
    return {"at_ns": at_ns, "gone_s": gone_s, "back_s": (time.monotonic_ns() - at_ns) / 1e9, **_restarts()}


def _restarts() -> dict[str, Any]:
    now = shown("NRestarts")
    return {"restarts": int(now["NRestarts"]), "journal": journal(60)}


def count_real_time_threads() -> dict[str, int]:
    """Threads of the daemon, by whether they run in real time (round robin)."""
    counts = {"real time": 0, "ordinary": 0}
    for task in Path(f"/proc/{main_pid()}/task").iterdir():
        after_name = (task / "stat").read_text().rpartition(")")[2].split()
        counts["real time" if int(after_name[38]) == os.SCHED_RR else "ordinary"] += 1
    return counts


def systemctl(verb: str) -> float:
    """Starts, stops or restarts the service; seconds until that was done, well or not."""
    started = time.monotonic()
    run(f"systemctl {verb} {SERVICE} || true", 900)
    return time.monotonic() - started


def exchange_config(text: str | None) -> str:
    """Writes another configuration, or none; returns what stood there."""
    before = CONFIG.read_text()
    if text is not None:
        CONFIG.write_text(text)
    return before


def idle(seconds: float) -> dict[str, str]:
    """Waits; how systemd sees the service then."""
    time.sleep(seconds)
    return shown("ActiveState", "Result", "ExecMainStatus", "NRestarts", "MainPID")


def rights(path: str) -> str:
    """Mode, owner and group."""
    there = os.stat(path)
    names = run(f"stat -c '%U %G' {path}").strip()
    return f"{stat.S_IMODE(there.st_mode):o} {names}"


def groups(user: str) -> list[str]:
    """The groups that a user is in."""
    return sorted(run(f"id -nG {user}").split())


def networks_of_daemon() -> list[str]:
    """The network interfaces that the daemon sees."""
    lines = Path(f"/proc/{main_pid()}/net/dev").read_text().splitlines()[2:]
    return sorted(line.partition(":")[0].strip() for line in lines)


def rights_of_usb(vendor_product: str) -> str:
    """Mode, owner and group of a USB device."""
    place = next(place for place in usb_places() if place.vendor_product == vendor_product)
    return rights(f"/dev/bus/usb/{place.bus:03d}/{place.address:03d}")


def add_user(name: str, group: str) -> None:
    """A person with an account on the machine."""
    run(f"id {name} >/dev/null 2>&1 || useradd --groups {group} {name}")


def step_clock(hours: float) -> None:
    """Sets the time of day."""
    now = time.clock_gettime(time.CLOCK_REALTIME)
    time.clock_settime(time.CLOCK_REALTIME, now + 3600 * hours)


def fill_disk(leave_bytes: int) -> int:
    """Takes what is free on the disk of the captures, but for so much; what is free then."""
    take = _free_bytes() - leave_bytes
    run(f"fallocate -o $(stat -c %s {STATE}/filler 2>/dev/null || echo 0) -l {take} {STATE}/filler || true")
    return _free_bytes()


def free_disk() -> int:
    """Gives it back."""
    (STATE / "filler").unlink(missing_ok=True)
    return _free_bytes()


def _free_bytes() -> int:
    disk = os.statvfs(STATE)
    return disk.f_bavail * disk.f_frsize


def break_disk() -> int:
    """Has the kernel find its file system faulty: read-only from then on; CLOCK_MONOTONIC then."""
    Path("/sys/fs/ext4/vdb/trigger_fs_error").write_text("1")
    wait_for(_nobody_can_write)
    return time.monotonic_ns()


def _nobody_can_write() -> bool:
    """Later kernels refuse without saying so in the file system's flags."""
    try:
        (STATE / "probe").write_bytes(b"")
    except OSError:
        return True
    return False


def mend_disk() -> str:
    """What an administrator does: stop, check, mount; returns what the check said."""
    systemctl("stop")
    run("systemctl stop grabberd.socket")
    wait_for(_unmounted)
    said = run("e2fsck -f -y /dev/vdb; test $? -le 2")
    run(f"mount {STATE}; systemctl start grabberd.socket")
    return said


def _unmounted() -> bool:
    """What a service that has just ended held in its own name space is let go of a little later."""
    return subprocess.run(["umount", str(STATE)], capture_output=True, check=False).returncode == 0


def mount_read_only(wanted: bool) -> None:
    """Mounts the disk of a service that is stopped so that nobody can write it, or as before."""
    run(f"mount -o remount,{'ro' if wanted else 'rw'} {STATE}")


def settle_disks() -> None:
    """Everything written so far is on the disks."""
    run("sync")


def _write(path: str, text: str) -> None:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text)


def limit_memory(more_bytes: int | None) -> None:
    """The service may take so much more than its programs hold now; None: what its unit says."""
    limit = "3G"
    if more_bytes is not None:
        group = Path(f"/sys/fs/cgroup{shown('ControlGroup')['ControlGroup']}/memory.stat").read_text()
        now = dict(line.split() for line in group.splitlines())
        limit = str(int(now["anon"]) + int(now["file_mapped"]) + more_bytes)
    run(f"systemctl set-property --runtime {SERVICE} MemoryMax={limit}")


def count_killed_for_memory() -> int:
    """How many of the service's processes the kernel has killed for want of memory."""
    events = Path(f"/sys/fs/cgroup{shown('ControlGroup')['ControlGroup']}/memory.events").read_text()
    return int(dict(line.split() for line in events.splitlines())["oom_kill"])


def size_of_daemon() -> dict[str, Any]:
    """Its process, resident memory, and how many files it has open."""
    pid = main_pid()
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return {"pid": pid, "memory_mb": pages * 4096 / 1e6, "descriptors": len(os.listdir(f"/proc/{pid}/fd"))}
