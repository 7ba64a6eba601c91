"""The first day of a new user: what is typed into a shell, and what a browser would fetch."""

import re
import subprocess
import time
import urllib.request
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

from proofs.vm.guest import unit, vivid
from proofs.vm.guest.client import ADDRESS, ask
from proofs.vm.guest.shell import run, wait_for

HOME = Path("/root/first-day")
ADDRESS_HERE, GATEWAY = "10.0.2.15/24", "10.0.2.2"
"""What QEMU's own network has for its guest."""
_LINKED = re.compile(r"""(?:src|href|from|import)\s*[=(]?\s*["']([^"'#?]+\.(?:js|css|svg|json))["']""")


def put_before_the_camera(film: str) -> None:
    """A grabber is plugged in, and its camera sees this film round and round."""
    if not Path(vivid.OUTPUT).exists():
        vivid.load_loop()
    vivid.stop_playing()
    Path("/dev/shm/film").write_bytes(Path(film).read_bytes())
    vivid.play("/dev/shm/film")


def type_in(line: str, timeout_s: float = 1200) -> dict[str, Any]:
    """Types a line into root's shell, in a folder of its own; exit code, what it said, its seconds."""
    HOME.mkdir(exist_ok=True)
    environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LC_ALL": "C.UTF-8"}
    environment |= {"DEBIAN_FRONTEND": "noninteractive", "MPLBACKEND": "agg", "TERM": "dumb"}
    started = time.monotonic()
    done = subprocess.run(
        ["bash", "-c", line],
        cwd=HOME,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=timeout_s,
        check=False,
    )
    return {"exit": done.returncode, "said": done.stdout, "seconds": time.monotonic() - started}


def until_told() -> str:
    """What systemd shows of the grabber, once the service runs and says anything of it."""
    shown = "systemctl show grabberd.service -p StatusText --value"
    wait_for(lambda: run(shown).startswith("cup is "), unit.PATIENCE_S, 0.2)
    return run(shown).strip()


def until_measured(points: int) -> float:
    """Seconds until so many targets are measured in a field."""

    def is_measured() -> bool:
        live = ask("/api/v1/state")["document"]["devices"]["cup"]["live"]
        return live is not None and live["points"] >= points

    return wait_for(is_measured, unit.PATIENCE_S, 0.2)


def fetch_page() -> dict[str, int]:
    """Everything that the page's document leads to, as a browser fetches it: bytes by address."""
    waiting, fetched = ["/"], dict[str, int]()
    while waiting:
        path = waiting.pop()
        with urllib.request.urlopen(ADDRESS + path, timeout=300) as answer:
            content = answer.read()
            is_text = answer.headers.get_content_type() in ("text/html", "text/javascript", "text/css")
        fetched[path] = len(content)
        if is_text:
            found = {urljoin(path, name) for name in _LINKED.findall(content.decode())}
            waiting += sorted(found - fetched.keys() - set(waiting))
    return fetched


def connect_network() -> None:
    """Plugs the computer into the network."""
    run("modprobe virtio_net; udevadm settle")
    (name,) = (path.name for path in Path("/sys/class/net").iterdir() if path.name != "lo")
    run(
        f"ip link set {name} up; ip address add {ADDRESS_HERE} dev {name}; ip route add default via {GATEWAY}"
    )


def until_answering() -> float:
    """Seconds until the daemon, which systemd started at boot, answers."""
    return wait_for(_answers, 800, 0.5)


def _answers() -> bool:
    try:
        with urllib.request.urlopen(f"{ADDRESS}/healthz", timeout=60) as answer:
            return bool(answer.status == 200)
    except OSError:
        return False
