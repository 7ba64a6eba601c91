"""How large all that is handed on is, and each package of this environment; which of them a daemon loads.

usage: sizes.py [PAGE]        in the Python of an environment that has grabberd, in a checkout; prints tables
                              in Markdown, or writes them as a page
"""

import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import urllib.request
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import Distribution, distributions
from pathlib import Path

LEAST_MB = 1.0
INSTALLERS = ("pip", "setuptools")
HANDED_ON = {
    "make wheel": "build/wheel/*.whl",
    "make sdist": "build/source/*.tar.gz",
    "make deb": "dist/deb/*.deb",
    "make bundle": "dist/*.tar.gz",
}
HEAD = """# Sizes

Written by `make sizes WRITE=1`: what is handed on, and an installation of the wheel without bytecode, package
by package. The last column tells whether a daemon with the simulated grabber had loaded any of it when fields
arrived.

"""
PATIENCE_S = 60.0


def serve(then: Callable[[set[str]], None]) -> None:
    """Runs the daemon; once fields arrive, `then` is told its modules, and all ends."""
    from grabberd.cli import main  # noqa: PLC0415

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    def end() -> None:
        until = time.monotonic() + PATIENCE_S
        while not is_ready(port) and time.monotonic() < until:
            time.sleep(0.2)
        try:
            then({name.partition(".")[0] for name in sys.modules})
        except Exception:
            traceback.print_exc()
            end_at_once(1)
        end_at_once(0)

    threading.Thread(target=end, daemon=True).start()
    sys.argv[1:] = ["serve", "--port", str(port)]
    main()


def end_at_once(code: int) -> None:
    """Ends the daemon, and with it all that it has kept."""
    shutil.rmtree(os.environ["STATE_DIRECTORY"], ignore_errors=True)
    sys.stdout.flush()
    os._exit(code)


def is_ready(port: int) -> bool:
    """Whether fields are arriving, by the daemon's own word."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5):
            return True
    except OSError:
        return False


def size_mb(one: Distribution) -> float:
    """Of its files as they lie on the disk, bytecode apart."""
    paths = [Path(str(one.locate_file(file))) for file in one.files or [] if file.suffix != ".pyc"]
    return sum(path.stat().st_size for path in paths if path.exists()) / 1e6


def names(one: Distribution) -> set[str]:
    """The modules that it brings, by their first names."""
    return {file.parts[0].removesuffix(".py") for file in one.files or [] if file.suffix in (".py", ".so")}


def tables(loaded: set[str]) -> Iterator[str]:
    """What is handed on, as far as it was made; then packages, the largest first, small ones together."""
    yield "| made by | file | MB |\n|---|---|---|"
    yield from handed_on()
    ours = [one for one in distributions() if one.name not in INSTALLERS]
    rows = sorted(((size_mb(one), one.name, bool(names(one) & loaded)) for one in ours), reverse=True)
    yield "\n| package | MB | loaded by a daemon |\n|---|---|---|"
    for size, name, is_loaded in rows:
        if size >= LEAST_MB:
            yield f"| {name} | {size:.0f} | {'yes' if is_loaded else 'no: by commands and jobs'} |"
    small = [size for size, _, _ in rows if size < LEAST_MB]
    yield f"| {len(small)} others | {sum(small):.0f} | some |"
    yield f"| all | {sum(size for size, _, _ in rows):.0f} | |"


def handed_on() -> Iterator[str]:
    """A row of each file that a person is given, and of what the Debian package becomes."""
    for command, pattern in HANDED_ON.items():
        for file in sorted(Path().glob(pattern)):
            yield f"| `{command}` | {file.name} | {file.stat().st_size / 1e6:.1f} |"
            if file.suffix == ".deb" and shutil.which("dpkg-deb"):
                field = ["dpkg-deb", "--field", str(file), "Installed-Size"]
                kb = int(subprocess.run(field, capture_output=True, text=True, check=True).stdout)
                yield f"| | installed, with bytecode | {kb * 1.024 / 1e3:.0f} |"


def tell(loaded: set[str], page: str | None) -> None:
    """Prints the tables, or writes the page."""
    text = "\n".join(tables(loaded)) + "\n"
    if page is None:
        print(text, end="")
    else:
        Path(page).write_text(HEAD + text, encoding="utf-8")


if __name__ == "__main__":
    os.environ["STATE_DIRECTORY"] = tempfile.mkdtemp(prefix="grabberd-sizes-")
    serve(partial(tell, page=sys.argv[1] if len(sys.argv) > 1 else None))
