"""A release of nothing but what the installer asks for, so that a hundred are installed in a minute."""

import re
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
SYSTEMD = ROOT / "systemd"

_CLI = """
import os, subprocess, sys
from pathlib import Path
from grabberd import __version__

def main():
    if sys.argv[1] == "--version":
        print("grabberd", __version__)
    elif sys.argv[1] == "check-config":
        if os.environ.get("FILL_AT") == "check-config":
            subprocess.run(["fill"])
        if f"not for {__version__}" in Path(sys.argv[2]).read_text():
            sys.exit(f"{__version__} refuses this configuration")
"""
_CONFIG = """
import os
from pathlib import Path
from types import SimpleNamespace

def load_config(file):
    return SimpleNamespace(state_directory=Path(os.environ["STATE_DIRECTORY"]))
"""
_STATE = """
import sqlite3
from contextlib import closing

class StateDatabase:
    def __init__(self, path):
        self.path = path

    def open(self):
        with closing(sqlite3.connect(self.path)) as connection, connection:
            version = connection.execute("PRAGMA user_version").fetchone()[0]
            if version > KNOWN:
                raise ValueError(f"the state is of version {version}, this program knows up to {KNOWN}")
            if version < KNOWN:
                connection.execute("CREATE TABLE IF NOT EXISTS newer (what)")
                connection.execute(f"PRAGMA user_version = {KNOWN}")
"""


def write_wheel(folder: Path, version: str, schema: int, without: str | None = None) -> Path:
    """A wheel of a release that knows the state up to a schema; `without`: a module is forgotten."""
    modules = dict.fromkeys(_imported(), "") | {
        "grabberd": f"__version__ = {version!r}",
        "grabberd.cli": _CLI,
        "grabberd.config": _CONFIG,
        "grabberd.archive.state.state_database": f"KNOWN = {schema}\n"
        + _STATE.replace("{{", "{").replace("}}", "}"),
    }
    files = {_path(name, modules): text for name, text in modules.items() if name != without}
    for name in modules:
        for parent in _parents(name):
            files.setdefault(f"{parent.replace('.', '/')}/__init__.py", "")
    files |= {f"grabberd_v4l2/{name}": f"# {version}\n" for name in _OF_DRIVER}
    data = f"grabberd-{version}.data/data/share/grabberd"
    for file in SYSTEMD.glob("*.*"):
        files[f"{data}/systemd/{file.name}"] = file.read_text() + f"# of {version}\n"
    files[f"{data}/configs/v4l2.yaml"] = "devices: {}\n"
    return _zipped(folder / f"grabberd-{version}-py3-none-any.whl", version, files)


_OF_DRIVER = ("udev/72-grabberd.rules", "modprobe/grabberd.conf")


def _imported() -> list[str]:
    """What the installer's checks import."""
    text = (SYSTEMD / "release_checks.py").read_text()
    found = re.search(r"^IMPORTED = \((.*?)\)", text, re.M | re.S)
    assert found
    return re.findall(r'"([\w.]+)"', found[1])


def _path(name: str, modules: dict[str, str]) -> str:
    is_package = any(other.startswith(f"{name}.") for other in modules) or "." not in name
    return f"{name.replace('.', '/')}{'/__init__.py' if is_package else '.py'}"


def _parents(name: str) -> list[str]:
    parts = name.split(".")
    return [".".join(parts[:count]) for count in range(1, len(parts))]


def _zipped(path: Path, version: str, files: dict[str, str]) -> Path:
    about = f"grabberd-{version}.dist-info"
    files[f"{about}/METADATA"] = (
        f"Metadata-Version: 2.1\nName: grabberd\nVersion: {version}\n"
        "Provides-Extra: report\nProvides-Extra: mqtt\n"
    )
    files[f"{about}/WHEEL"] = (
        "Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
    )
    record = "".join(f"{name},,\n" for name in (*files, f"{about}/RECORD"))
    with zipfile.ZipFile(path, "w") as wheel:
        for name, text in {**files, f"{about}/RECORD": record}.items():
            wheel.writestr(name, text)
    return path
