"""A machine in a folder: a root to install into, a systemd that runs what is there, a daemon that answers."""

import http.server
import json
import os
import shutil
import sqlite3
import subprocess
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from .small_release import SYSTEMD, write_wheel

PYTHON = Path("/usr/bin/python3")
NEEDED = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))"
PATIENCE_S = 120

_SYSTEMCTL = """#!/bin/sh
echo "$*" >>"$MACHINE/calls"
current=$DESTDIR/${RELEASE:-opt/grabberd/current}
case $1 in
    show) cat "$MACHINE/listen" ;;
    is-enabled) cat "$MACHINE/enabled" 2>/dev/null || echo enabled ;;
    stop) rm -f "$MACHINE/running"; [ "${FILL_AT:-}" != stop ] || fill ;;
    start)
        version=$("$current/bin/python" -c 'import grabberd; print(grabberd.__version__)')
        [ ! -e "$MACHINE/does-not-start-$version" ] || exit 1
        "$current/bin/python" -c 'if True:
            import sys
            from grabberd.archive.state.state_database import StateDatabase
            StateDatabase(sys.argv[1]).open()' "$DESTDIR/var/lib/grabberd/state.sqlite" || exit 1
        echo "$version" >"$MACHINE/running"
        [ "${FILL_AT:-}" != start ] || fill ;;
esac
"""
_PYTHON = """#!/bin/sh
# A venv is copied: to make one takes seconds.
if [ "$1 $2" = "-m venv" ]; then
    cp -a "$MACHINE/venv/." "$3"
    [ "${FILL_AT:-}" != venv ] || fill
    exit 0
fi
exec /usr/bin/python3 "$@"
"""
_FILL = """#!/bin/sh
cat /dev/zero >"$DESTDIR/filler" 2>/dev/null
exit 0
"""
_PROGRAMS = {
    "systemctl": _SYSTEMCTL,
    "python": _PYTHON,
    "fill": _FILL,
    **dict.fromkeys(("systemd-sysusers", "systemd-tmpfiles", "udevadm"), "#!/bin/sh\n"),
}


class Done(NamedTuple):
    """How the installer ended."""

    code: int
    said: str


class Rehearsed:
    """The machine; `root` is installed into, `machine` has what its systemd knows."""

    def __init__(self, machine: Path, root: Path) -> None:
        self.machine, self.root = machine, root
        self.state = root / "var/lib/grabberd/state.sqlite"
        self.config = root / "etc/grabberd/grabberd.yaml"
        self.variables: dict[str, str] = {}

    def install(self, version: str, schema: int = 1, without: str | None = None, **variables: str) -> Done:
        """Runs the installer of a bundle."""
        bundle = self.machine / f"bundle-{version}"
        if not bundle.exists():
            (bundle / "wheels").mkdir(parents=True)
            write_wheel(bundle / "wheels", version, schema, without)
            (bundle / "constraints.txt").touch()
            for name in ("installer.sh", "release.sh", "release_checks.py"):
                shutil.copy(SYSTEMD / name, bundle)
        return self.run(bundle / "installer.sh", "install", **variables)

    def rollback(self, **variables: str) -> Done:
        """Runs the installer that is installed."""
        installed = self.root / "opt/grabberd/current/share/grabberd/systemd/installer.sh"
        return self.run(installed, "rollback", **variables)

    def run(self, installer: Path, *words: str, **variables: str) -> Done:
        done = subprocess.run(
            ["sh", installer, *words],
            env=self.environment(**variables),
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        return Done(done.returncode, done.stdout + done.stderr)

    def environment(self, **variables: str) -> dict[str, str]:
        """Of an administrator on this machine."""
        programs = self.machine / "programs"
        return {
            "PATH": f"{programs}:/usr/bin:/bin:/usr/sbin:/sbin",
            "HOME": str(self.machine),
            "MACHINE": str(self.machine),
            "DESTDIR": str(self.root),
            "LIVE": "yes",
            "PYTHON": str(programs / "python"),
            "PYTHONDONTWRITEBYTECODE": "1",
            "PIP_CONFIG_FILE": "/dev/null",
            **variables,
        }

    @property
    def running(self) -> str | None:
        """The version of the daemon that runs."""
        file = self.machine / "running"
        return file.read_text().strip() if file.exists() else None

    @property
    def installed(self) -> str | None:
        """The version that the link names."""
        return self._version("current")

    @property
    def kept(self) -> str | None:
        """The version before."""
        return self._version("previous")

    @property
    def calls(self) -> list[str]:
        """What systemctl was asked, in order."""
        return (self.machine / "calls").read_text().splitlines()

    @property
    def schema(self) -> int:
        """Of the state database."""
        with closing(sqlite3.connect(self.state)) as connection:
            return int(connection.execute("PRAGMA user_version").fetchone()[0])

    def keep(self, note: str) -> None:
        """Writes something into the state."""
        with closing(sqlite3.connect(self.state)) as connection, connection:
            connection.execute("CREATE TABLE IF NOT EXISTS notes (note)")
            connection.execute("INSERT INTO notes VALUES (?)", (note,))

    def notes(self) -> list[str]:
        """All that was kept."""
        with closing(sqlite3.connect(self.state)) as connection:
            return [row[0] for row in connection.execute("SELECT note FROM notes ORDER BY rowid")]

    def everything(self) -> dict[str, Any]:
        """Every file and link of the root, byte for byte."""
        return {
            str(path.relative_to(self.root)): os.readlink(path) if path.is_symlink() else path.read_bytes()
            for path in sorted(self.root.rglob("*"))
            if (path.is_symlink() or path.is_file()) and path.name not in ("lock", "filler")
        }

    def _version(self, link: str) -> str | None:
        python = self.root / "opt/grabberd" / link / "bin/python"
        if not python.exists():
            return None
        command = [python, "-c", "import grabberd; print(grabberd.__version__)"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@contextmanager
def rehearsed(folder: Path, venv: Path, root: Path | None = None) -> Iterator[Rehearsed]:
    """A machine with captures and a state, on which nothing is installed."""
    machine, root = folder / "machine", root or folder / "root"
    (machine / "programs").mkdir(parents=True)
    root.mkdir(exist_ok=True)
    for name, text in _PROGRAMS.items():
        (machine / "programs" / name).write_text(text)
        (machine / "programs" / name).chmod(0o755)
    (machine / "venv").symlink_to(venv)
    (machine / "calls").touch()
    one = Rehearsed(machine, root)
    (one.state.parent / "captures").mkdir(parents=True)
    (one.state.parent / "captures" / "liner.grab").write_bytes(bytes(range(256)) * 100)
    with _daemon(machine) as port:
        (machine / "listen").write_text(f"127.0.0.1:{port} (Stream)\n")
        yield one


@contextmanager
def copied(one: Rehearsed, folder: Path) -> Iterator[Rehearsed]:
    """The same machine once more, in another folder."""
    subprocess.run(["cp", "-a", one.machine, one.root, folder], check=True)
    other = Rehearsed(folder / one.machine.name, folder / one.root.name)
    with _daemon(other.machine) as port:
        (other.machine / "listen").write_text(f"127.0.0.1:{port} (Stream)\n")
        yield other


@contextmanager
def _daemon(machine: Path) -> Iterator[int]:
    """Answers /healthz as the version that runs; one that is told to be silent is stuck."""

    class Health(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            file = machine / "running"
            version = file.read_text().strip() if file.exists() else ""
            is_well = version and not (machine / f"is-stuck-{version}").exists()
            body = json.dumps({"version": version}).encode()
            self.send_response(200 if is_well else 503)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Health)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def why_not() -> str | None:
    """Why nothing can be rehearsed on this computer."""
    if not PYTHON.exists() or subprocess.run([PYTHON, "-c", NEEDED], check=False).returncode:
        return f"{PYTHON} is missing, older than 3.11, or without venv: apt-get install python3-venv"
    return None if shutil.which("flock") else "flock is missing: apt-get install util-linux"
